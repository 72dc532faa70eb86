"""Orders of updates: near-light shape from shading, second order, on the same picture, to the same tolerance."""

import jax
import jax.numpy as jnp
import measure
import numpy as np
from near_light import NORMAL
from stereographic import square_camera

from jaxsfs.reflectance import Lambertian
from jaxsfs.shading import light_at_camera
from jaxsfs.sweeping import sweep
from jaxsfs.updates import ROUNDS

LARGEST_JACOBI = 256  # px: its work grows with the cube of the size, on a CPU its time too


def rows(size: int, repetitions: int) -> list[dict]:
    """A tilted plane, 50° at the corners."""
    camera = square_camera(size)
    cosine = np.asarray(camera.rays(), float) @ NORMAL
    values = jnp.asarray(cosine**3, jnp.float32)
    metric = camera.inverse_metrics(np.dtype(np.float32))
    inside, known = jnp.ones((size, size), bool), jnp.full((size, size), jnp.inf, jnp.float32)

    def program(name: str) -> measure.Program | measure.Missing:
        if name == "jacobi" and size > LARGEST_JACOBI:
            return measure.Missing(f"jaxsfs, order 2, {name}", f"skipped: minutes above {LARGEST_JACOBI} px on a CPU")

        @jax.jit
        def solve():
            shading = light_at_camera(values, inside, jnp.float32(1), Lambertian())
            found = sweep(shading, metric, inside, known, updates=name)
            return shading.to_range(found.w), found.rounds

        rounds = int(solve()[1])
        return measure.Program(
            f"jaxsfs, order 2, {name}",
            lambda: jax.block_until_ready(solve()),
            lambda result: float(np.abs(np.asarray(result[0], float) * cosine - 1).mean()),
            note=f"{rounds} rounds",
        )

    return measure.compare("orders of updates", size, [program(name) for name in ROUNDS], repetitions)
