"""The first call of a shape: tracing, compilation and one run, without and with the compilation cache, each in a new
process, and what `jax` itself takes to start there not counted."""

import os
import subprocess
import sys
import tempfile

from jaxsfs.native import preferred

PROGRAM = """
import sys, time
import jax, jax.numpy as jnp, numpy as np
jax.config.update("jax_compilation_cache_dir", sys.argv[2])
jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.0)
from jaxsfs.camera import Spherical
from jaxsfs.reflectance import Lambertian
from jaxsfs.shading import light_at_camera
from jaxsfs.sweeping import sweep
n = int(sys.argv[1])
camera = Spherical(0.9 * n, (n - 1) / 2, (n - 1) / 2, n, n)
metric = jax.block_until_ready(camera.inverse_metrics(np.dtype(np.float32)))
z = camera.rays()[..., 2]
inside, known = jnp.ones((n, n), bool), jnp.full((n, n), jnp.inf, jnp.float32)
shading = light_at_camera(z**3, inside, jnp.float32(1), Lambertian())
jax.block_until_ready((shading, inside, known))
begin, busy = time.perf_counter(), time.process_time()
jax.block_until_ready(sweep(shading, metric, inside, known, order=2, updates=sys.argv[3]))
first = time.perf_counter() - begin, time.process_time() - busy
begin, busy = time.perf_counter(), time.process_time()
jax.block_until_ready(sweep(shading, metric, inside, known, order=2, updates=sys.argv[3]))
print(first[0] - (time.perf_counter() - begin), first[1] - (time.process_time() - busy))
"""


def rows(size: int, repetitions: int) -> list[dict]:
    """Seconds that the first call takes longer than the second, without and with the cache."""
    found = []
    for updates in dict.fromkeys(("rows", preferred())):
        with tempfile.TemporaryDirectory() as folder:
            for cached in ("no cache", "compilation cache"):
                words = [sys.executable, "-c", PROGRAM, str(size), folder, updates]
                kept = os.environ | {"NUMBA_CACHE_DIR": folder}
                done = subprocess.run(words, capture_output=True, text=True, check=True, env=kept)
                wall, cpu = map(float, done.stdout.split())
                name = f"{updates}: first call, {cached}"
                row = {"comparison": "first call", "size": size, "program": name, "ms": f"{1e3 * wall:.0f}"}
                empty = dict.fromkeys(("ns_per_px", "cpu_ns_per_px", "ratio", "cpu_ratio", "error"), "")
                found.append(row | empty | {"note": f"CPU {1e3 * cpu:.0f} ms"})
    return found
