"""Second-order sweeping on every lens, on the whole square picture, and beside the first order on every scene.

    python experiments/second_order.py --out out/second_order
    python experiments/second_order.py --quick

First table: square pictures with 50° at their corners, no mask, only E and ρ = 1 known, nothing scaled; mean relative
error of range in double precision at three sizes, the order fitted over them, and the error in single precision at the
middle size. Second table: every scene of `data_synth`, round field of 50°, single precision, occluding contours found
from the picture: kinks, points and depth discontinuities must not make the second order worse than the first.
"""

import math
import sys
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
from near_scenes import near_image
from tables import main, write_tables
from tqdm import tqdm

from data_synth import REPORT_SEEDS, SCENES, observe, scene_from_text
from jaxsfs import (
    AbstractCamera,
    Equidistant,
    Equisolid,
    Irradiance,
    KannalaBrandt,
    Perspective,
    Scaramuzza,
    Spherical,
    Stereographic,
    reconstruct,
)

CORNER = math.radians(50)
SMOOTH = ("plane", "tilted-plane", "ball")
K = (-0.1, 0.01, 0.0, 0.0)
LENSES = {
    "spherical": lambda f, place: Spherical(f=f / math.sin(CORNER), **place),
    "perspective": lambda f, place: Perspective(fx=f / math.tan(CORNER), fy=f / math.tan(CORNER), **place),
    "equidistant": lambda f, place: Equidistant(f=f / CORNER, **place),
    "equisolid": lambda f, place: Equisolid(f=f / (2 * math.sin(CORNER / 2)), **place),
    "stereographic": lambda f, place: Stereographic(f=f / (2 * math.tan(CORNER / 2)), **place),
    "kannala-brandt": lambda f, place: _kannala_brandt(f, place),
    "scaramuzza": lambda f, place: _scaramuzza(f, place),
}


def _kannala_brandt(half_diagonal: float, place: dict) -> KannalaBrandt:
    f = half_diagonal / (CORNER * (1 + K[0] * CORNER**2 + K[1] * CORNER**4))
    return KannalaBrandt(fx=f, fy=f, k=K, **place)


def _scaramuzza(half_diagonal: float, place: dict) -> Scaramuzza:
    """z = a₀ + a₂ρ² with 50° at the corner; a₂ < 0 bends the rays outwards, as in real scopes."""
    edge = half_diagonal / math.tan(CORNER)
    a0 = 1.2 * edge
    return Scaramuzza(a=(a0, 0.0, (edge - a0) / half_diagonal**2, 0.0, 0.0), **place)


def camera_of(lens: str, size: int) -> AbstractCamera:
    """The lens that sees 50° at the corners of a square picture."""
    centre = (size - 1) / 2
    return LENSES[lens](size / math.sqrt(2), {"cx": centre, "cy": centre, "width": size, "height": size})


def error(scene: str, lens: str, size: int, dtype=jnp.float64, order: int = 2) -> float:
    """Mean relative error of range over the whole picture."""
    camera = camera_of(lens, size)
    with jax.enable_x64(True):
        view = observe(SCENES[scene](), camera)
        truth = np.asarray(view.surface.range)
        image = Irradiance(jnp.asarray(view.irradiance.values, dtype), jnp.asarray(view.surface.valid))
        found = reconstruct(image, camera, order=order).surface
        return float(np.mean(np.abs(np.asarray(found.range, float) / truth - 1)[np.asarray(found.valid)]))


def corner_row(scene: str, lens: str, sizes: tuple[int, int, int]) -> dict[str, str]:
    """Errors and their order."""
    found = [error(scene, lens, size) for size in sizes]
    order = -np.polyfit(np.log(np.asarray(sizes) - 1), np.log(found), 1)[0]
    single = error(scene, lens, sizes[1], jnp.float32)
    columns = {f"{size}²": f"{value:.2e}" for size, value in zip(sizes, found, strict=True)}
    return {"scene": scene, "lens": lens} | columns | {"order": f"{order:.2f}", f"float32 {sizes[1]}²": f"{single:.2e}"}


def pair_row(name: str, size: int) -> dict[str, str]:
    """Both orders on a scene."""
    image = near_image(scene_from_text(name), size)
    irradiance = Irradiance(jnp.asarray(image.values, jnp.float32), jnp.asarray(image.mask))
    errors = []
    for order in (1, 2):
        found = reconstruct(irradiance, image.camera, order=order).surface
        usable = image.mask & np.asarray(found.valid)
        errors.append(np.abs(np.asarray(found.range, float) / image.truth - 1)[usable].mean())
    shown = {f"order {order}": f"{value:.2e}" for order, value in zip((1, 2), errors, strict=True)}
    return {"scene": name} | shown | {"second / first": f"{errors[1] / errors[0]:.3f}"}


def run(out: Path, quick: bool) -> None:
    """Prints both tables and writes them to `out`."""
    sizes, size = ((17, 33, 65), 65) if quick else ((129, 257, 513), 257)
    pairs = [("ball", "spherical")] if quick else [(scene, lens) for lens in LENSES for scene in SMOOTH]
    random = [f"random:{seed}" for seed in REPORT_SEEDS[:8]]
    names = ["plane", "tube"] if quick else [name for name in SCENES if name != "vase"] + random  # no near light
    rows = [corner_row(*pair, sizes) for pair in tqdm(pairs, file=sys.stderr, disable=None)]
    both = [pair_row(name, size) for name in tqdm(names, file=sys.stderr, disable=None)]
    worst = max(float(row["second / first"]) for row in both)
    words = f"Largest ratio of the second order's error to the first order's: {worst:.3f}."
    tables = {"corners: 50° at the corners, float64": rows, "orders: every scene": both}
    print(write_tables(out, "second_order", tables, words))


if __name__ == "__main__":
    main("Second-order sweeping on every lens, and beside the first order on every scene.", run, "second_order")
