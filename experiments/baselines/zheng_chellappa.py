"""Q. Zheng & R. Chellappa, "Estimation of illuminant direction, albedo, and shape from shading", PAMI 13 (1991).

Instead of smoothness the gradient of the picture must be explained too:
∬ (E − R)² + (E_x − R_p p_x − R_q q_x)² + (E_y − R_p p_y − R_q q_y)² + μ ((p − Z_x)² + (q − Z_y)²).
Each step solves for (δp, δq, δZ) at a pixel with R linear in (p, q) and the neighbours held, in pixels, from coarse
pictures to fine ones; Z_x is a forward and p_x a backward difference, so that both come from one energy. Light and
albedo are known here. The rim is free, the start flat; for a frontal light, where that is a stationary point, the
start on the coarsest picture is `lee_rosenfeld`. The gradient term neglects R_pp and its like, so
even the truth drifts slowly: more iterations do not mean less error.
"""

import numpy as np
from scipy.ndimage import zoom

from baselines import lee_rosenfeld
from baselines.distant import STEEPEST, DistantImage, Grid, Relief, clipped, reflectance, reflectance_slopes


def reconstruct(image: DistantImage, iterations: int = 30, coarsest: int = 17, integrable: float = 1.0) -> Relief:
    """`iterations` at each size, from the one just above `coarsest` px by doubling; `integrable`: μ."""
    pyramid = [image]
    while min(pyramid[-1].mask.shape) > coarsest:
        pyramid.append(_halved(pyramid[-1]))
    state = _start(pyramid[-1])
    for level in pyramid[::-1]:
        state = _relax(level, _fitted(state, level), iterations, integrable)
    p, q, z = state
    outside = ~image.mask
    p, q, z = (np.where(outside, np.nan, part) for part in (p, q, z * image.spacing))
    grid = Grid(image.mask, image.spacing)
    return Relief(z, *(grid.image(part) for part in clipped(grid.vector(p), grid.vector(q))))


def _start(image):
    if not image.frontal:
        return tuple(np.zeros_like(image.values) for _ in range(3))
    first = lee_rosenfeld.reconstruct(image)
    return tuple(np.nan_to_num(part) for part in (first.p, first.q, first.height / image.spacing))


def _relax(image, state, iterations, mu):
    p, q, z = state
    e, lit = np.where(image.mask, image.values, 0), image.mask & (image.values > 0)
    curved = _laplacian(e, image.mask)
    for _ in range(iterations):
        r = np.maximum(reflectance(p, q, image.light), 0)
        by_p, by_q = reflectance_slopes(p, q, image.light)
        misfit = np.where(lit, e - r + by_p * _laplacian(p, image.mask) + by_q * _laplacian(q, image.mask) - curved, 0)
        z_x, z_y = _forward(z, image.mask)
        c1 = misfit * by_p - mu * (p - z_x)
        c2 = misfit * by_q - mu * (q - z_y)
        c3 = -_backward(p, image.mask, 1) - _backward(q, image.mask, 0) + _laplacian(z, image.mask)
        a, b, c = 5 * by_p**2 + 0.75 * mu, 5 * by_p * by_q - 0.25 * mu, 5 * by_q**2 + 0.75 * mu
        determinant = a * c - b**2
        one, two = c1 - 0.25 * mu * c3, c2 - 0.25 * mu * c3
        dp, dq = (c * one - b * two) / determinant, (a * two - b * one) / determinant
        z = z + 0.25 * (c3 - dp - dq)
        p, q = np.clip(p + dp, -STEEPEST, STEEPEST), np.clip(q + dq, -STEEPEST, STEEPEST)
    return p, q, z


def _laplacian(x, mask):
    """Sum over the four neighbours in the mask minus the pixel's own (free rim)."""
    padded, inside = np.pad(x, 1), np.pad(mask, 1)
    total = np.zeros_like(x)
    for rows, columns in ((slice(0, -2), slice(1, -1)), (slice(2, None), slice(1, -1)),
                          (slice(1, -1), slice(0, -2)), (slice(1, -1), slice(2, None))):  # fmt: skip
        total += np.where(inside[rows, columns] & mask, padded[rows, columns] - x, 0)
    return total


def _forward(z, mask):
    right, below = np.roll(mask, -1, 1) & mask, np.roll(mask, -1, 0) & mask
    right[:, -1], below[-1] = False, False
    return np.where(right, np.roll(z, -1, 1) - z, 0), np.where(below, np.roll(z, -1, 0) - z, 0)


def _backward(x, mask, axis):
    before = np.roll(mask, 1, axis) & mask
    before[(slice(None), 0) if axis == 1 else (0, slice(None))] = False
    return np.where(before, x - np.roll(x, 1, axis), 0)


def _halved(image):
    """Every second pixel: E and slopes keep their values, the pixel doubles."""
    return DistantImage(image.values[::2, ::2], image.mask[::2, ::2], image.light, 2 * image.spacing)


def _fitted(state, image):
    """The state of a coarser level on this level's pixels; Z is in pixels, so it doubles."""
    p, q, z = state
    if p.shape == image.mask.shape:
        return state
    ratio = [new / old for new, old in zip(image.mask.shape, p.shape, strict=True)]
    scaled = [zoom(part, ratio, order=1, grid_mode=False)[: image.mask.shape[0], : image.mask.shape[1]]
              for part in (p, q, 2 * z)]  # fmt: skip
    return tuple(np.where(image.mask, part, 0) for part in scaled)
