"""Given speed on the sphere of rays of a wide-angle camera, second order, from a circle: in pixels by the sweeps, and
by scikit-fmm on a stereographic grid of as many points, with resampling both ways.

θ is the angle from an oblique direction; T = (θ − θ₀)(1 + 0.3 (θ − θ₀)), so F = 1/(1 + 0.6 (θ − θ₀)).
"""

import jax
import jax.numpy as jnp
import measure
import numpy as np
from scipy.ndimage import map_coordinates

from jaxsfs.camera import Spherical
from jaxsfs.shading import DistantLight
from jaxsfs.sweeping import sweep

HALF_FIELD_DEG = 50.0  # at the corners
START = 0.1  # θ₀, rad
AXIS = np.array([0.15, -0.1, 1.0]) / np.linalg.norm([0.15, -0.1, 1.0])


def rows(size: int, repetitions: int) -> list[dict]:
    """The one problem at one size."""
    middle = (size - 1) / 2
    focal = np.sqrt(2) * middle / np.sin(np.deg2rad(HALF_FIELD_DEG))
    camera = Spherical(focal, middle, middle, size, size)
    rays = np.asarray(camera.rays(), float)
    beyond, speed = _angle_and_speed(rays)
    truth = beyond * (1 + 0.3 * beyond)

    def error(time):
        return float(np.abs(np.asarray(time, float) - truth)[beyond > 0].mean())

    # |∇T|_g = 1/F is a distant light's equation with 1/c² − 1 = 1/F²
    shading = DistantLight(jnp.asarray(1 / np.sqrt(1 + 1 / speed**2), jnp.float32), 1.0)
    metric = camera.inverse_metrics(np.dtype(np.float32))
    inside = jnp.ones((size, size), bool)
    known = jnp.asarray(np.where(beyond <= 2.5 / focal, truth, np.inf), jnp.float32)

    def ours():
        return jax.block_until_ready(sweep(shading, metric, inside, known, order=2, tolerance=1e-5)).w

    skfmm, missing = measure.peer("skfmm", "scikit-fmm")
    programs = [
        measure.Program("jaxsfs, order 2", ours, error, note="float32"),
        missing
        or measure.Program("scikit-fmm, order 2", _stereographic(skfmm, rays, focal, speed), error, note="resampled"),
        measure.peer("agd", "HFM Riemannian")[1]
        or measure.Missing("HFM Riemannian", "skipped: its solver is not wired"),
    ]
    return measure.compare("sphere metric, second order", size, programs, repetitions)


def _angle_and_speed(rays):
    beyond = np.arccos(np.clip(rays @ AXIS, -1, 1)) - START
    return beyond, 1 / (1 + 0.6 * np.maximum(beyond, -START))


def _stereographic(skfmm, rays, focal, speed):
    """p = 2 tan(α/2)(cos, sin) is conformal: |∇T| on the grid is (1 + p²/4)⁻¹/F."""
    size = len(speed)
    points = 2 * rays[..., :2] / (1 + rays[..., 2:])
    reach = np.abs(points).max()
    spacing = float(2 * reach / (size - 1))
    axis = np.linspace(-reach, reach, size)
    x, y = np.meshgrid(axis, axis)
    square = (x * x + y * y) / 4
    directions = np.stack([x, y, 1 - square], -1) / (1 + square)[..., None]
    middle = (size - 1) / 2
    to_pixels = np.stack([directions[..., 1] * focal + middle, directions[..., 0] * focal + middle])
    to_grid = np.stack([points[..., 1], points[..., 0]]) / spacing + middle
    phi = _angle_and_speed(directions)[0]

    def solve():
        here = map_coordinates(speed, to_pixels, order=1, mode="nearest")
        time = skfmm.travel_time(phi, here * (1 + square), dx=spacing, order=2)
        return map_coordinates(time, to_grid, order=1, mode="nearest")

    return solve
