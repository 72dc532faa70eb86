"""P.-S. Tsai & M. Shah, "Shape from shading using linear approximation", Image and Vision Computing 12 (1994) 487–498.

p = Z(x, y) − Z(x − 1, y), q likewise, in pixels: E − R(p, q) is then a function of one unknown height per pixel, and
is driven to zero by Newton's method with a gain that shrinks as the estimate settles (a scalar Kalman filter). Where
the light is frontal nothing of first order is left at the flat start; then, as is usual, the light is taken 0.6° off.
"""

import numpy as np

from baselines.distant import DistantImage, Grid, Relief, reflectance, reflectance_slopes


def reconstruct(image: DistantImage, iterations: int = 10, noise: float = 1e-4) -> Relief:
    """Z after so many iterations from a flat start; slopes are backward differences as in the source."""
    z = np.zeros_like(image.values)
    light = np.array([0.01, 0.01, 1.0]) / np.sqrt(1.0002) if image.frontal else image.light
    trust = np.ones_like(z)
    for _ in range(iterations):
        p, q = _backward(z)
        misfit = image.values - np.maximum(reflectance(p, q, light), 0)
        slope = -sum(reflectance_slopes(p, q, light))
        gain = trust * slope / (noise + trust * slope**2)
        z = z - gain * misfit
        trust = (1 - gain * slope) * trust
    z = np.where(image.mask, z, np.nan) * image.spacing
    grid = Grid(image.mask, image.spacing)
    p, q = grid.slopes(grid.vector(z))
    return Relief(z, grid.image(p), grid.image(q))


def _backward(z):
    return z - np.roll(z, 1, axis=1), z - np.roll(z, 1, axis=0)
