"""What isophotes give locally: curvature of the surface at its singular points.

In the spirit of R. Šára, "Isophotes: the key to tractable local shading analysis" (CAIP 1995) and his thesis "Local
shading analysis via isophotes properties" (Linz 1994), the paper's [Šára 1995]. Neither text could be had (searched:
both titles, author and year, "isophote" with "apparent boundary" and "self-shadow boundary" in stored web pages,
documentation and source code; only citations turned up), so this is not his algorithm. What can be derived without
it: round a singular point E = 1 − ½ xᵀA M A x, with A the Hessian of Z and M that of 1 − R at the point's slopes.
Isophotes there are ellipses whose axes are the principal directions, and

    A = −M^(−½) (M^(½) H M^(½))^(½) M^(−½),   H the Hessian of 1 − E,

the convex one of the roots. It gives curvature at points, no height per pixel: it has no row in the table of depths,
and starts Horn's strips instead (`strips`).
"""

import numpy as np
from scipy import ndimage

from baselines.distant import DistantImage


def singular_points(image: DistantImage, threshold: float = 0.995) -> list[tuple[int, int]]:
    """Pixels (x, y) at which E has a maximum above `threshold`, three pixels inside the mask."""
    e = np.where(image.mask, image.values, 0)
    inner = ndimage.binary_erosion(image.mask, np.ones((3, 3)), iterations=3)
    highest = inner & (e >= ndimage.maximum_filter(e, 5)) & (e > threshold)
    labels, count = ndimage.label(highest, np.ones((3, 3)))
    places = ndimage.center_of_mass(highest, labels, range(1, count + 1))
    return [(round(x), round(y)) for y, x in places]


def hessian_of_height(
    image: DistantImage, point: tuple[int, int], reach: int = 3
) -> tuple[np.ndarray, tuple[float, float]]:
    """Hessian (2, 2) of Z at a summit and its place (x, y) in px, from a quadratic fitted to E round about."""
    x0, y0 = point
    rows, columns = (slice(max(at - reach, 0), at + reach + 1) for at in (y0, x0))
    y, x = np.nonzero(image.mask[rows, columns])
    seen = image.values[rows, columns][y, x]
    x, y = x + columns.start - x0, y + rows.start - y0
    design = np.stack([np.ones(len(x)), x, y, x**2 / 2, x * y, y**2 / 2], axis=-1)
    _, gx, gy, xx, xy, yy = np.linalg.lstsq(design, seen, rcond=None)[0]
    fitted = -np.array([[xx, xy], [xy, yy]])
    shift = np.clip(np.linalg.solve(fitted, [gx, gy]), -1, 1)
    h = fitted / image.spacing**2
    root_m = _root(_hessian_of_reflectance(image.light))
    inverse = np.linalg.inv(root_m)
    return -inverse @ _root(root_m @ h @ root_m) @ inverse, (x0 + shift[0], y0 + shift[1])


def _hessian_of_reflectance(light):
    """−∂²R/∂(p, q)² where the normal is the light: p₀ = −s_x/s_z, q₀ = −s_y/s_z."""
    metric = np.outer(light[:2], light[:2])
    # a slope changes the unit normal by dn = s_z (I − n nᵀ) (−dp, −dq, 0), and R = 1 − ½ |dn|²
    return light[2] ** 2 * (np.eye(2) - metric)


def _root(matrix):
    values, vectors = np.linalg.eigh(0.5 * (matrix + matrix.T))
    return vectors @ np.diag(np.sqrt(np.maximum(values, 1e-9))) @ vectors.T
