"""Residuals as vectors in the image, for pictures."""

import numpy as np
from jaxtyping import Float, Int

from jaxsfs.calibration._fit import Fit, observed, plane_points
from jaxsfs.calibration._residuals import great_circles, look

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
    across = _ring_gradient(found) if found.setup.kind == "rings" else line_gradients(found)
    return across / np.maximum(np.hypot(*across.T), 1e-12)[:, None] * found.residual


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


def line_gradients(found: Fit) -> Float[np.ndarray, "count 2"]:
    """∇(n·d), d the pixel's ray and n the normal of its line's great circle, with the sign of the fit's residuals."""
    seen = observed(found)
    rays = look(seen, found.parameters)
    return np.einsum("ni,nij->nj", great_circles(seen, rays.ray).normal[seen.group], rays.slope)


def line_directions(found: Fit) -> Float[np.ndarray, "count 2"]:
    """Unit vectors along the lines' images at every observation."""
    across = line_gradients(found)
    along = np.stack([-across[:, 1], across[:, 0]], axis=1)
    return along / np.maximum(np.hypot(*across.T), 1e-12)[:, None]
