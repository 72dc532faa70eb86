"""The expanding curve as a chain of points: eqs. (1)–(2) as they stand (Bruckstein 1988; Kimmel & Bruckstein 1995a).

Frontal distant light. Each point of the equal-height curve moves along the curve's normal with dh = dt of descent and
speed F = E/√(1 − E²) per unit of height (eq. 3). Points are spread evenly again at every step, which is what keeps
the chain stable; nothing tells it that it has run into itself, so where two fronts meet it forms swallowtails and
overlaps (`self_intersections`), and heights are written twice. That is why the level set took its place.
"""

from typing import NamedTuple

import numpy as np
from scipy.interpolate import LinearNDInterpolator
from scipy.ndimage import map_coordinates

from baselines.distant import DistantImage, Grid, Relief


class Chain(NamedTuple):
    """Closed curves (points, 2) in pixels (x, y) at descents `times`."""

    curves: list[np.ndarray]
    times: list[float]


def expand(image: DistantImage, summit: tuple[float, float], drop: float, steps: int = 400, points: int = 200) -> Chain:
    """Expands a small circle of one pixel and a half round `summit` (x, y in px) by `drop` (same unit as Z).

    Raises ValueError for an oblique light: eqs. (1)–(3) are for a light along the viewing direction.
    """
    if not image.frontal:
        raise ValueError("eqs. (1)–(3) hold for a light along the viewing direction only")
    e = np.where(image.mask, np.clip(image.values, 0.0, 0.99995), 0)
    speed = e / np.sqrt(1 - e**2) / image.spacing
    angles = np.linspace(0, 2 * np.pi, points, endpoint=False)
    curve = np.asarray(summit) + 1.5 * np.stack([np.cos(angles), np.sin(angles)], axis=1)
    curves, times, step = [curve], [0.0], drop / steps
    for n in range(steps):
        moved = curve + step * _at(speed, curve)[:, None] * _normals(curve)
        middle = 0.5 * (curve + moved)
        curve = _even(curve + step * _at(speed, middle)[:, None] * _normals(middle))
        curves.append(curve)
        times.append((n + 1) * step)
    return Chain(curves, times)


def heights(image: DistantImage, chain: Chain, top: float) -> Relief:
    """Z interpolated between the curves; pixels that no curve reached have none."""
    few = slice(None, None, max(1, len(chain.curves) // 150))
    curves, times = chain.curves[few], np.asarray(chain.times[few])
    points = np.concatenate(curves)
    z = np.repeat(top - times, [len(curve) for curve in curves])
    keep = _at(image.mask.astype(float), points) > 0.5
    x, y = np.meshgrid(np.arange(image.mask.shape[1]), np.arange(image.mask.shape[0]))
    found = np.asarray(LinearNDInterpolator(points[keep], z[keep])(x, y))
    reached = image.mask & np.isfinite(found)
    grid = Grid(reached, image.spacing)
    p, q = grid.slopes(grid.vector(np.where(reached, found, 0)))
    return Relief(np.where(reached, found, np.nan), grid.image(p), grid.image(q))


def self_intersections(curve: np.ndarray) -> int:
    """Number of crossings of a closed polygon with itself: 0 for a curve that encloses a region."""
    a, b = curve, np.roll(curve, -1, axis=0)

    def side(p, q, r):
        return (q[..., 0] - p[..., 0]) * (r[..., 1] - p[..., 1]) - (q[..., 1] - p[..., 1]) * (r[..., 0] - p[..., 0])

    p, q, r, s = a[:, None], b[:, None], a[None], b[None]
    cross = (side(p, q, r) * side(p, q, s) < 0) & (side(r, s, p) * side(r, s, q) < 0)
    return int(cross.sum()) // 2


def _at(field, points):
    return map_coordinates(field, [points[:, 1], points[:, 0]], order=1, mode="nearest")


def _normals(curve):
    """Outward normals of a curve that runs from x to y."""
    along = np.roll(curve, -1, axis=0) - np.roll(curve, 1, axis=0)
    outward = np.stack([along[:, 1], -along[:, 0]], axis=1)
    return outward / np.maximum(np.linalg.norm(outward, axis=1, keepdims=True), 1e-12)


def _even(curve):
    """The same number of points, evenly spaced along the polygon."""
    closed = np.concatenate([curve, curve[:1]])
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(closed, axis=0), axis=1))])
    wanted = np.linspace(0, length[-1], len(curve), endpoint=False)
    return np.stack([np.interp(wanted, length, closed[:, k]) for k in range(2)], axis=1)
