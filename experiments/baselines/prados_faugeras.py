"""E. Prados & O. Faugeras, "Shape from shading: a well-posed problem?" (CVPR 2005): light at a pinhole, 1/r² falloff.

With the surface f u(x)/√(|x|² + f²) · (x, f), so that the range is r = f u, and v = ln u, a Lambertian picture obeys

    −e^(−2v) + J(x) √(f² |∇v|² + (∇v·x)² + Q²) = 0,   J = E f²/Q,   Q = f/√(|x|² + f²).

Their scheme: at each pixel the value v that solves the equation with upwind differences (for each axis the smaller of
the two neighbours, if that is smaller than v), started from above, v = ½ ln(1/(E f²)) where the surface would face
the light, and iterated until it no longer falls: monotone, converges to the viscosity solution from state constraints.
All pixels are updated at once (Jacobi), each by Newton steps; the source updates one pixel after another.
"""

import numpy as np


def reconstruct(
    e: np.ndarray, mask: np.ndarray, focal_length: float, centre: tuple[float, float], iterations: int = 1500
) -> np.ndarray:
    """Range for an albedo of 1; NaN outside the mask."""
    row, column = np.indices(e.shape)
    x, y, f = column - centre[0], row - centre[1], focal_length
    q = f / np.sqrt(x**2 + y**2 + f**2)
    usable = mask & (e > 0)
    j = np.where(usable, e, 1.0) * f**2 / q
    top = -0.5 * np.log(j * q)
    v = np.where(usable, top, np.inf)
    for _ in range(iterations):
        new = _updated(v, top, usable, j, q, x, y, f)
        change = np.max(v[usable] - new[usable])
        v = new
        if change < 1e-7:
            break
    return np.where(usable, f * np.exp(np.where(usable, v, 0)), np.nan)


def _updated(v, top, usable, j, q, x, y, f):
    padded = np.pad(v, 1, constant_values=np.inf)
    left, right = padded[1:-1, :-2], padded[1:-1, 2:]
    above, below = padded[:-2, 1:-1], padded[2:, 1:-1]
    a, b = np.minimum(left, right), np.minimum(above, below)
    sign_a, sign_b = np.where(left <= right, 1.0, -1.0), np.where(above <= below, 1.0, -1.0)
    a, b = np.where(np.isfinite(a), a, 1e3), np.where(np.isfinite(b), b, 1e3)
    z = np.where(usable, np.minimum(v, top), 0)
    for _ in range(4):  # Newton from above: the left side rises with v and is convex enough to converge in a few
        p, r = np.maximum(z - a, 0), np.maximum(z - b, 0)
        along = sign_a * p * x + sign_b * r * y
        root = np.sqrt(f**2 * (p**2 + r**2) + along**2 + q**2)
        slope_p, slope_r = p > 0, r > 0
        d_along = sign_a * x * slope_p + sign_b * y * slope_r
        d_root = (f**2 * (p + r) + along * d_along) / root
        value = j * root - np.exp(-2 * z)
        rise = j * d_root + 2 * np.exp(-2 * z)
        z = z - np.where(usable, value / np.maximum(rise, 1e-12), 0)
    return np.where(usable, np.minimum(v, np.minimum(z, top)), np.inf)
