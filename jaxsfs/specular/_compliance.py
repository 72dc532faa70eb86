"""Whether the dichromatic model holds in a photograph: are the colours of small regions planar?"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from jaxsfs.specular._colour import noise_covariance

SIDE = 16  # px of a region
_NOISE = 2.0  # times the noise's variance: what may stick out of a plane
_CURVED = 0.01  # of the colours' length: what response curves and colour spaces leave
_FEWEST = 10  # regions that say something


class Compliance(NamedTuple):
    """`share` of `regions` whose colours are planar; NaN where too few regions are bright and whole."""

    share: float
    regions: int


def dichromatic_compliance(
    linear: Float[np.ndarray, "height width 3"], usable: Bool[np.ndarray, "height width"]
) -> Compliance:
    """How much of a picture keeps to I = m_B k_B + m_S k_S (eq. 7) region by region.

    Body and interface span a plane through black, so the smallest eigenvalue of a region's second moments
    Σ I Iᵀ/n, whitened by the channels' noise, is 1. A region of 16 × 16 px complies when it is below 2, or when its
    root is below 1 % of that of the largest. `linear`: response inverted; `usable`: pixels that are data. Where several
    body colours meet under highlights, or the response is wrong, a ⟂ k_s does not give the body.
    """
    down, across = (length // SIDE for length in usable.shape)
    blocks = (down, SIDE, across, SIDE)
    cut = np.s_[: down * SIDE, : across * SIDE]
    whole = usable[cut].reshape(blocks).all(axis=(1, 3))
    regions = linear[cut].reshape(*blocks, 3).swapaxes(1, 2)[whole]
    if len(regions) < _FEWEST:
        return Compliance(float("nan"), len(regions))
    white = np.linalg.inv(np.linalg.cholesky(noise_covariance(linear, usable)))
    colours = regions.reshape(len(regions), -1, 3) @ white.T
    moments = colours.swapaxes(1, 2) @ colours / SIDE**2
    least, _, largest = np.linalg.eigvalsh(moments).T
    planar = (least <= _NOISE) | (least <= _CURVED**2 * largest)
    return Compliance(float(planar.mean()), len(regions))
