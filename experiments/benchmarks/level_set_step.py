"""Time of one order-1 level-set step: `jaxsfs.levelset.propagate` against the same scheme in NumPy, in one run.

    python experiments/benchmarks/level_set_step.py
    python experiments/benchmarks/level_set_step.py --scene wavy-wall --size 1024

Both march the same float32 front. A step's time is (time of a long run − time of a short run)/(difference in steps),
so what is done once per call (weights, lengths, transfer) and the compilation are not in it. The runs alternate,
and the medians over the repetitions are compared; then the arrival times themselves. JAX runs on all cores and NumPy
on one: on a machine with other work the processor time says more than the clock. The last row sets the step against
the machine's memory: the bandwidth that NumPy reaches in a triad a = b + x·c far larger than the caches.
"""

import argparse
import os
import platform
import time
from collections.abc import Callable

import jax
import jax.numpy as jnp
import level_set_numpy
import numpy as np

from data_synth.catalogue import SCENES
from data_synth.viewing import observe
from jaxsfs.camera import Spherical
from jaxsfs.levelset import propagate
from jaxsfs.reflectance import Lambertian
from jaxsfs.shading import light_at_camera
from jaxsfs.upwind import offsets_for, selling_weights

HALF_FIELD_DEG = 50.0
# What a step must at least move, in float32 numbers per pixel: it reads w, due, bound, crossing, four weights and
# four lengths, and writes w.
FLOATS_PER_PIXEL = 13


class Problem:
    """One view of a scene, as both programs take it."""

    def __init__(self, scene: str, size: int):
        focal = 0.5 * size / np.sin(np.deg2rad(HALF_FIELD_DEG))
        camera = Spherical(focal, (size - 1) / 2, (size - 1) / 2, size, size)
        view = observe(SCENES[scene](), camera, half_field_deg=HALF_FIELD_DEG)
        self.inside = view.irradiance.valid
        values = jnp.asarray(view.irradiance.values, jnp.float32)
        self.shading = light_at_camera(values, self.inside, jnp.float32(1), Lambertian())
        self.metric = camera.inverse_metrics(np.dtype(np.float32))
        self.offsets = offsets_for(self.metric, self.inside)
        weights, carried = selling_weights(self.metric, self.offsets)
        self.known = jnp.full((size, size), jnp.inf, jnp.float32)
        bound = np.asarray(self.shading.deadline())
        within = bound[np.asarray(self.inside & carried)]
        self.start, self.end = np.float32(within.min() - 1e-4), np.float32(within.max())
        self._numpy = (bound, np.asarray(self.metric), np.asarray(weights), self.offsets)
        self._carried = np.asarray(self.inside & carried)

    def jax(self, steps: int) -> tuple[np.ndarray, np.ndarray]:
        """w and where it was reached, by the package."""
        arrival = propagate(
            self.shading,
            self.metric,
            self.inside,
            self.known,
            jnp.asarray(self.start),
            jnp.asarray(self.end),
            offsets=self.offsets,
            order=1,
            steps=steps,
        )
        jax.block_until_ready(arrival)
        return np.asarray(arrival.w), np.asarray(arrival.reached)

    def numpy(self, steps: int) -> tuple[np.ndarray, np.ndarray]:
        """The same by the NumPy program."""
        return level_set_numpy.propagate(*self._numpy, self._carried, self.start, self.end, steps)


def largest_difference(problem: Problem, steps: int) -> tuple[float, int]:
    """Largest difference of w where both programs saw the front arrive, and how many pixels only one of them saw."""
    (ours, ours_at), (peer, peer_at) = problem.jax(steps), problem.numpy(steps)
    both = ours_at & peer_at
    if not both.any():
        raise ValueError(f"no pixel was reached in {steps} steps; take more")
    return float(np.abs(ours - peer)[both].max()), int((ours_at ^ peer_at).sum())


