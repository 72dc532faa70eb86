"""K. Ikeuchi & B. K. P. Horn, "Numerical shape from shading and occluding boundaries", Artif. Intell. 17 (1981).

Minimises ∬ (E − R(f, g))² + λ (|∇f|² + |∇g|²) over the stereographic slopes f = 2p/(1 + √(1 + p² + q²)), g likewise,
with the normals on the rim given, by the Jacobi iteration f ← f̄ + (h²/4λ)(E − R(f̄, ḡ)) R_f(f̄, ḡ). Slopes need not
be those of one surface; they are integrated at the end. λ never reaches zero, so what comes out is too smooth.
"""

import numpy as np

from baselines.distant import DistantImage, Grid, Relief, clipped


def reconstruct(
    image: DistantImage, rim_p: np.ndarray, rim_q: np.ndarray, weight: float = 2e-4, iterations: int = 3000
) -> Relief:
    """`rim_p`, `rim_q`: slopes where they are known (the rim), NaN elsewhere; `weight`: λ for a picture 1 unit wide."""
    grid = Grid(image.mask, image.spacing)
    fixed = np.isfinite(grid.vector(rim_p))
    known = to_stereographic(np.nan_to_num(grid.vector(rim_p)), np.nan_to_num(grid.vector(rim_q)))
    e, gain = grid.vector(image.values), image.spacing**2 / (4 * weight)
    f, g = (np.where(fixed, part, 0.0) for part in known)
    for _ in range(iterations):
        f_mean, g_mean = grid.mean_of_neighbours(f), grid.mean_of_neighbours(g)
        shade, by_f, by_g = _reflectance(f_mean, g_mean, image.light)
        misfit = np.where(shade > 0, e - shade, e)
        damp = 1 + gain * (by_f**2 + by_g**2)  # the linearised step: stays stable for small λ
        f = np.where(fixed, known[0], f_mean + gain * misfit * by_f / damp)
        g = np.where(fixed, known[1], g_mean + gain * misfit * by_g / damp)
    p, q = clipped(*from_stereographic(f, g))
    return Relief(grid.image(grid.integrate(p, q)), grid.image(p), grid.image(q))


def to_stereographic(p, q):
    factor = 2 / (1 + np.sqrt(1 + p**2 + q**2))
    return p * factor, q * factor


def from_stereographic(f, g):
    factor = 4 / np.maximum(4 - f**2 - g**2, 0.05)
    return f * factor, g * factor


def _reflectance(f, g, light):
    """R, R_f, R_g of n = (−4f, −4g, 4 − f² − g²)/(4 + f² + g²)."""
    square = f**2 + g**2
    top = -4 * f * light[0] - 4 * g * light[1] + (4 - square) * light[2]
    bottom = 4 + square
    value = top / bottom
    by_f = (-4 * light[0] - 2 * f * light[2] - 2 * f * value) / bottom
    by_g = (-4 * light[1] - 2 * g * light[2] - 2 * g * value) / bottom
    return value, by_f, by_g
