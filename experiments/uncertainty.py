"""Coverage of the 1σ map: how often the 95 % band about ln r holds the solution without noise.

    python experiments/uncertainty.py --out out/uncertainty

Grey 8-bit photographs (gamma 2.2) with white noise of the stored values, smoothed in linear light as `reconstruct`
chooses. Per draw the band is made from that draw alone; the share of pixels that it holds is averaged over draws
("band") and given for the worst draw. "linear": the same without the shift that noise causes. "1σ of ln r": mean over
pixels and draws, beside the root mean square error ("true"). What the solver errs by on the image without noise, and
every other model error, is not in it.
"""

import argparse
import sys
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
from tqdm import tqdm

from data_synth import default_camera, observe, scene_from_text
from jaxsfs import (
    GammaResponse,
    Irradiance,
    NoFalloff,
    Surface,
    irradiance_of,
    irradiance_sigma,
    log_range,
    noise_sigma,
)

RESPONSE = GammaResponse(2.2)


@jax.jit
def solved(irradiance: Irradiance, camera) -> Surface:
    """The surface, by the differentiable solver."""
    found, known = log_range(irradiance, camera)
    return Surface(camera, jnp.exp(found), known)


def photograph(stored: np.ndarray, camera, valid: np.ndarray, smooth_px: float) -> Irradiance:
    """Irradiance of stored values."""
    return irradiance_of(stored, camera, valid=valid, response=RESPONSE, smooth_px=smooth_px, clip_limit=None)[0]


def row(text: str, size: int, noise: float, smooth_px: float, draws: int) -> dict[str, str]:
    """One line of the table."""
    scene = scene_from_text(text)
    view = observe(scene, default_camera(scene, size, size), half_field_deg=50.0)
    camera, valid = view.camera, np.asarray(view.surface.valid)
    linear = np.where(valid, np.asarray(view.irradiance.values), 0)
    stored = np.asarray(RESPONSE.encode(jnp.asarray(0.9 * linear / np.percentile(linear[valid], 99))))
    truth = np.log(np.asarray(solved(photograph(stored, camera, valid, smooth_px), camera).range))
    rng = np.random.default_rng(0)
    shares, linear_shares, sigmas, errors = [], [], [], []
    for draw in range(draws):
        noisy = stored + noise * rng.standard_normal(stored.shape)
        image = photograph(np.round(255 * np.clip(noisy, 0, 1)) / 255, camera, valid, smooth_px)
        spread = np.hypot(noise, 1 / 255 / np.sqrt(12))
        sigma = irradiance_sigma(image, camera, spread, response=RESPONSE, falloff=NoFalloff())
        options = {"smooth_px": smooth_px, "seed": draw}
        whole, part = (noise_sigma(lambda e: solved(e, camera), image, sigma, solves=n, **options) for n in (8, 0))
        error = np.log(np.asarray(solved(image, camera).range)) - truth
        used = valid & np.isfinite(whole)
        shares.append(np.mean(np.abs(error) < 1.96 * whole, where=used))
        linear_shares.append(np.mean(np.abs(error) < 1.96 * part, where=used))
        sigmas.append(whole[used].mean())
        errors.append(np.sqrt(np.mean(error**2, where=used)))
    return {
        "scene": text,
        "size": f"{size}²",
        "noise": f"{noise:.1%}",
        "smoothing": f"{smooth_px:g} px",
        "1σ of ln r": f"{np.mean(sigmas):.5f}",
        "true": f"{np.mean(errors):.5f}",
        "linear": f"{np.mean(linear_shares):.3f}",
        "band": f"{np.mean(shares):.3f}",
        "worst draw": f"{np.min(shares):.3f}",
    }


def markdown(rows: list[dict]) -> str:
    """Rows as a table."""
    head = list(rows[0])
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    return "\n".join(lines + ["| " + " | ".join(r[h] for h in head) + " |" for r in rows]) + "\n"


def run(out: Path, quick: bool) -> None:
    """Prints the table and writes it to `out`."""
    jobs = [("ball", 97, 0.004, 0.7, 3)]
    if not quick:
        scenes = ("ball", "wavy-wall", "tilted-plane")
        jobs = [(scene, 129, *level, 20) for scene in scenes for level in ((0.0, 0.7), (0.004, 0.7), (0.01, 1.0))]
        jobs += [("ball", 257, 0.004, 0.7, 10), ("ball", 129, 0.004, 0.0, 10)]
    table = markdown([row(*job) for job in tqdm(jobs, file=sys.stderr)])
    text = f"Made by `python experiments/uncertainty.py{' --quick' if quick else ''}`.\n\n{table}"
    out.mkdir(parents=True, exist_ok=True)
    (out / "uncertainty.md").write_text(text, encoding="utf-8")
    print(text)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="Coverage of the 1σ map by Monte Carlo.")
    parser.add_argument("--out", type=Path, default=Path("out/uncertainty"), help="folder for the table")
    parser.add_argument("--quick", action="store_true", help="one scene, three draws")
    arguments = parser.parse_args()
    run(arguments.out, arguments.quick)
