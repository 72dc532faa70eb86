"""What photographing costs: reconstructions from stored 8-bit pictures beside those from the clean linear image.

    python experiments/photographs.py --out out/photographs
    python experiments/photographs.py --quick
    python experiments/photographs.py --smoothing
    python experiments/photographs.py --clipping

Every scene of `data_synth` and several random ones (report seeds) is photographed as a scope would: sRGB, 8 bit, noise
of 0.4 % of full scale, highlights that clip, exposed so that the 99th percentile is 0.9 of full scale. Columns: mean
relative error of range after median scaling from the exact image, from the photograph with highlights left in, and
from the photograph as `jaxsfs reconstruct` prepares it. `--smoothing` instead compares ways to smooth, without
highlights, on clean and noisy pictures. `--clipping`: exposed so that a channel clips in 36 % of the pixels; errors
with clipped values taken as data and as prepared, there over all pixels and over the clipped ones, and the share of the
clipped ones that lie on a plateau (ln r within 1e-4 of both neighbours', which no wall here is). Prints a Markdown
table and writes it with the command that made it.
"""

import argparse
import shlex
import sys
from pathlib import Path

import cv2
import jax.numpy as jnp
import numpy as np
from stored import irradiance_of_stored
from tqdm import tqdm

from data_synth import REPORT_SEEDS, default_camera, scene_from_text, take_photo
from data_synth.viewing import View, observe
from jaxsfs import Irradiance, evaluate, reconstruct
from jaxsfs.photo import irradiance_of, parse_channel

OPEN = ("plane", "tilted-plane", "ball", "hollow-ball", "wavy-wall", "tube")
OCCLUDED = ("ball-in-bowl", "polyps", "colon")
WEIGHTS = parse_channel("luminance")
LIMIT = 254 / 255


def abs_rel(view: View, irradiance: Irradiance) -> float:
    """Mean relative error of range after median scaling."""
    found = reconstruct(Irradiance(irradiance.values.astype(jnp.float32), irradiance.valid), view.camera).surface
    both = np.asarray(found.valid & view.surface.valid)
    masked = [np.where(both, np.asarray(one, float), np.nan) for one in (found.range, view.surface.range)]
    return float(evaluate(*masked, quantity="range", align="median").abs_rel)


def seen(name: str, size: tuple[int, int]) -> View:
    """The exact view of a scene in a round field of 50°."""
    scene = scene_from_text(name)
    return observe(scene, default_camera(scene, *size), half_field_deg=50.0)


def from_photograph(view: View, stored: np.ndarray, specular: str) -> float:
    """The error from a stored picture, prepared with the defaults of the command line."""
    valid = np.asarray(view.surface.valid)
    return abs_rel(view, irradiance_of_stored(stored / 255.0, view.camera, valid, specular=specular))


def photographs(names: list[str], size: tuple[int, int]) -> list[tuple[str, ...]]:
    """Rows of the table: scene, clean, highlights left in, prepared, the bound of the aim, met or missed."""
    rows = []
    for name in tqdm(names, file=sys.stderr, disable=None):
        view = seen(name, size)
        clean = abs_rel(view, view.irradiance)
        stored = take_photo(view, shine=0.5, read_noise=0.004, seed=1).stored
        left_in, ours = (from_photograph(view, stored, method) for method in ("off", "auto"))
        bound = max(2 * clean, 0.02 if np.asarray(view.cuts).any() else 0.008)
        verdict = "met" if ours <= bound else "missed"
        rows.append((name, f"{clean:.4f}", f"{left_in:.4f}", f"{ours:.4f}", f"{bound:.4f}", verdict))
    return rows


def smoothings(names: list[str], size: tuple[int, int]) -> list[tuple[str, ...]]:
    """Rows: scene, noise, error for Gaussians in linear light and bilateral filters of ln E."""
    rows = []
    for name in tqdm(names, file=sys.stderr, disable=None):
        view = seen(name, size)
        valid = np.asarray(view.surface.valid)
        for noise in (0.0, 0.004, 0.02):
            stored = take_photo(view, read_noise=noise, seed=1, bits=8 if noise else None).stored
            stored = stored / 255.0 if noise else stored
            cells = [name, f"{noise:.1%}"]
            for sigma in (0.0, 0.7, 1.0, 1.5):
                smoothed, _ = irradiance_of(stored, view.camera, valid=valid, smooth_px=sigma, clip_limit=None)
                cells.append(f"{abs_rel(view, smoothed):.4f}")
            plain, _ = irradiance_of(stored, view.camera, valid=valid, clip_limit=None)
            for spread, sigma in ((0.1, 1.0), (0.2, 1.5)):
                cells.append(f"{abs_rel(view, bilateral(plain, spread, sigma)):.4f}")
            rows.append(tuple(cells))
    return rows


