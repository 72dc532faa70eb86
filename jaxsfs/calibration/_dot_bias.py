"""The middle of a dot's image is not the image of its middle: how far they lie apart, by a first fit."""

import numpy as np
from jaxtyping import Float

from jaxsfs.calibration._fit import Fit, plane_points

_DIRECTIONS = 16
_STEP = 0.5  # px, of the central differences


def dot_radius(found: Fit, view: int, pixel: Float[np.ndarray, "count 2"], area: Float[np.ndarray, " count"]) -> float:
    """Median radius in mm of printed dots with the given image areas (px²): √(area·|∂X/∂x|/π)."""
    u, v = (
        (plane_points(found, pixel + step, view) - plane_points(found, pixel - step, view)) / (2 * _STEP)
        for step in _STEP * np.eye(2)
    )
    scale = np.abs(u[:, 0] * v[:, 1] - u[:, 1] * v[:, 0])
    return float(np.median(np.sqrt(area * scale / np.pi)))


def dot_bias(found: Fit, view: int, pixel: Float[np.ndarray, "count 2"], radius: float) -> Float[np.ndarray, "count 2"]:
    """Centroid of the image of a printed circle of `radius` (mm) about what each pixel sees, minus that pixel."""
    angle = 2 * np.pi * np.arange(_DIRECTIONS) / _DIRECTIONS
    towards = np.stack([np.cos(angle), np.sin(angle)], axis=1)
    middle = plane_points(found, pixel, view)
    reach = np.full((len(pixel), _DIRECTIONS), 2.0)
    for _ in range(6):
        rim = (pixel[:, None] + reach[..., None] * towards).reshape(-1, 2)
        seen = np.hypot(*(plane_points(found, rim, view).reshape(*reach.shape, 2) - middle[:, None]).transpose(2, 0, 1))
        reach = reach * np.clip(radius / np.maximum(seen, 1e-9), 0.2, 5.0)
    # the centroid of the star-shaped region of radius reach(θ): ∫ reach³ e dθ / (3/2 ∫ reach² dθ)
    return (reach**3 @ towards) * (2 / 3) / np.sum(reach**2, axis=1)[:, None]
