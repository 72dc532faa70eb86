"""R. Szeliski, "Fast shape from shading", CVGIP: Image Understanding 53 (1991) 129–153.

Conjugate gradients on Horn's energy in a hierarchical basis: a vector of coefficients c, one per pixel, of tents of
all widths 1, 2, 4, …; x = S c interpolates from coarse to fine, and the gradient in the new basis is Sᵀ times that in
the old, so preconditioning is d = S Sᵀ g and costs one pass up and one down. Wide tents carry what the picture says
far in one step; 20 to 100 times fewer iterations than plain descent.
"""

import numpy as np

from baselines.conjugate_gradient import Preconditioner, staged
from baselines.distant import DistantImage, Relief
from baselines.energy import Energy, Unknowns


def reconstruct(
    image: DistantImage,
    rim_p: np.ndarray,
    rim_q: np.ndarray,
    stages: tuple[float, ...] = (1e-3, 1e-4, 1e-5, 1e-6),
    integrable: float = 0.1,
    iterations: int = 60,
) -> Relief:
    """`stages`: λ for a picture 1 unit wide, `iterations` each; `integrable`: μ; rim slopes held where given."""
    return staged(image, rim_p, rim_q, preconditioner, stages, integrable, iterations)


def preconditioner(energy: Energy, smooth: float, integrable: float, x: Unknowns) -> Preconditioner:
    """d = S Sᵀ g for each of p, q and Z, each scaled by the curvature of its own block."""
    mask = energy.image.mask
    size = 2 ** int(np.ceil(np.log2(max(mask.shape) - 1))) + 1
    by = energy.shade(x)
    slope_scale = 1 / (np.mean(by[1] ** 2 + by[2] ** 2) + integrable + 4 * smooth / energy.grid.spacing**2)
    height_scale = energy.grid.spacing**2 / (4 * integrable)

    def smoothed(vector):
        square = np.zeros((size, size))
        square[: mask.shape[0], : mask.shape[1]][mask] = vector
        return synthesis(analysis(square))[: mask.shape[0], : mask.shape[1]][mask]

    def apply(g: Unknowns) -> Unknowns:
        # held slopes move with their tents only as far as `free` lets them: not at all
        p, q = (energy.free * smoothed(energy.free * part) * slope_scale for part in (g.p, g.q))
        return Unknowns(p, q, smoothed(g.z) * height_scale)

    return apply


def synthesis(c: np.ndarray) -> np.ndarray:
    """S: from coefficients to values, coarse to fine; size 2^k + 1."""
    x, step = c.copy(), (c.shape[0] - 1) // 2
    while step >= 1:
        w = 2 * step
        x[::w, step::w] += 0.5 * (x[::w, :-step:w] + x[::w, w::w])
        x[step::w, ::step] += 0.5 * (x[:-step:w, ::step] + x[w::w, ::step])
        step //= 2
    return x


def analysis(g: np.ndarray) -> np.ndarray:
    """Sᵀ: from values to coefficients, fine to coarse; the exact adjoint of `synthesis`."""
    x, step = g.copy(), 1
    while step <= (g.shape[0] - 1) // 2:
        w = 2 * step
        x[:-step:w, ::step] += 0.5 * x[step::w, ::step]
        x[w::w, ::step] += 0.5 * x[step::w, ::step]
        x[::w, :-step:w] += 0.5 * x[::w, step::w]
        x[::w, w::w] += 0.5 * x[::w, step::w]
        step = w
    return x
