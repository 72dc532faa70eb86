"""Second-order sweeping on every lens, on the whole square picture, and beside orders 1 and 3 on every scene.

    python experiments/second_order.py --out out/second_order
    python experiments/second_order.py --quick

First table: square pictures with 50° at their corners, no mask, only E and ρ = 1 known, nothing scaled; mean relative
error of range in double precision at three sizes, the order fitted over them, and the error in single precision at the
middle size; order 3 beside it. Second table: every scene of `data_synth`, round field of 50°, single precision,
occluding contours found from the picture: kinks, points and depth discontinuities must not make the second order worse
than the first.
"""

import math
import sys
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
from convergence import fitted_order
from lenses import LENSES, lens_seeing
from near_scenes import near_image
from tables import main, write_tables
from tqdm import tqdm

from data_synth import REPORT_SEEDS, SCENES, observe, scene_from_text
from jaxsfs import Irradiance, reconstruct

CORNER = 50  # degrees
SMOOTH = ("plane", "tilted-plane", "ball")


def error(scene: str, lens: str, size: int, dtype=jnp.float64, order: int = 2) -> float:
    """Mean relative error of range over the whole picture."""
    camera = lens_seeing(lens, CORNER, size, size / math.sqrt(2))
    with jax.enable_x64(True):
        view = observe(SCENES[scene](), camera)
        truth = np.asarray(view.surface.range)
        image = Irradiance(jnp.asarray(view.irradiance.values, dtype), jnp.asarray(view.surface.valid))
        found = reconstruct(image, camera, order=order).surface
        return float(np.mean(np.abs(np.asarray(found.range, float) / truth - 1)[np.asarray(found.valid)]))


def corner_row(scene: str, lens: str, sizes: tuple[int, int, int]) -> dict[str, str]:
    """Errors and their order."""
    found = [error(scene, lens, size) for size in sizes]
    order = fitted_order(sizes, found)
    single = error(scene, lens, sizes[1], jnp.float32)
    third = [error(scene, lens, size, order=3) for size in sizes]
    columns = {f"{size}²": f"{value:.2e}" for size, value in zip(sizes, found, strict=True)}
    columns |= {"order": f"{order:.2f}", f"float32 {sizes[1]}²": f"{single:.2e}"}
    columns |= {f"order 3: {sizes[1]}²": f"{third[1]:.2e}", "its order": f"{fitted_order(sizes, third):.2f}"}
    return {"scene": scene, "lens": lens} | columns


def pair_row(name: str, size: int) -> dict[str, str]:
    """All orders on a scene."""
    image = near_image(scene_from_text(name), size)
    irradiance = Irradiance(jnp.asarray(image.values, jnp.float32), jnp.asarray(image.mask))
    errors = []
    for order in (1, 2, 3):
        found = reconstruct(irradiance, image.camera, order=order).surface
        usable = image.mask & np.asarray(found.valid)
        errors.append(np.abs(np.asarray(found.range, float) / image.truth - 1)[usable].mean())
    shown = {f"order {order}": f"{value:.2e}" for order, value in zip((1, 2, 3), errors, strict=True)}
    ratios = {"second / first": f"{errors[1] / errors[0]:.3f}", "third / second": f"{errors[2] / errors[1]:.3f}"}
    return {"scene": name} | shown | ratios


def run(out: Path, quick: bool) -> None:
    """Prints both tables and writes them to `out`."""
    sizes, size = ((17, 33, 65), 65) if quick else ((129, 257, 513), 257)
    pairs = [("ball", "spherical")] if quick else [(scene, lens) for lens in LENSES for scene in SMOOTH]
    random = [f"random:{seed}" for seed in REPORT_SEEDS[:8]]
    names = ["plane", "tube"] if quick else [name for name in SCENES if name != "vase"] + random  # no near light
    rows = [corner_row(*pair, sizes) for pair in tqdm(pairs, file=sys.stderr, disable=None)]
    both = [pair_row(name, size) for name in tqdm(names, file=sys.stderr, disable=None)]
    worst = max(float(row["second / first"]) for row in both)
    words = f"Largest ratio of the second order's error to the first order's: {worst:.3f}"
    worst = max(float(row["third / second"]) for row in both)
    words += f", of order 3's to the second's: {worst:.3f}."
    tables = {"corners: 50° at the corners, float64": rows, "orders: every scene": both}
    print(write_tables(out, "second_order", tables, words))


if __name__ == "__main__":
    main("Second-order sweeping on every lens, and beside the first order on every scene.", run, "second_order")
