"""S.-H. Lai & B. C. Vemuri, "Physically based adaptive preconditioning for early vision", PAMI 19 (1997) 594–607.

Conjugate gradients on the same energy with P = W Λ⁻¹ Wᵀ: W an orthonormal wavelet basis (Haar here), Λ one number per
scale that follows the spectrum of the operator, both of the smoothness and of the data, so that it adapts to λ and to
the picture. Λ is measured: the Rayleigh quotient of the Gauss–Newton matrix for a random vector of each scale.
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
    """g ↦ W Λ⁻¹ Wᵀ g for each of p, q and Z."""
    mask = energy.image.mask
    levels = int(np.ceil(np.log2(max(mask.shape))))
    size = 2**levels
    scale_of = _scales(size, levels)
    none = np.zeros(energy.grid.count)
    rng = np.random.default_rng(0)

    def crop(square):
        return square[: mask.shape[0], : mask.shape[1]][mask]

    def spread(vector):
        square = np.zeros((size, size))
        square[: mask.shape[0], : mask.shape[1]][mask] = vector
        return square

    spectra: list[np.ndarray] = []
    for block in range(3):
        spectrum = np.ones(levels + 1)
        for level in range(levels + 1):
            coefficients = np.where(scale_of == level, rng.choice([-1.0, 1.0], scale_of.shape), 0)
            probe = crop(haar_inverse(coefficients)) * (energy.free if block < 2 else 1)
            parts = [none, none, none]
            parts[block] = probe
            curvature = energy.curvature(x, Unknowns(*parts), smooth, integrable)
            spectrum[level] = max(curvature / max(probe @ probe, 1e-30), 1e-12)
        spectra.append(spectrum[scale_of])

    def apply(g: Unknowns) -> Unknowns:
        kept = (energy.free * g.p, energy.free * g.q, g.z)
        done = [crop(haar_inverse(haar(spread(v)) / s)) for v, s in zip(kept, spectra, strict=True)]
        return Unknowns(energy.free * done[0], energy.free * done[1], done[2])

    return apply


def haar(values: np.ndarray) -> np.ndarray:
    """Orthonormal 2-D Haar transform of a square of 2^k: coarse coefficients in the upper left corner."""
    x, size = values.astype(float).copy(), values.shape[0]
    while size > 1:
        part = x[:size, :size]
        rows = np.concatenate([part[:, ::2] + part[:, 1::2], part[:, ::2] - part[:, 1::2]], axis=1)
        x[:size, :size] = np.concatenate([rows[::2] + rows[1::2], rows[::2] - rows[1::2]], axis=0) / 2
        size //= 2
    return x


def haar_inverse(coefficients: np.ndarray) -> np.ndarray:
    """The transpose of `haar`, and its inverse."""
    x, size = coefficients.astype(float).copy(), 2
    while size <= coefficients.shape[0]:
        part, half = x[:size, :size].copy(), size // 2
        rows = np.empty_like(part)
        rows[::2], rows[1::2] = part[:half] + part[half:], part[:half] - part[half:]
        columns = np.empty_like(part)
        columns[:, ::2], columns[:, 1::2] = rows[:, :half] + rows[:, half:], rows[:, :half] - rows[:, half:]
        x[:size, :size] = columns / 2
        size *= 2
    return x


def _scales(size: int, levels: int) -> np.ndarray:
    """Scale of every coefficient: 0 the mean, `levels` the finest."""
    scale = np.zeros((size, size), int)
    for level in range(1, levels + 1):
        half = 2 ** (level - 1)
        scale[: 2 * half, half : 2 * half] = level
        scale[half : 2 * half, : 2 * half] = level
    return scale
