"""What keeps the rendered colonoscopy frames (SimCol3D) from smaller errors: photometry, known ranges, or the solver.

    python experiments/real_limits.py --out out/real_limits
    python experiments/real_limits.py --quick

AbsRel of depth after median scaling, per frame and reading of the camera (see real_data.py):

* preset: `--preset colonoscope`.
* photometry of frame 0000: γ 2.4, μ 1.6, a 0.8, which fitted the depth of 0000 best, applied unchanged.
* two known ranges: what `--preset colonoscope --estimate-photometry` finds from the ranges of two pixels, one among the
  nearest fifth, one among the farthest; mean and sd over 10 pairs.
* γ, μ, a fitted to the whole truth of the frame: no estimate of these three can do better.
* E of the true depth: the picture replaced by cos θ/r² of the true surface. What is left is the solver's: contours,
  and walls that the rim cuts off. The rest of the error is light and colour that the model does not have.
"""

import argparse
import os
import shlex
import sys
from pathlib import Path

import jax.numpy as jnp
import numpy as np
from real_cases import SIMCOL, SIMCOL_CAMERAS, SIMCOL_FRAMES, Case, simcol_case
from real_solving import PRESET, Settings, prepared, score, solve
from tqdm import tqdm

from jaxsfs import Irradiance, parse_falloff, parse_reflectance, parse_response, reconstruct
from jaxsfs.estimation import estimate_photometry, prior_about
from jaxsfs.surface import Surface

STEPS = np.array([0.2, 0.4, 0.15])
PRIOR = (
    (parse_response, PRESET.response),
    (parse_falloff, PRESET.falloff),
    (parse_reflectance, PRESET.reflectance),
)
OF_0000 = (2.4, 1.6, 0.8)
PAIRS = 10


def settings(gamma: float, mu: float, power: float) -> Settings:
    """A response, fall-off and reflectance."""
    return PRESET._replace(response=f"gamma:{gamma:g}", falloff=f"cos:{mu:g}", reflectance=f"power:{power:g}")


def error(case: Case, values: tuple[float, float, float]) -> float:
    return score(case, solve(case, settings(*values)))["abs_rel"]


def fitted(case: Case) -> tuple[tuple[float, float, float], float]:
    """The photometry whose depth is nearest to the truth, by steps along one parameter at a time."""
    best, least = OF_0000, error(case, OF_0000)
    for index in (0, 2, 1, 0):
        for sign in (1, -1):
            while True:
                tried = np.array(best)
                tried[index] += sign * STEPS[index]
                found = error(case, tuple(tried))
                if not found < least:
                    break
                best, least = tuple(np.round(tried, 3)), found
    return best, least


def two_ranges(case: Case) -> tuple[float, float, float]:
    """AbsRel with the photometry that two known ranges and the preset as a prior give, its sd over pairs of pixels, and
    the mean γ."""
    assert case.depth is not None
    prior = prior_about(*(parse(text) for parse, text in PRIOR))
    light = prepared(case, PRESET._replace(falloff="none")).irradiance
    stored = np.asarray(parse_response(PRESET.response).encode(light.values))
    true, usable = case.depth / np.asarray(case.camera.rays())[..., 2], np.asarray(light.valid)
    near, far = (np.argwhere(usable & chosen) for chosen in _fifths(true, usable & np.isfinite(true)))
    rng = np.random.default_rng(0)
    errors, gammas = [], []
    for pair in zip(rng.choice(near, PAIRS), rng.choice(far, PAIRS), strict=True):
        known = [(int(u), int(v), float(true[v, u])) for v, u in pair]
        found = estimate_photometry(stored, case.camera, known, usable, prior)
        errors.append(error(case, (found.gamma, found.mu, found.power)))
        gammas.append(found.gamma)
    return float(np.mean(errors)), float(np.std(errors)), float(np.mean(gammas))


def _fifths(true: np.ndarray, usable: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    low, high = np.percentile(true[usable], [20, 80])
    return true < low, true > high


def of_true_depth(case: Case) -> float:
    """The error where the picture is replaced by the model's own of the true surface."""
    assert case.depth is not None
    distance = case.depth / np.asarray(case.camera.rays())[..., 2]
    surface = Surface(case.camera, jnp.asarray(distance, jnp.float32), jnp.asarray(np.isfinite(distance)))
    cosines, there = (np.asarray(part) for part in surface.cosines())
    values = np.where(there & (cosines > 0.02), cosines / distance**2, 0)
    found = reconstruct(Irradiance(jnp.asarray(values, jnp.float32), jnp.asarray(values > 0)), case.camera)
    return score(case, found)["abs_rel"]


def row(case: Case) -> tuple[str, ...]:
    """One line of the table."""
    mean, spread, gamma = two_ranges(case)
    best, least = fitted(case)
    chosen = ", ".join(f"{value:g}" for value in best)
    return (
        case.name,
        f"{error(case, (2.2, 1.6, 0.65)):.3f}",
        "(chosen on it)" if "0000" in case.name else f"{error(case, OF_0000):.3f}",
        f"{mean:.3f} ± {spread:.3f} (γ {gamma:.2f})",
        f"{least:.3f} ({chosen})",
        f"{of_true_depth(case):.3f}",
    )


def main() -> int:
    """Prints the table and writes it; exit code 2 without the data."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    default = Path(os.environ.get("JAXSFS_DATA", Path(__file__).resolve().parents[1] / "../shared/data"))
    parser.add_argument("--data", type=Path, default=default, help="default: JAXSFS_DATA, or ../shared/data")
    parser.add_argument("--out", type=Path, default=Path("out/real_limits"), help="folder for the table")
    parser.add_argument("--quick", action="store_true", help="one frame at a quarter of its size")
    options = parser.parse_args()
    if not (options.data / SIMCOL).is_dir():
        print(f"no {SIMCOL} in {options.data}; set --data or JAXSFS_DATA", file=sys.stderr)
        return 2
    which = (
        [("0004", "B")] if options.quick else [(frame, camera) for frame in SIMCOL_FRAMES for camera in SIMCOL_CAMERAS]
    )
    cases = [simcol_case(options.data / SIMCOL, frame, camera, 4 if options.quick else 1) for frame, camera in which]
    rows = [row(case) for case in tqdm(cases, file=sys.stderr, disable=None)]
    head = (
        "frame",
        "preset",
        "photometry of 0000",
        "two known ranges",
        "fitted to the truth (γ, μ, a)",
        "E of true depth",
    )
    lines = [f"| {' | '.join(line)} |" for line in (head, ("---",) * len(head), *rows)]
    text = f"`{shlex.join(['python', *sys.argv])}`\n\n" + "\n".join(lines) + "\n"
    options.out.mkdir(parents=True, exist_ok=True)
    (options.out / "real_limits.md").write_text(text, encoding="utf-8")
    print(text)
    return 0


if __name__ == "__main__":
    sys.exit(main())
