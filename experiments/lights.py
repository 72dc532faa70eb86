"""Lights beside the lens: what they do to the solution for a light at the lens, and what the refinement mends.

    python experiments/lights.py --out out/lights

Exact views (range and normals of the scene, no differences) lit by one guide 3.5 mm right of the lens, or by guides
evenly round it at 3.5 mm; half field 60°, square images, float32, gain·albedo known, nothing scaled. AbsRel of range
over all pixels with light: solution for a light at the lens ("co-located"), after the repeated solves ("fixed point"),
after Gauss–Newton too ("refined"); and, for what the solver itself leaves, the error of the same scene when its light
really is at the lens ("solver"). Seconds of the refinement once compiled (first run in brackets). The last table
solves with a gain·albedo that is wrong by a factor: the residual does not tell.
"""

import argparse
import math
import sys
import time
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
from tqdm import tqdm

from data_synth import AbstractScene, Ball, BallInBowl, Plane, PolypWall, WavyWall, default_camera, observe
from jaxsfs import Irradiance, Light, Lights, Reconstruction, Refinement, reconstruct, refine, shade_lights

HALF_FIELD = 60


def ring(count: int, radius: float = 3.5) -> Lights:
    """`count` equal guides at `radius` mm round the lens, the first one to the right."""
    angles = [2 * math.pi * index / count for index in range(count)]
    return Lights(tuple(Light((radius * math.cos(a), radius * math.sin(a), 0.0)) for a in angles))


AT_LENS = Lights((Light((0.0, 0.0, 0.0)),))

# Lengths in mm. The last two occlude.
CASES: dict[str, tuple[AbstractScene, Lights]] = {
    "plane at 20 mm, one guide": (Plane(20.0), ring(1)),
    "plane at 10 mm, three guides": (Plane(10.0), ring(3)),
    "tilted plane at 15 mm, two guides": (Plane(15.0, 0.3, -0.2), ring(2)),
    "ball, nearest at 13 mm, three guides": (Ball(12.0, 0.0, 0.0, 25.0), ring(3)),
    "wavy wall at 15 mm, two guides": (WavyWall(15.0), ring(2)),
    "polyps at 15 mm, two guides": (
        PolypWall(((3.0, 2.0, 1.5, 2.5), (-5.0, 1.0, 1.5, 2.0)), 15.0, 0.1, -0.1, 1.0),
        ring(2),
    ),
    "ball in bowl at 10 mm, three guides": (BallInBowl(4.0, 1.0, -2.0, 14.0, 22.0, 3.0), ring(3)),
}


def view_of(case: str, size: int, noise: float, lights: Lights | None = None):
    """(camera, lights, image, exact range, compared pixels); white noise relative to each pixel's irradiance."""
    scene, own = CASES[case]
    lights = own if lights is None else lights
    camera = default_camera(scene, size, size, HALF_FIELD)
    with jax.enable_x64(True):
        view = observe(scene, camera, half_field_deg=HALF_FIELD)
        values = np.asarray(shade_lights(view.surface.points(), view.normals, lights))
        distance, valid = np.asarray(view.surface.range), np.asarray(view.surface.valid)
    values = values * (1 + noise * np.random.default_rng(0).standard_normal(values.shape))
    valid = valid & (values > 0)
    image = Irradiance(jnp.asarray(np.where(valid, values, 0), jnp.float32), jnp.asarray(valid))
    return camera, lights, image, distance, valid


def timed(start: Reconstruction, lights: Lights) -> tuple[Refinement, float]:
    """The refinement and the seconds it took."""
    clock = time.perf_counter()
    refined = refine(start, lights)
    jax.block_until_ready(refined.result.surface.range)
    return refined, time.perf_counter() - clock


def row(case: str, size: int, noise: float) -> dict[str, str | int]:
    """One line of the table."""
    camera, lights, image, distance, valid = view_of(case, size, noise)

    def error(surface) -> str:
        compared = valid & np.asarray(surface.valid)
        return f"{np.abs(np.asarray(surface.range, float) / distance - 1)[compared].mean():.5f}"

    start = reconstruct(image, camera)
    plain = reconstruct(view_of(case, size, noise, AT_LENS)[2], camera)
    _, first = timed(start, lights)
    refined, seconds = timed(start, lights)
    fixed = refine(start, lights, polish_steps=0)
    return {
        "scene": case,
        "noise": f"{noise:.0%}",
        "size": f"{size}²",
        "co-located": error(start.surface),
        "fixed point": error(fixed.result.surface),
        "refined": error(refined.result.surface),
        "solver": error(plain.surface),
        "solves": len(refined.changes),
        "status": refined.status.name.lower(),
        "seconds": f"{seconds:.1f} ({first:.1f})",
    }


def wrong_albedo(case: str, size: int, factor: float) -> dict[str, str]:
    """A solution with the wrong gain·albedo: what the image says of it."""
    camera, lights, image, distance, valid = view_of(case, size, 0.0)
    refined = refine(reconstruct(image, camera, albedo=factor), lights)
    distance = distance * math.sqrt(factor)
    error = np.abs(np.asarray(refined.result.surface.range, float) / distance - 1)[valid].mean()
    return {
        "scene": case,
        "albedo / true": f"{factor:g}",
        "residual": f"{refined.residual_after:.4f}",
        "AbsRel after scaling by √factor": f"{error:.4f}",
    }


def markdown(rows: list[dict]) -> str:
    """Rows as a table."""
    head = list(rows[0])
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    return "\n".join(lines + ["| " + " | ".join(str(r[h]) for h in head) + " |" for r in rows]) + "\n"


def run(out: Path, quick: bool) -> None:
    """Prints the tables and writes them to `out`."""
    sizes, cases = ([96], list(CASES)[:2]) if quick else ([256, 512], list(CASES))
    jobs = [(case, sizes[0], noise) for case in cases for noise in (0.0, 0.01)]
    jobs += [(case, size, 0.0) for case in cases[:2] for size in sizes[1:]]
    table = markdown([row(*job) for job in tqdm(jobs, file=sys.stderr)])
    scales = markdown([wrong_albedo(case, 96, factor) for case in cases[:2] for factor in (0.5, 1.0, 2.0)])
    text = f"Made by `python experiments/lights.py{' --quick' if quick else ''}`.\n\n{table}\n{scales}"
    out.mkdir(parents=True, exist_ok=True)
    (out / "lights.md").write_text(text, encoding="utf-8")
    print(text)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="Lights beside the lens: co-located solution and its refinement.")
    parser.add_argument("--out", type=Path, default=Path("out/lights"), help="folder for the tables")
    parser.add_argument("--quick", action="store_true", help="small images and two scenes, under a minute")
    arguments = parser.parse_args()
    run(arguments.out, arguments.quick)
