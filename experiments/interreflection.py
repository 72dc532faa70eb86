"""What light that comes from other walls costs: Mitsuba's paths up to 16 bounces, solved as if there were one.

    pip install ".[crosscheck]"
    python experiments/interreflection.py --out out/interreflection
    python experiments/interreflection.py --quick

A pinhole with a half field of 45° in a tube with a flat end (the worst case: the walls see each other) and before a
ball (a convex thing, which never sees itself). `more light`: mean share of E that has met the wall more than once.
AbsRel of range after median alignment. The row with one bounce is what noise and pixels alone cost.
"""

import argparse
import math
import sys
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
from mitsuba_scenes import installed, pictured, shapes, wall
from tables import write_tables
from tqdm import tqdm

from data_synth import AbstractScene, Ball, Tube, observe
from jaxsfs import Irradiance, Perspective, evaluate, reconstruct

BOUNCES = 16
SCENES: dict[str, AbstractScene] = {"tube": Tube(1.0, 0.2, 0.1, 3.0), "ball": Ball(9.0, 0.3, -0.2, 10.0)}
ALBEDOS = (0.2, 0.4, 0.6, 0.8)


def camera_of(size: int) -> Perspective:
    """The pinhole of 90° from side to side, as Mitsuba measures it: from edge to edge of the picture."""
    centre = (size - 1) / 2
    f = size / 2 / math.tan(math.radians(45))
    return Perspective(fx=f, fy=f, cx=centre, cy=centre, width=size, height=size)


def abs_rel(scene: AbstractScene, camera: Perspective, values: np.ndarray) -> float:
    """Of the surface that explains `values` with the light at the lens alone."""
    with jax.enable_x64(True):
        seen = jax.tree.map(np.asarray, observe(scene, camera))
    usable = seen.surface.valid & (values > 0)
    found = reconstruct(Irradiance(jnp.asarray(values, jnp.float32), jnp.asarray(usable)), camera).surface
    answer = np.where(np.asarray(found.valid), np.asarray(found.range, float), np.nan)
    return evaluate(answer, np.where(usable, seen.surface.range, np.nan), align="median").abs_rel


def run(out: Path, quick: bool) -> list[dict]:
    """Writes the table to `out` and returns its rows."""
    size, samples, albedos = (33, 16, (0.6,)) if quick else (129, 256, ALBEDOS)
    camera = camera_of(size)
    rows = []
    bar = tqdm(total=len(SCENES) * (len(albedos) + 1), file=sys.stderr, disable=None)
    for name, scene in SCENES.items():
        direct = pictured(shapes(scene), 90.0, size, 1, samples)
        rows.append(_row(name, "any, one bounce", direct, direct, abs_rel(scene, camera, direct)))
        bar.update()
        for albedo in albedos:
            values = pictured(shapes(scene, wall(albedo)), 90.0, size, BOUNCES, samples) / albedo
            rows.append(_row(name, f"{albedo:g}", values, direct, abs_rel(scene, camera, values)))
            bar.update()
    bar.close()
    print(write_tables(out, "interreflection", {"interreflection": rows}))
    return rows


def _row(name: str, albedo: str, values: np.ndarray, direct: np.ndarray, error: float) -> dict:
    lit = direct > 0
    more = np.mean(1 - direct[lit] / np.maximum(values[lit], 1e-12))
    return {"scene": name, "albedo": albedo, "more light": f"{more:.3f}", "AbsRel": f"{error:.4f}"}


def main() -> int:
    parser = argparse.ArgumentParser(description="Light between the walls, by a path tracer.")
    parser.add_argument("--out", type=Path, default=Path("out/interreflection"), help="folder for the table")
    parser.add_argument("--quick", action="store_true", help="one albedo, a small picture")
    options = parser.parse_args()
    if not installed():
        print('Mitsuba is not installed (pip install ".[crosscheck]"): nothing was rendered', file=sys.stderr)
        return 2
    run(options.out, options.quick)
    return 0


if __name__ == "__main__":
    sys.exit(main())
