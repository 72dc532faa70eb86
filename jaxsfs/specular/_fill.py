"""Weighted biharmonic fit of ln E inside highlights: measured where colour tells the body, else filled."""

from typing import Any

import cv2
import numpy as np
import scipy.sparse as sp
from jaxtyping import Bool, Float, Int
from scipy.sparse.linalg import cg, spsolve

from jaxsfs.forms import Scalar
from jaxsfs.specular._local import blur, regions

Grey = Float[np.ndarray, "height width"]
Mask = Bool[np.ndarray, "height width"]

_RING = 4  # px around a hole whose noise is smoothed with it
_DIRECT = 60000
_TENSION = 0.02  # weight of |∇u|² against (Δu)² px², keeps wide holes from overshooting


def fit_smooth(measured: Grey, weight: Grey, hole: Mask, usable: Mask, roughness: Scalar) -> Grey:
    """u in the `hole`: the minimum of Σ weight (u − measured)² + Σ ((Δu)² + t|∇u|²)/roughness²; `measured` elsewhere.

    `weight`: 1/variance of what is measured, 0 where nothing is; a ring of a few px round the hole takes part with
    its weights, and its values then stay as measured. `roughness`: typical |Δu| per px² of the true u. Pixels that
    are not `usable` are no neighbours. A hole without any neighbour keeps its value.
    """
    ring = cv2.dilate(hole.astype(np.uint8), np.ones((2 * _RING + 1,) * 2, np.uint8)).astype(bool) & usable
    domain = (ring | hole) & usable
    if not (hole & usable).any():
        return measured
    count, labels = regions(domain)
    anchored = np.bincount(labels[domain & (weight > 0)], minlength=count) > 3
    domain &= anchored[labels]
    if not domain.any():
        return measured
    # rows of equations reach one pixel beyond the domain, whose values are given
    start = _start(measured, weight, hole)
    result = measured.copy()
    result[domain] = _solved(start, measured, weight, domain, usable, roughness)
    return np.where(hole & domain, result, measured)


def _start(measured: Grey, weight: Grey, hole: Mask) -> Grey:
    """A first guess: measured values, spread into where there are none by widening averages."""
    known = ~hole | (weight > 0)
    values, guess = np.where(known, measured, 0).astype(np.float64), np.zeros(measured.shape)
    missing = ~known
    # only a start: single precision, and wide blurs at reduced resolution
    share, total = known.astype(np.float32), values.astype(np.float32)
    sigma = 2.0
    while missing.any() and sigma < 2 * max(measured.shape):
        near, spread = blur(share, sigma), blur(total, sigma)
        reached = missing & (near > 0.02)
        guess[reached] = spread[reached] / near[reached]
        missing &= ~reached
        sigma *= 2
    return np.where(known, measured, guess)


def _solved(start: Grey, measured: Grey, weight: Grey, domain: Mask, usable: Mask, roughness: Scalar):
    extended = cv2.dilate(domain.astype(np.uint8), np.ones((3, 3), np.uint8)).astype(bool) & usable
    index = np.full(domain.shape, -1)
    index[extended] = np.arange(int(extended.sum()))
    laplacian, gradient = _operators(index, extended)
    free, given = index[domain], index[extended & ~domain]
    stiff = (laplacian.T @ laplacian + _TENSION * (gradient.T @ gradient)) / float(roughness) ** 2
    stiff = stiff.tocsr()[free]
    strength = weight[domain].astype(np.float64)
    matrix = stiff[:, free] + sp.diags(strength)
    matrix = matrix + 1e-12 * sp.diags(matrix.diagonal())
    right = strength * measured[domain] - stiff[:, given] @ measured[extended & ~domain].astype(np.float64)
    if len(free) <= _DIRECT:
        return spsolve(matrix.tocsc(), right, permc_spec="MMD_AT_PLUS_A")
    scale = sp.diags(1 / matrix.diagonal())
    solution, _ = cg(matrix, right, x0=start[domain].astype(np.float64), rtol=1e-3, maxiter=200, M=scale)
    return solution


def _operators(index: Int[np.ndarray, "height width"], inside: Mask) -> tuple[Any, Any]:
    """Laplacian (at pixels with all four neighbours, else along the axes that have both) and gradient, as matrices."""
    count = int(inside.sum())
    first, second = [], []
    for axis in (0, 1):
        here = index.take(range(index.shape[axis] - 1), axis)
        there = index.take(range(1, index.shape[axis]), axis)
        pair = (here >= 0) & (there >= 0)
        first.append(_rows([(here[pair], -1), (there[pair], 1)], count))
        before, middle, after = (index.take(range(k, index.shape[axis] - 2 + k), axis) for k in range(3))
        triple = (before >= 0) & (middle >= 0) & (after >= 0)
        rows, ones = middle[triple], np.ones(int(triple.sum()))
        columns = [before[triple], rows, after[triple]]
        data = [ones, -2 * ones, ones]
        second.append(
            sp.csr_matrix((np.concatenate(data), (np.tile(rows, 3), np.concatenate(columns))), shape=(count, count))
        )
    return second[0] + second[1], sp.vstack(first).tocsr()


def _rows(terms: list[tuple[np.ndarray, int]], count: int) -> Any:
    size = len(terms[0][0])
    rows = np.tile(np.arange(size), len(terms))
    columns = np.concatenate([column for column, _ in terms])
    data = np.concatenate([np.full(size, float(value)) for _, value in terms])
    return sp.csr_matrix((data, (rows, columns)), shape=(size, count))
