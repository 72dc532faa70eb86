"""Residuals as vectors in the image, for pictures."""

import numpy as np
from jaxtyping import Float, Int

from jaxsfs.calibration._fit import Fit, plane_points, rays_of

_STEP = 0.5  # px, of the central differences


def photograph_of_rows(found: Fit, lines: list[int]) -> Int[np.ndarray, " count"]:
    """The row among the used photographs of every observation; `lines` are the numbers of lines of each photograph,
    empty for targets with a pose."""
    group = found.setup.observations.group
    return np.repeat(np.arange(len(lines)), lines)[group] if lines else group


def residual_vectors(found: Fit) -> Float[np.ndarray, "count 2"]:
    """Seen minus fitted place of every observation in px; for rings and lines, whose place along the curve says
    nothing, across it."""
    if found.setup.kind == "points":
        return -found.residual  # projected minus seen
    across = _ring_gradient(found) if found.setup.kind == "rings" else _line_gradient(found)
    length = np.hypot(*across.T)[:, None]
    across = across / np.maximum(length, 1e-12)
    return across * (_line_distance(found, length[:, 0]) if found.setup.kind == "lines" else found.residual)


def _ring_gradient(found: Fit) -> Float[np.ndarray, "count 2"]:
    """∇R, R(u, v) the radius on the paper that a pixel sees."""
    o = found.setup.observations
    gradient = np.zeros_like(o.pixel)
    for axis in range(2):
        step = _STEP * np.eye(2)[axis]
        for view in np.unique(o.group):
            mine = o.group == view
            ahead, behind = (np.hypot(*plane_points(found, o.pixel[mine] + s * step, int(view)).T) for s in (1, -1))
            gradient[mine, axis] = (ahead - behind) / (2 * _STEP)
    return gradient


def _line_gradient(found: Fit) -> Float[np.ndarray, "count 2"]:
    """∇(n·d), n the normal of the line's great circle and d the pixel's ray."""
    pixel, normal = found.setup.observations.pixel, _great_circles(found)
    sides = [[rays_of(found, pixel + s * _STEP * unit) for s in (1, -1)] for unit in np.eye(2)]
    return np.stack([np.sum(normal * (a - b), axis=1) / (2 * _STEP) for a, b in sides], axis=1)


def _line_distance(found: Fit, length: Float[np.ndarray, " count"]) -> Float[np.ndarray, "count 1"]:
    rays = rays_of(found, found.setup.observations.pixel)
    return (np.sum(_great_circles(found) * rays, axis=1) / np.maximum(length, 1e-12))[:, None]


def line_directions(found: Fit) -> Float[np.ndarray, "count 2"]:
    """Unit vectors along the lines' images at every observation."""
    across = _line_gradient(found)
    along = np.stack([-across[:, 1], across[:, 0]], axis=1)
    return along / np.maximum(np.hypot(*across.T), 1e-12)[:, None]


def _great_circles(found: Fit) -> Float[np.ndarray, "count 3"]:
    """The normal of the best great circle of every row's line."""
    o, kept = found.setup.observations, found.weight > 0
    rays = rays_of(found, o.pixel)
    normal = np.zeros_like(rays)
    for line in np.unique(o.group):
        mine = o.group == line
        used = mine & kept
        if used.sum() >= 3:
            normal[mine] = np.linalg.svd(rays[used], full_matrices=False)[2][-1]
    return normal
