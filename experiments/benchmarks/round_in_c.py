"""A first-order round of four sweeps: `jaxsfs.sweeping` against the same update in a plain C loop, compiled in place.

Both take |∇T|_g = 1/F on the sphere of rays, F = 1; the C loop goes row by row (column by column), pixel by pixel.
"""

import ctypes
import os
import shutil
import subprocess
import tempfile
from pathlib import Path

import jax
import jax.numpy as jnp
import measure
import numpy as np

from jaxsfs.camera import Spherical
from jaxsfs.shading import DistantLight
from jaxsfs.sweeping import sweep

ROUNDS = 4  # timed as the difference to one round
SOURCE = Path(__file__).with_name("round.c")


def rows(size: int, repetitions: int) -> list[dict]:
    """One round at one size."""
    middle = (size - 1) / 2
    camera = Spherical(np.sqrt(2) * middle / np.sin(np.deg2rad(50)), middle, middle, size, size)
    metric = camera.inverse_metrics(np.dtype(np.float32))
    shading = DistantLight(jnp.full((size, size), np.sqrt(0.5), jnp.float32), 1.0)
    inside = jnp.ones((size, size), bool)
    known = jnp.full((size, size), jnp.inf, jnp.float32).at[size // 3, size // 4].set(0)

    def ours(updates=None):
        rounds = {"max_rounds": ROUNDS, "tolerance": -1.0}
        return jax.block_until_ready(sweep(shading, metric, inside, known, order=1, updates=updates, **rounds)).w

    reference = np.asarray(ours())

    def error(time):
        return float(np.abs(np.asarray(time) - reference).mean())

    programs = [
        measure.Program(
            "jaxsfs, order 1", ours, error, parts=ROUNDS, note=measure.by("error: difference to the C loop")
        ),
        measure.Program("the same by XLA alone", lambda: ours("rows"), error, parts=ROUNDS),
        _in_c(metric, known, error),
    ]
    return measure.compare("first-order round", size, programs, repetitions)


def _in_c(metric, known, error):
    compiler = os.environ.get("CC") or shutil.which("cc")
    if compiler is None:
        return measure.Missing("plain C", "skipped: no C compiler")
    with tempfile.TemporaryDirectory() as folder:
        library = Path(folder) / "round.so"
        options = ["-O3", "-march=native", "-shared", "-fPIC", "-o", str(library), str(SOURCE), "-lm"]
        done = subprocess.run([compiler, *options], capture_output=True, text=True)
        if done.returncode:
            return measure.Missing("plain C", f"skipped: {done.stderr.strip().splitlines()[-1]}")
        sweep_round = ctypes.CDLL(str(library)).sweep_round
    g = [np.ascontiguousarray(np.asarray(metric)[..., i, j]) for i, j in ((0, 0), (0, 1), (1, 1))]
    start = np.where(np.isfinite(known), known, np.float32(1e30)).astype(np.float32)
    height, width = start.shape

    def run():
        time = start.copy()
        for _ in range(ROUNDS):
            arrays = (a.ctypes.data_as(ctypes.c_void_p) for a in (time, *g))
            sweep_round(*arrays, ctypes.c_int(height), ctypes.c_int(width), ctypes.c_float(1.0))
        return time

    return measure.Program("plain C", run, error, parts=ROUNDS, note=f"{Path(compiler).name} -O3 -march=native")
