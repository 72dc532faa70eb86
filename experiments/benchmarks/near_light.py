"""Near-light shape from shading, second order: the sweeps, the paper's first-order scheme in JAX, and scikit-fmm with
Picard iteration on a stereographic grid. A Lambertian plane, 50° at the corners, only E and ρ known.

The paper's steps are all of one length, so that with few of them the front falls behind where it is fast, round the
nearest point: with 4 a pixel's width the error is 7e-2 at any size, with 16 about what the scheme can do.
"""

from functools import partial

import jax
import jax.numpy as jnp
import measure
import numpy as np
import paper_scheme
from scipy.ndimage import map_coordinates
from stereographic import Stereographic, square_camera, stereographic

from jaxsfs.reflectance import Lambertian
from jaxsfs.shading import light_at_camera
from jaxsfs.sweeping import sweep

NORMAL = np.array([0.25, -0.15, 1.0]) / np.linalg.norm([0.25, -0.15, 1.0])  # of a tilted plane at distance 1
PICARD = 20  # iterations at most
LARGEST = 512  # px: the peers' work grows with the cube of the size
TOO_LONG = f"skipped: minutes above {LARGEST} px"


def rows(size: int, repetitions: int) -> list[dict]:
    """The one problem at one size."""
    camera = square_camera(size)
    rays = np.asarray(camera.rays(), float)
    cosine = rays @ NORMAL
    truth = 1 / cosine
    irradiance = cosine / truth**2
    inside = jnp.ones((size, size), bool)
    values = jnp.asarray(irradiance, jnp.float32)
    metric = camera.inverse_metrics(np.dtype(np.float32))
    known = jnp.full((size, size), jnp.inf, jnp.float32)

    def error(distance):
        return float(np.abs(np.asarray(distance, float) / truth - 1).mean())

    @partial(jax.jit, static_argnames=("updates", "order"))
    def ours(values, metric, updates=None, order=2):
        shading = light_at_camera(values, inside, jnp.float32(1), Lambertian())
        return shading.to_range(sweep(shading, metric, inside, known, order=order, updates=updates).w)

    paper = jax.jit(paper_scheme.propagate, static_argnames="steps")
    skfmm, missing = measure.peer("skfmm", "scikit-fmm")
    if size > LARGEST:
        missing = measure.Missing("scikit-fmm with Picard iteration", TOO_LONG)
    programs = [
        measure.Program(
            "jaxsfs, order 2", lambda: jax.block_until_ready(ours(values, metric)), error, note=measure.by()
        ),
        measure.Program("the same by XLA alone", lambda: jax.block_until_ready(ours(values, metric, "rows")), error),
        measure.Program("jaxsfs, order 3", lambda: jax.block_until_ready(ours(values, metric, order=3)), error),
        *(
            measure.Missing(f"the paper's scheme in JAX, {steps} steps", TOO_LONG)
            if size > LARGEST
            else measure.Program(
                f"the paper's scheme in JAX, {steps} steps",
                lambda steps=steps: jax.block_until_ready(paper(values, metric, steps=steps)),
                error,
            )
            for steps in (4 * size, 16 * size)
        ),
        missing
        or measure.Program(
            "scikit-fmm with Picard iteration", _picard(skfmm, stereographic(camera, rays), irradiance), error
        ),
    ]
    return measure.compare("near light, second order", size, programs, repetitions)


def _picard(skfmm, grid: Stereographic, irradiance):
    """|∇v| = 2 √(1/E² − v²) for v = r²: v on the right-hand side is that of the iteration before."""
    x, y = grid.x, grid.y

    def solve():
        top = 1 / map_coordinates(irradiance, grid.to_pixels, order=1, mode="nearest")
        top[grid.quarter * 4 > 2 * grid.reach**2] = top.max()
        row, column = np.unravel_index(top.argmin(), top.shape)
        nearest = top[row, column]
        phi = np.hypot(x - x[row, column], y - y[row, column]) - 1.5 * grid.spacing
        v = top
        for _ in range(PICARD):
            slope = 2 * np.sqrt(np.maximum(top**2 - np.minimum(v, top) ** 2, 1e-8))
            new = nearest + skfmm.travel_time(phi, (1 + grid.quarter) / slope, dx=grid.spacing, order=2)
            new = np.minimum(0.5 * (new + v), top)  # damped: undamped it swings
            change = np.abs(new - v).mean() / nearest
            v = new
            if change < 1e-5:
                break
        return np.sqrt(map_coordinates(v, grid.to_grid, order=1, mode="nearest"))

    return solve