def clippings(names: list[str], size: tuple[int, int]) -> list[tuple[str, ...]]:
    """Rows: scene, share clipped, error of the exact image; over all and over the clipped pixels with clipped values as
    data, and as prepared; plateaus in both."""
    rows = []
    for name in tqdm(names, file=sys.stderr, disable=None):
        view = seen(name, size)
        valid = np.asarray(view.surface.valid)
        # the brightest channel of the 64th percentile is at full scale
        stored = take_photo(view, read_noise=0.004, seed=1, percentile=64, level=1.0).stored / 255.0
        clipped = (stored >= LIMIT).any(axis=-1) & valid
        as_data, _ = irradiance_of(stored, view.camera, valid=valid, clip_limit=None)
        cells = [name, f"{clipped.sum() / valid.sum():.0%}", f"{abs_rel(view, view.irradiance):.4f}"]
        flats = []
        for irradiance in (as_data, irradiance_of_stored(stored, view.camera, valid)):
            found = reconstruct(
                Irradiance(irradiance.values.astype(jnp.float32), irradiance.valid), view.camera
            ).surface
            there = np.asarray(found.valid) & valid
            ratio = np.where(there, np.asarray(found.range, float) / np.asarray(view.surface.range, float), np.nan)
            errors = np.abs(ratio / np.nanmedian(ratio) - 1)
            cells += [f"{np.nanmean(errors):.4f}", f"{np.nanmean(errors[clipped]):.4f}"]
            flats.append(f"{plateau(np.asarray(found.range, float), clipped & there):.1%}")
        rows.append((*cells, *flats))
    return rows


def plateau(distance: np.ndarray, where: np.ndarray) -> float:
    """Share of the pixels `where` ln r hardly differs from the next right and below."""
    log = np.log(np.maximum(distance, 1e-9))
    flat = np.zeros(log.shape, bool)
    flat[:-1, :-1] = np.hypot(np.diff(log, axis=1)[:-1], np.diff(log, axis=0)[:, :-1]) < 1e-4
    return float(flat[where].mean())


def bilateral(irradiance: Irradiance, spread: float, sigma_px: float) -> Irradiance:
    """Edge-preserving smoothing of ln E: Gaussian in space, and in ln E of width `spread`."""
    valid = np.asarray(irradiance.valid)
    log = np.log(np.where(valid, np.asarray(irradiance.values), 1)).astype(np.float32)
    log = np.where(valid, log, np.median(log[valid])).astype(np.float32)
    return Irradiance(jnp.asarray(np.exp(cv2.bilateralFilter(log, -1, spread, sigma_px))), irradiance.valid)


def markdown(header: tuple[str, ...], rows: list[tuple[str, ...]]) -> str:
    lines = [header, ("---",) * len(header), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines) + "\n"


def main() -> None:
    parser = argparse.ArgumentParser(description="What photographing costs.")
    parser.add_argument("--out", type=Path, default=Path("out/photographs"))
    parser.add_argument("--quick", action="store_true", help="three scenes, small pictures")
    parser.add_argument("--smoothing", action="store_true", help="compare ways to smooth instead")
    parser.add_argument("--clipping", action="store_true", help="36 %% of the pixels clipped instead")
    parser.add_argument("--random", type=int, default=6, help="number of random scenes")
    options = parser.parse_args()
    size = (160, 120) if options.quick else (320, 240) if options.smoothing or options.clipping else (640, 480)
    names = [*OPEN, *OCCLUDED, *(f"random:{seed}" for seed in REPORT_SEEDS[: options.random])]
    names = ["plane", "ball", "polyps"] if options.quick else names
    if options.clipping:
        header = (
            "scene",
            "clipped",
            "clean",
            "as data",
            "in clipped",
            "prepared",
            "in clipped",
            "plateaus: data",
            "prepared",
        )
        table = markdown(header, clippings(names, size))
    elif options.smoothing:
        header = ("scene", "noise", "0", "0.7 px", "1 px", "1.5 px", "bilateral 0.1, 1 px", "bilateral 0.2, 1.5 px")
        table = markdown(header, smoothings(names, size))
    else:
        header = ("scene", "clean", "highlights left in", "prepared", "aim", "")
        table = markdown(header, photographs(names, size))
    options.out.mkdir(parents=True, exist_ok=True)
    command = shlex.join(["python", *sys.argv])
    name = "smoothing.md" if options.smoothing else "clipping.md" if options.clipping else "photographs.md"
    (options.out / name).write_text(f"`{command}`\n\n{table}", encoding="utf-8")
    print(table, end="")


if __name__ == "__main__":
    main()
