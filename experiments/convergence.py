"""How fast errors fall as pixels get smaller: scenes × cameras × solvers × orders, 65² to 1025².

    python experiments/convergence.py --out out/convergence
    python experiments/convergence.py --quick

Smooth scenes with exact truth, double precision, only E and ρ = 1 known, nothing scaled, half field 50° across a
square picture. Errors are mean relative errors of range over the disc; the order is fitted over the sizes. All scenes
with the spherical camera, two of them with the other lenses. The level set, whose cost grows with the cube of the
size, stops at 513², but for the ball, and with the other lenses at 257². The figure is log–log, one panel per solver
and order, with slopes 1, 2 and 3.
"""

import sys
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
from lenses import LENSES, lens_seeing
from near_scenes import HALF_FIELD, near_image
from tables import main, pyplot, save, write_tables
from tqdm import tqdm

from jaxsfs import Irradiance, reconstruct

ALL = ("plane", "tilted-plane", "ball", "hollow-ball", "wavy-wall")
SOME = ("tilted-plane", "ball")
SIZES = (65, 129, 257, 513, 1025)
METHODS = (("sweeping", 1), ("sweeping", 2), ("sweeping", 3), ("level-set", 1), ("level-set", 2))


def error(scene: str, lens: str, solver: str, order: int, size: int) -> float:
    """Mean relative error of range."""
    with jax.enable_x64(True):
        image = near_image(scene, size, lens_seeing(lens, HALF_FIELD, size, size / 2))
        irradiance = Irradiance(jnp.asarray(image.values), jnp.asarray(image.mask))
        steps = max(1000, 3 * size) if solver == "level-set" else None
        found = reconstruct(irradiance, image.camera, solver=solver, order=order, steps=steps).surface
        relative = np.abs(np.asarray(found.range) / image.truth - 1)
        return float(relative[image.mask & np.asarray(found.valid)].mean())


def jobs(quick: bool) -> list[tuple[str, str, str, int, tuple[int, ...]]]:
    """(scene, camera, solver, order, sizes) of all rows."""
    if quick:
        return [("ball", "spherical", solver, order, (33, 65)) for solver, order in METHODS]
    pairs = [(scene, "spherical") for scene in ALL]
    pairs += [(scene, lens) for lens in LENSES if lens != "spherical" for scene in SOME]
    return [
        (scene, lens, solver, order, SIZES if solver == "sweeping" else _level_set_sizes(scene, lens))
        for solver, order in METHODS
        for scene, lens in pairs
    ]


def _level_set_sizes(scene: str, lens: str) -> tuple[int, ...]:
    if lens != "spherical":
        return SIZES[:3]
    return SIZES if scene == "ball" else SIZES[:4]


def fitted_order(sizes: tuple[int, ...], errors: list[float]) -> float:
    """−slope of ln error against ln(size − 1)."""
    return float(-np.polyfit(np.log(np.asarray(sizes) - 1), np.log(errors), 1)[0])


def sheet(found: dict[tuple, list[float]], path: Path) -> None:
    """`found`: errors of each job."""
    plt = pyplot()
    figure, axes = plt.subplots(1, len(METHODS), figsize=(22, 7), layout="constrained", sharey=True)
    for axis, method in zip(axes, METHODS, strict=True):
        for (scene, lens, solver, order, sizes), errors in found.items():
            if (solver, order) == method:
                style = "-" if lens == "spherical" else "--"
                axis.plot(
                    sizes, errors, "o" + style, ms=3, label=f"{scene}, {lens} ({fitted_order(sizes, errors):.2f})"
                )
        span = np.array([33, 1025])
        for slope, start in ((1, 8e-3), (2, 1.5e-3), (3, 3e-4)):
            axis.plot(span, start * (span / 65.0) ** -slope, "k:", lw=0.8)
            axis.text(span[1], start * (span[1] / 65.0) ** -slope, f"{slope}")
        axis.set(xscale="log", yscale="log", xlabel="pixels across", title=f"{method[0]}, order {method[1]}")
        axis.legend(fontsize=6, loc="upper center", bbox_to_anchor=(0.5, -0.13), ncols=2, frameon=False)
        axis.grid(True, alpha=0.3)
    axes[0].set_ylabel("mean relative error of range")
    save(figure, path)


def run(out: Path, quick: bool) -> list[dict]:
    """Writes convergence.png and the table to `out`; returns the rows."""
    found, rows = {}, []
    for job in tqdm(jobs(quick), file=sys.stderr, disable=None):
        scene, lens, solver, order, sizes = job
        found[job] = [error(scene, lens, solver, order, size) for size in sizes]
        columns = {f"{size}²": "–" for size in (sizes if quick else SIZES)}
        columns |= {f"{size}²": f"{value:.2e}" for size, value in zip(sizes, found[job], strict=True)}
        observed = f"{fitted_order(sizes, found[job]):.2f}"
        rows.append({"scene": scene, "camera": lens, "solver": solver, "order": order} | columns
                    | {"observed order": observed})  # fmt: skip
    sheet(found, out / "convergence.png")
    print(write_tables(out, "convergence", {"convergence": rows}))
    return rows


if __name__ == "__main__":
    main("How fast errors fall as pixels get smaller.", run, "convergence")
