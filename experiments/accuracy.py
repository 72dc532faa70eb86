"""Accuracy of both solvers on smooth scenes with exact truth: the table of the README.

    python experiments/accuracy.py --out out/accuracy

Only irradiance and camera are given, albedo 1 is known, nothing is scaled. Domain: the disc up to a half field of 50°
in a square image, float32. The mean relative error of range is over the whole disc and, as said beside it, without a
border of three pixels; the order is fitted over all sizes.
"""

import argparse
import sys
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
from tqdm import tqdm

from data_synth import SCENES, default_camera, observe
from jaxsfs import Irradiance, reconstruct

SMOOTH = ("plane", "tilted-plane", "ball", "hollow-ball", "wavy-wall")
METHODS = (("sweeping", 1), ("sweeping", 2), ("sweeping", 3), ("level-set", 1), ("level-set", 2))


def view_of(scene: str, size: int):
    """(camera, exact range, irradiance, disc) of a scene, the truth in double precision."""
    shape = SCENES[scene]()
    camera = default_camera(shape, size, size)
    with jax.enable_x64(True):
        view = observe(shape, camera)
        distance, values = np.asarray(view.surface.range), np.asarray(view.irradiance.values)
    v, u = np.mgrid[:size, :size] - (size - 1) / 2
    radius = np.hypot(u, v)
    disc = radius <= (size - 1) / 2
    image = Irradiance(jnp.asarray(values, jnp.float32), jnp.asarray(disc))
    return camera, distance, image, radius


def row(scene: str, solver: str, order: int, sizes: list[int], steps: int) -> dict[str, float | str | int]:
    """Errors of one method on one scene over all sizes."""
    errors = []
    for size in sizes:
        camera, distance, image, radius = view_of(scene, size)
        work = {"steps": steps} if solver == "level-set" else {}
        result = reconstruct(image, camera, solver=solver, order=order, **work)
        relative = np.abs(np.asarray(result.surface.range, float) / distance - 1)
        errors.append(relative[radius <= (size - 1) / 2].mean())
    inner = relative[radius <= (sizes[-1] - 1) / 2 - 3].mean()
    fitted = -np.polyfit(np.log(np.asarray(sizes) - 1), np.log(errors), 1)[0]
    label = f"mean error {sizes[-1]}²"
    entry = {"scene": scene, "solver": solver, "order": order, label: f"{errors[-1]:.2e}"}
    entry["without 3 px border"] = f"{inner:.2e}"
    entry["observed order"] = f"{fitted:.2f}"
    return entry | {"work": result.statistics.work}


def agreement(scene: str, size: int, order: int) -> str:
    """Mean relative difference of the two solvers."""
    camera, _, image, _ = view_of(scene, size)
    first, second = (reconstruct(image, camera, solver=s, order=order).surface for s in ("sweeping", "level-set"))
    both = np.asarray(first.valid & second.valid)
    return f"{np.abs(np.asarray(first.range) / np.asarray(second.range) - 1)[both].mean():.2e}"


def markdown(rows: list[dict]) -> str:
    """Rows as a table."""
    head = list(rows[0])
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    return "\n".join(lines + ["| " + " | ".join(str(r[h]) for h in head) + " |" for r in rows]) + "\n"


def run(out: Path, quick: bool) -> None:
    """Prints the two tables and writes them to `out`."""
    sizes, scenes = ([33, 65], SMOOTH[:2]) if quick else ([65, 129, 257], SMOOTH)
    methods = [(scene, solver, order) for solver, order in METHODS for scene in scenes]
    table = markdown([row(*method, sizes, 1000) for method in tqdm(methods, file=sys.stderr)])
    compared = markdown(
        [{"scene": s} | {f"solvers differ, order {o}": agreement(s, sizes[-1], o) for o in (1, 2)} for s in scenes]
    )
    command = f"python experiments/accuracy.py{' --quick' if quick else ''}"
    text = f"Made by `{command}`.\n\n{table}\n{compared}"
    out.mkdir(parents=True, exist_ok=True)
    (out / "accuracy.md").write_text(text, encoding="utf-8")
    print(text)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="Accuracy of both solvers on smooth scenes with exact truth.")
    parser.add_argument("--out", type=Path, default=Path("out/accuracy"), help="folder for the table")
    parser.add_argument("--quick", action="store_true", help="small images and two scenes, seconds")
    arguments = parser.parse_args()
    run(arguments.out, arguments.quick)
