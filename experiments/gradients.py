"""Derivatives through the near-light solver: accuracy, cost, memory, and a use.

    python experiments/gradients.py --out out/gradients

Accuracy: derivative of a weighted mean of ln r by each parameter against central differences (float64, 129²). Cost:
time of `jax.grad` by a whole image and by the metric, and of `jax.jvp`, over that of the solution alone, of the
processor and by the clock (float32, compiled, median of five); memory: what the compiled program holds besides its
inputs, in images. Use: response exponent γ and fall-off μ of a scope from one image and eight known ranges, by
Gauss–Newton with the exact Jacobian.
"""

import argparse
import time
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np

from data_synth import default_camera, observe, scene_from_text
from jaxsfs import CosineFalloff, GammaResponse, Irradiance, Power, Spherical, log_range

SCENES = ("ball", "tilted-plane", "wavy-wall")
NAMES = ("f", "cx", "k", "albedo", "irradiance", "response γ", "fall-off μ", "reflectance a")


def view_of(text: str, size: int):
    """Camera, irradiance and mask of a scene within 45° of the axis."""
    scene = scene_from_text(text)
    view = observe(scene, default_camera(scene, size, size), half_field_deg=45.0, reflectance=Power(0.8))
    valid = view.surface.valid
    return view.camera, jnp.where(valid, view.irradiance.values, 1), valid


def accuracy(text: str, size: int) -> list[dict[str, str]]:
    """Rows of the table of accuracy."""
    camera, values, valid = view_of(text, size)
    v, u = np.mgrid[:size, :size] / size
    wave = jnp.asarray(np.sin(9 * u + 1) * np.cos(7 * v))
    weights = jnp.asarray(np.random.default_rng(0).uniform(0.5, 1.5, valid.shape)) * valid
    weights = weights / jnp.sum(weights)

    @jax.jit
    @jax.value_and_grad
    def mean(q):
        scope = Spherical(camera.f * q[0], camera.cx + q[1] + 0.3, camera.cy + 0.2, size, size, 1.0, q[2])
        linear = GammaResponse(q[5]).decode(values * (1 + q[4] * wave))
        linear = linear / CosineFalloff(q[6])(scope.rays()[..., 2])
        found, _ = log_range(
            Irradiance(linear, valid), scope, albedo=q[3], reflectance=Power(q[7]), tolerance=1e-13, max_rounds=200
        )
        return jnp.sum(weights * found)

    q0 = jnp.array([1.0, 0.0, 0.01, 1.3, 0.0, 1.0, 0.1, 0.8])
    gradient = np.asarray(mean(q0)[1])
    steps = 1e-6 * np.eye(q0.size)
    differences = np.array([float(mean(q0 + s)[0] - mean(q0 - s)[0]) / 2e-6 for s in steps])
    rows = zip(NAMES, gradient, differences, strict=True)
    return [
        {"scene": text, "by": n, "derivative": f"{g:.6g}", "relative difference": f"{abs(g / d - 1):.0e}"}
        for n, g, d in rows
    ]


def milliseconds(function, *arguments) -> np.ndarray:
    """Of the processor and by the clock: medians of five runs after the first."""
    jax.block_until_ready(function(*arguments))
    times = []
    for _ in range(5):
        start = np.array([time.process_time(), time.perf_counter()])
        jax.block_until_ready(function(*arguments))
        times.append(1e3 * (np.array([time.process_time(), time.perf_counter()]) - start))
    return np.median(times, axis=0)


def cost(text: str, size: int) -> dict[str, str]:
    """One row of the table of cost."""
    camera, values, valid = view_of(text, size)
    values = values.astype(jnp.float32)

    def mean(values, f):
        scope = Spherical(f, camera.cx, camera.cy, size, size)
        return jnp.mean(log_range(Irradiance(values, valid), scope, reflectance=Power(0.8))[0])

    f = jnp.float32(camera.f)
    programs = [
        jax.jit(mean).lower(values, f).compile(),
        jax.jit(jax.grad(mean, argnums=(0, 1))).lower(values, f).compile(),
        jax.jit(lambda e, f: jax.jvp(mean, (e, f), (e, f))).lower(values, f).compile(),
    ]
    forward, reverse, tangent = (milliseconds(program, values, f) for program in programs)
    images = [program.memory_analysis().temp_size_in_bytes / values.nbytes for program in programs]
    return {
        "scene": text,
        "size": f"{size}²",
        "solution: CPU, clock": "{:.0f}, {:.0f} ms".format(*forward),
        "grad / solution": "{:.2f}, {:.2f}".format(*(reverse / forward)),
        "jvp / solution": "{:.2f}, {:.2f}".format(*(tangent / forward)),
        "images: solution": f"{images[0]:.0f}",
        "grad": f"{images[1]:.0f}",
        "jvp": f"{images[2]:.0f}",
    }


def self_calibration(text: str, size: int) -> dict[str, str]:
    """γ and μ of a scope (2.6 and 1.5) from eight known ranges, started at 2.2 and 1."""
    camera, values, valid = view_of(text, size)
    true, _ = log_range(Irradiance(values, valid), camera, reflectance=Power(0.8))
    cosine = camera.rays()[..., 2]
    stored = GammaResponse(2.6).encode(values * CosineFalloff(1.5)(cosine) / 10)
    places = np.argwhere(np.asarray(valid))
    rows, columns = places[np.random.default_rng(0).choice(len(places), 8, replace=False)].T

    def gaps(q):
        linear = GammaResponse(q[0]).decode(stored) / CosineFalloff(q[1])(cosine)
        found, _ = log_range(Irradiance(linear, valid), camera, reflectance=Power(0.8))
        gap = found[rows, columns] - true[rows, columns]
        return gap - jnp.mean(gap)

    both = jax.jit(lambda q: (gaps(q), jax.jacfwd(gaps)(q)))
    q = np.array([2.2, 1.0])
    sizes = []
    while len(sizes) < 20 and (not sizes or sizes[-1] > 1e-8):
        gap, jacobian = (np.asarray(x) for x in both(jnp.asarray(q)))
        step = np.linalg.lstsq(jacobian, -gap, rcond=None)[0]
        q = q + step
        sizes.append(float(np.abs(step).max()))
    return {"scene": text, "γ": f"{q[0]:.5f}", "μ": f"{q[1]:.5f}", "steps": str(len(sizes))}


def markdown(rows: list[dict]) -> str:
    """Rows as a table."""
    head = list(rows[0])
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    return "\n".join(lines + ["| " + " | ".join(r[h] for h in head) + " |" for r in rows]) + "\n"


def run(out: Path, quick: bool) -> None:
    """Prints the tables and writes them to `out`."""
    scenes, size, sizes = (SCENES[:1], 33, (33,)) if quick else (SCENES, 129, (256, 512))
    with jax.enable_x64(True):
        exact = markdown([entry for scene in scenes for entry in accuracy(scene, size)])
        found = markdown([self_calibration(scene, size) for scene in scenes])
    costs = markdown([cost(scene, s) for scene in scenes for s in sizes])
    text = f"Made by `python experiments/gradients.py{' --quick' if quick else ''}`.\n\n{exact}\n{costs}\n{found}"
    out.mkdir(parents=True, exist_ok=True)
    (out / "gradients.md").write_text(text, encoding="utf-8")
    print(text)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="Derivatives through the solver: accuracy, cost, memory, a use.")
    parser.add_argument("--out", type=Path, default=Path("out/gradients"), help="folder for the tables")
    parser.add_argument("--quick", action="store_true", help="one scene, small images")
    arguments = parser.parse_args()
    run(arguments.out, arguments.quick)
