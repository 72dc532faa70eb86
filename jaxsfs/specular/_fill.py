"""Weighted biharmonic fit of ln E inside highlights: measured where colour tells the body, else filled.

Solved directly where it is small, and else from coarse to fine: each size starts from the one before, so that
conjugate gradients have only the short waves left to find, which they find within a few steps.
"""

from typing import Any, NamedTuple

import cv2
import numpy as np
import scipy.sparse as sp
from jaxtyping import Bool, Float
from scipy.linalg import solveh_banded
from scipy.sparse.csgraph import reverse_cuthill_mckee

from jaxsfs.forms import Scalar
from jaxsfs.specular._differences import operators
from jaxsfs.specular._local import regions, spread_from

Grey = Float[np.ndarray, "height width"]
Mask = Bool[np.ndarray, "height width"]

_RING = 4  # px around a hole whose noise is smoothed with it
_DIRECT = 6000  # unknowns up to which a direct solve takes less time than conjugate gradients
_TENSION = 0.02  # weight of |∇u|² against (Δu)² px², keeps wide holes from overshooting
_STEPS = 12  # per size; 30 change a measured ln E by 1e-3 at most


class Fit(NamedTuple):
    """Equations of one size: `domain`, whose pixels are unknown, those beyond that are `given`, and the smoothness."""

    domain: Mask
    given: Mask
    stiffness: Any
    coupling: Any
    coarser: "Fit | None"


def fit_for(hole: Mask, usable: Mask, roughness: Scalar, tension: Scalar = _TENSION) -> Fit:
    """What `fit_smooth` needs of the `hole` and of the pixels that are neighbours, for any weights. `tension`: weight
    of |∇u|² against (Δu)² px²."""
    domain = cv2.dilate(hole.astype(np.uint8), np.ones((2 * _RING + 1,) * 2, np.uint8)).astype(bool) & usable
    return _fit_at(domain, usable, float(roughness), float(tension))


def fit_smooth(fit: Fit, measured: Grey, weight: Grey, hole: Mask, start: Grey | None = None) -> Grey:
    """u in the `hole`: the minimum of Σ weight (u − measured)² + Σ ((Δu)² + t|∇u|²)/roughness²; `measured` elsewhere.

    `weight`: 1/variance of what is measured, 0 where nothing is; a ring of a few px round the hole takes part with
    its weights, and its values then stay as measured. A hole without any neighbour keeps its value. `start`: the fit
    to weights that differ here and there, from which large fits go on.
    """
    count, labels = regions(fit.domain)
    anchored = np.bincount(labels[fit.domain & (weight > 0)], minlength=count) > 3
    if not anchored.any():
        return measured
    anchors = np.where(anchored[labels], weight, 1.0)
    return np.where(hole & fit.domain & anchored[labels], _solution(fit, measured, anchors, start), measured)


def _fit_at(domain: Mask, usable: Mask, roughness: float, tension: float) -> Fit:
    extended = cv2.dilate(domain.astype(np.uint8), np.ones((3, 3), np.uint8)).astype(bool) & usable
    laplacian, gradient = operators(extended)
    free = domain[extended]
    rows = (laplacian.T[free] @ laplacian + tension * (gradient.T[free] @ gradient)) / roughness**2
    stiffness, coupling = rows[:, free].tocsr(), rows[:, ~free].tocsr()
    coarser = None
    if free.sum() > _DIRECT:
        # half the size: Δ per coarse px² is 4 times as large and a pixel stands for 4; beyond the field the fit goes on
        # for a pixel, so that its edge has a start of the right slope
        half = _any(domain)
        half |= cv2.dilate(half.astype(np.uint8), np.ones((3, 3), np.uint8)).astype(bool) & _any(~usable)
        coarser = _fit_at(half, half | ~_any(~usable), 2 * roughness, 4 * tension)
    return Fit(domain, extended & ~domain, stiffness, coupling, coarser)


def _solution(fit: Fit, measured: Grey, weight: Grey, start: Grey | None = None) -> Grey:
    """`measured` with the fit in its domain."""
    known = np.where(fit.domain, weight, 0.0)
    strength = known[fit.domain].astype(np.float64)
    matrix: Any = fit.stiffness + sp.diags(strength)
    right = strength * measured[fit.domain] - fit.coupling @ measured[fit.given].astype(np.float64)
    result = measured.astype(np.float64)
    if fit.coarser is None:
        matrix = matrix + 1e-12 * sp.diags(matrix.diagonal())
        result[fit.domain] = _banded_solution(matrix.tocsr(), right)
        return result
    start = _from_coarser(fit, fit.coarser, measured, known) if start is None else start
    result[fit.domain] = _conjugate_gradients(matrix, right, start[fit.domain].astype(np.float64))
    return result


def _banded_solution(matrix: Any, right: np.ndarray) -> np.ndarray:
    """By Cholesky within the band: numbered by its neighbours a highlight is narrow. A third to an eighth of the time
    of a general sparse solve."""
    order = reverse_cuthill_mckee(matrix, symmetric_mode=True)
    place = np.empty_like(order)
    place[order] = np.arange(len(order), dtype=order.dtype)
    entries = matrix.tocoo()
    row, column = place[entries.row], place[entries.col]
    upper = row <= column
    width = int((column - row).max())
    band = np.zeros((width + 1, len(order)))
    band[width + row[upper] - column[upper], column[upper]] = entries.data[upper]
    result = np.empty_like(right)
    result[order] = solveh_banded(band, right[order], overwrite_ab=True, check_finite=False)
    return result


def _conjugate_gradients(matrix: Any, right: np.ndarray, solution: np.ndarray) -> np.ndarray:
    """A few steps, preconditioned by the diagonal."""
    scale = 1 / matrix.diagonal()
    residual = right - matrix @ solution
    direction = scaled = scale * residual
    energy = float(residual @ scaled)
    for _ in range(_STEPS):
        if not energy > 0:
            break
        image = matrix @ direction
        length = energy / float(direction @ image)
        solution = solution + length * direction
        residual = residual - length * image
        scaled = scale * residual
        energy, before = float(residual @ scaled), energy
        direction = scaled + energy / before * direction
    return solution


def _from_coarser(fit: Fit, coarser: Fit, measured: Grey, weight: Grey) -> Grey:
    counted = np.where(fit.domain, weight, 1.0)
    total, sums = _summed(counted), _summed(counted * measured)
    known = total > 0
    mean = np.where(known, sums / np.where(known, total, 1.0), 0.0)
    small = _solution(coarser, mean, np.where(coarser.domain, total, 0.0))
    height, width = measured.shape
    believed = known | coarser.domain
    smooth = np.where(believed, small, spread_from(small, believed))
    fine = cv2.resize(smooth, (2 * smooth.shape[1], 2 * smooth.shape[0]), interpolation=cv2.INTER_CUBIC)
    return fine[:height, :width]


def _summed(values: Grey) -> Float[np.ndarray, "_ _"]:
    """Over blocks of 2 × 2 px."""
    height, width = values.shape
    padded = np.pad(values, ((0, height % 2), (0, width % 2)))
    return padded.reshape(padded.shape[0] // 2, 2, padded.shape[1] // 2, 2).sum((1, 3))


def _any(mask: Mask) -> Bool[np.ndarray, "_ _"]:
    return _summed(mask.astype(np.float64)) > 0
