"""The rays of a spherical camera on a plane grid of as many points, where a solver for constant metrics works."""

from typing import NamedTuple

import numpy as np

from jaxsfs.camera import Spherical

HALF_FIELD_DEG = 50.0  # at the corners


def square_camera(size: int) -> Spherical:
    """The camera of `size` × `size` px with the half field at its corners."""
    middle = (size - 1) / 2
    focal = np.sqrt(2) * middle / np.sin(np.deg2rad(HALF_FIELD_DEG))
    return Spherical(focal, middle, middle, size, size)


class Stereographic(NamedTuple):
    """p = 2 tan(α/2)(cos, sin), conformal: lengths on the sphere are those on the grid over 1 + p²/4. `quarter`: p²/4.

    `to_pixels`: where the grid's points lie in the picture, `to_grid`: the pixels on the grid, both (row, column).
    """

    x: np.ndarray
    y: np.ndarray
    quarter: np.ndarray
    reach: float
    spacing: float
    directions: np.ndarray
    to_pixels: np.ndarray
    to_grid: np.ndarray


def stereographic(camera: Spherical, rays: np.ndarray) -> Stereographic:
    """The grid that covers the picture."""
    size, focal, middle = camera.width, float(camera.f), float(camera.cx)
    points = 2 * rays[..., :2] / (1 + rays[..., 2:])
    reach = float(np.abs(points).max())
    spacing = 2 * reach / (size - 1)
    axis = np.linspace(-reach, reach, size)
    x, y = np.meshgrid(axis, axis)
    quarter = (x * x + y * y) / 4
    directions = np.stack([x, y, 1 - quarter], -1) / (1 + quarter)[..., None]
    to_pixels = np.stack([directions[..., 1] * focal + middle, directions[..., 0] * focal + middle])
    to_grid = np.stack([points[..., 1], points[..., 0]]) / spacing + middle
    return Stereographic(x, y, quarter, reach, spacing, directions, to_pixels, to_grid)
