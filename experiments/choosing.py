"""Which solver, which order: error, work and time of each where pictures are kind and where they are not.

    python experiments/choosing.py --out out/choosing
    python experiments/choosing.py --quick

Columns: the wavy wall from its exact picture, with 1 % and 20 % of noise (of each pixel's brightness, not smoothed),
and at a tenth of the pixels; a wall with two polyps (occlusions); a straight tube (nearest wall at the rim). In each
cell AbsRel of range after median alignment, the share of pixels that have an answer, and the rounds or steps.
Seconds: processor time of one solution, compiled, of the exact wavy wall, the median of five.
"""

import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from statistics import median
from typing import Literal

import jax
import jax.numpy as jnp
import numpy as np
from near_scenes import NearImage, errors, near_image
from tables import main, write_tables
from tqdm import tqdm

from jaxsfs import Irradiance, Reconstruction, reconstruct

Solver = Literal["sweeping", "level-set"]
Order = Literal[1, 2, 3]
METHODS: tuple[tuple[Solver, Order], ...] = (
    ("sweeping", 1),
    ("sweeping", 2),
    ("sweeping", 3),
    ("level-set", 1),
    ("level-set", 2),
)


def noisy(image: NearImage, share: float) -> Irradiance:
    """E with noise of `share` of its value."""
    noise = np.random.default_rng(0).standard_normal(image.values.shape)
    values = image.values * np.maximum(1 + share * noise, 0.05)
    return Irradiance(jnp.asarray(values, jnp.float32), jnp.asarray(image.mask))


def pictures(size: int) -> dict[str, tuple[NearImage, Irradiance]]:
    """The truth and the picture of each column."""
    wall = near_image("wavy-wall", size)
    others = {
        "exact, a tenth of the pixels": near_image("wavy-wall", round(size / 10**0.5)),
        "occlusions": near_image("polyps", size),
        "tube": near_image("tube", size),
    }
    found = {
        "exact": (wall, noisy(wall, 0)),
        "noise 1 %": (wall, noisy(wall, 0.01)),
        "noise 20 %": (wall, noisy(wall, 0.2)),
    }
    return found | {name: (image, noisy(image, 0)) for name, image in others.items()}


def cell(image: NearImage, result: Reconstruction) -> str:
    """AbsRel, share and work."""
    valid = np.asarray(result.surface.valid)
    found = errors(image, np.where(valid, np.asarray(result.surface.range, float), np.nan))
    statistics = result.statistics
    settled = "" if result.status.value.startswith("The surface is reconstructed") else "; not trusted"
    return f"{found.abs_rel:.1e}, {found.share:.0%}, {statistics.work} {statistics.work_unit}{settled}"


def seconds(solve: Callable[[], Reconstruction]) -> float:
    """Processor time, median of five."""
    times = []
    for _ in range(5):
        begin = time.process_time()
        jax.block_until_ready(solve().surface.range)
        times.append(time.process_time() - begin)
    return median(times)


def run(out: Path, quick: bool) -> list[dict]:
    """Writes the table to `out`; returns the rows."""
    columns = pictures(65 if quick else 257)
    rows = []
    for solver, order in tqdm(METHODS[:2] if quick else METHODS, disable=None):
        row = {"solver": solver, "order": order}
        for name, (image, irradiance) in columns.items():
            row[name] = cell(image, reconstruct(irradiance, image.camera, solver=solver, order=order))
        image, irradiance = columns["exact"]
        solve = partial(reconstruct, irradiance, image.camera, solver=solver, order=order)
        rows.append(row | {"seconds": f"{seconds(solve):.3f}"})
    print(write_tables(out, "choosing", {"choosing": rows}))
    return rows


if __name__ == "__main__":
    main("Error, work and time of each solver and order.", run, "choosing")