def step_times(problem: Problem, steps: tuple[int, int], repetitions: int) -> np.ndarray:
    """Seconds per step, (repetitions, program, clock): jaxsfs and NumPy in turn; wall clock and processor time."""
    for count in steps:
        problem.jax(count)  # compiles
    problem.numpy(1)
    return np.array([[_per_step(run, steps) for run in (problem.jax, problem.numpy)] for _ in range(repetitions)])


def triad_bandwidth(megabytes: int = 64, repetitions: int = 5) -> float:
    """Bytes per second of a = x·c, a += b on arrays of `megabytes` MB, the best of some runs (one thread)."""
    a, b, c = (np.ones(megabytes * 2**18, np.float32) for _ in range(3))

    def triad() -> float:
        begin = time.perf_counter()
        np.multiply(c, np.float32(3), out=a)
        np.add(a, b, out=a)
        return time.perf_counter() - begin

    return 5 * a.nbytes / min(triad() for _ in range(repetitions))


def _per_step(run: Callable[[int], object], steps: tuple[int, int]) -> np.ndarray:
    readings = []
    for count in steps:
        begin = np.array([time.perf_counter(), time.process_time()])
        run(count)
        readings.append(np.array([time.perf_counter(), time.process_time()]) - begin)
    return (readings[1] - readings[0]) / (steps[1] - steps[0])


def benchmark(scene: str, size: int, repetitions: int, steps: tuple[int, int], check_steps: int) -> None:
    """Measures and prints the table."""
    problem = Problem(scene, size)
    print(f"order-1 level-set step, {scene}, {size} x {size} px, half field {HALF_FIELD_DEG:g}°, float32")
    print(
        f"jax {jax.__version__}, numpy {np.__version__}, {platform.machine()}, {len(os.sched_getaffinity(0))} cores, "
        f"load {os.getloadavg()[0]:.1f}; {repetitions} alternating runs of {steps[0]} and {steps[1]} steps, "
        "compilation not included\n"
    )
    nano = 1e9 / size**2 * step_times(problem, steps, repetitions)
    middle = np.median(nano, axis=0)
    print("| program | ms per step, median | ns per pixel and step, median | fastest run | processor time, ns |")
    print("|---|---|---|---|---|")
    for name, (wall, processor), runs in zip(("jaxsfs", "numpy"), middle, nano[:, :, 0].T, strict=True):
        print(f"| {name} | {wall * size**2 / 1e6:.3f} | {wall:.2f} | {runs.min():.2f} | {processor:.2f} |")
    ours, peer = middle
    print(f"\nnumpy/jaxsfs: {peer[0] / ours[0]:.2f} by the clock, {peer[1] / ours[1]:.2f} in processor time (medians)")
    print("run by run, by the clock: " + ", ".join(f"{ratio:.1f}" for ratio in nano[:, 1, 0] / nano[:, 0, 0]))
    difference, apart = largest_difference(problem, check_steps)
    print(f"largest difference of the arrival times after {check_steps} steps: {difference:.1e} (in ln r)")
    print(f"pixels that only one of the two saw the front reach: {apart} of {int(problem.inside.sum())}")
    bandwidth = triad_bandwidth(4 if size < 128 else 64)
    floor = 4 * FLOATS_PER_PIXEL / bandwidth * 1e9
    print(
        f"triad {bandwidth / 1e9:.1f} GB/s; {FLOATS_PER_PIXEL} numbers a pixel at that rate take {floor:.2f} ns; "
        f"a step takes {ours[0] / floor:.1f} times as long"
    )


def main() -> None:
    """Reads the options and runs the benchmark."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scene", choices=sorted(SCENES), default="wavy-wall")
    parser.add_argument("--size", type=int, default=512, help="width and height in px (default: 512)")
    parser.add_argument("--repetitions", type=int, default=7)
    parser.add_argument("--quick", action="store_true", help="tiny size: shows that it works, times mean nothing")
    options = parser.parse_args()
    if options.quick:
        benchmark(options.scene, 40, 3, (10, 210), 210)
    else:
        benchmark(options.scene, options.size, options.repetitions, (5, 105), 2 * options.size)


if __name__ == "__main__":
    main()
