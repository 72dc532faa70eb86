"""Given speed on the sphere of rays of a wide-angle camera, second order, from a circle: in pixels by the sweeps, by
HFM's Riemannian solver where it is installed, and by scikit-fmm on a stereographic grid of as many points, with
resampling both ways.

θ is the angle from an oblique direction; T = (θ − θ₀)(1 + 0.3 (θ − θ₀)), so F = 1/(1 + 0.6 (θ − θ₀)).
"""

import hfm
import jax
import jax.numpy as jnp
import measure
import numpy as np
from scipy.ndimage import map_coordinates
from stereographic import Stereographic, square_camera, stereographic

from jaxsfs.shading import DistantLight
from jaxsfs.sweeping import sweep

START = 0.1  # θ₀, rad
AXIS = np.array([0.15, -0.1, 1.0]) / np.linalg.norm([0.15, -0.1, 1.0])


def rows(size: int, repetitions: int) -> list[dict]:
    """The one problem at one size."""
    camera = square_camera(size)
    rays = np.asarray(camera.rays(), float)
    beyond, speed = _angle_and_speed(rays)
    truth = beyond * (1 + 0.3 * beyond)

    def error(time):
        return float(np.abs(np.asarray(time, float) - truth)[beyond > 0].mean())

    # |∇T|_g = 1/F is a distant light's equation with 1/c² − 1 = 1/F²
    shading = DistantLight(jnp.asarray(1 / np.sqrt(1 + 1 / speed**2), jnp.float32), 1.0)
    metric = camera.inverse_metrics(np.dtype(np.float32))
    inside = jnp.ones((size, size), bool)
    known = jnp.asarray(np.where(beyond <= 2.5 / camera.f, truth, np.inf), jnp.float32)

    def ours(updates=None, order=2):
        found = sweep(shading, metric, inside, known, order=order, tolerance=1e-5, updates=updates)
        return jax.block_until_ready(found).w

    skfmm, missing = measure.peer("skfmm", "scikit-fmm")
    programs = [
        measure.Program("jaxsfs, order 2", ours, error, note=measure.by()),
        measure.Program("the same by XLA alone", lambda: ours("rows"), error),
        measure.Program("jaxsfs, order 3", lambda: ours(order=3), error),
        missing
        or measure.Program(
            "scikit-fmm, order 2", _resampled(skfmm, stereographic(camera, rays), speed), error, note="resampled"
        ),
        hfm.riemannian(metric, speed, known, error),
    ]
    return measure.compare("sphere metric, second order", size, programs, repetitions)


def _angle_and_speed(rays):
    beyond = np.arccos(np.clip(rays @ AXIS, -1, 1)) - START
    return beyond, 1 / (1 + 0.6 * np.maximum(beyond, -START))


def _resampled(skfmm, grid: Stereographic, speed):
    """|∇T| on the grid is (1 + p²/4)⁻¹/F."""
    phi = _angle_and_speed(grid.directions)[0]

    def solve():
        here = map_coordinates(speed, grid.to_pixels, order=1, mode="nearest")
        time = skfmm.travel_time(phi, here * (1 + grid.quarter), dx=grid.spacing, order=2)
        return map_coordinates(time, grid.to_grid, order=1, mode="nearest")

    return solve
