"""Clipped pixels: measured in the channels that are not clipped, else filled smoothly, never below what clipping says.

A clipped value says E ≥ limit, so r ≤ √(ρ/limit), and nothing else. Taken as data it would be a plateau of false range;
left out, a front would have no source where the wall is nearest.
"""

from typing import NamedTuple

import cv2
import numpy as np
import scipy.sparse as sp
from jaxtyping import Bool, Float, Int
from scipy.sparse.linalg import spsolve

from jaxsfs.forms import Scalar
from jaxsfs.specular._local import regions

Grey = Float[np.ndarray, "height width"]
Mask = Bool[np.ndarray, "height width"]

_COLOUR_AGREES = 0.15  # |ln| ratio of two channels against that of the surroundings
_COARSE = 12000  # unknowns of the direct solve
_DARKEST = 0.05  # of the median of what is known: the least that is filled in
_STIFFNESS = 3.0  # of the plate, against data of weight 1 per (reduced) pixel


class Restored(NamedTuple):
    """`values`: weighted linear light; `measured`: pixels whose value comes from channels that are not clipped;
    `filled`: from their surroundings."""

    values: Grey
    measured: Mask
    filled: Mask


def restore_clipped(
    linear: Float[np.ndarray, "height width *channels"],
    unknown: Mask,
    clipped: Bool[np.ndarray, "height width *channels"],
    usable: Mask,
    weights: Float[np.ndarray, "*channels"],
    limit: Scalar,
) -> Restored:
    """Σ w_i linear_i with the `unknown` pixels replaced.

    Where some channels are not clipped and their colour is that of the surroundings, they measure the pixel: the share
    of the weighted sum that they hold is carried over from around. Elsewhere E is a smooth (biharmonic) surface
    through what is known, at least `limit` (the clipped value in linear light) where a channel with a weight is
    clipped.
    """
    grey = linear if linear.ndim == 2 else linear @ weights.astype(linear.dtype)
    grey = grey.astype(np.float64)
    known = usable & ~unknown & (grey > 0)
    unknown = unknown & usable
    measured = np.zeros_like(unknown)
    if not unknown.any() or not known.any():
        return Restored(grey, measured, np.zeros_like(unknown))
    if linear.ndim == 3:
        grey, measured = _by_other_channels(linear, grey, unknown, clipped, known)
    filled = unknown & ~measured
    if filled.any():
        fill = _filled(grey, known | measured, filled, usable)
        held = clipped if clipped.ndim == 2 else (clipped & (np.asarray(weights) > 0)).any(axis=-1)
        least = float(limit) * (1.0 if clipped.ndim == 2 else _clipped_share(clipped, weights))
        grey = np.where(filled, np.maximum(fill, np.where(held, least, 0)), grey)
    return Restored(grey, measured, filled)


def _filled(grey: Grey, known: Mask, hole: Mask, usable: Mask) -> Grey:
    """E in the `hole`, smooth itself where it is known all round and ln E smooth where the hole ends the picture.

    On the limb of a near body ln E is steep, and carried on inwards it makes E too bright by up to a factor; out to
    the rim along a wall that comes near E grows like a power.
    """
    count, labels = regions(hole)
    rim = cv2.dilate((~usable).astype(np.uint8), np.ones((3, 3), np.uint8), borderValue=1).astype(bool)
    enclosed = hole & (np.bincount(labels[rim & hole], minlength=count) == 0)[labels]
    fill = np.zeros_like(grey)
    if enclosed.any():
        least = _DARKEST * float(np.median(grey[known]))
        fill = np.where(enclosed, np.maximum(_smooth_through(grey, known, enclosed), least), fill)
    open_ = hole & ~enclosed
    if open_.any():
        log = _smooth_through(np.log(np.maximum(grey, 1e-6)), known, open_)
        fill = np.where(open_, np.exp(np.where(open_, log, 0)), fill)
    return fill


def _clipped_share(clipped: Bool[np.ndarray, "height width 3"], weights) -> Grey:
    return clipped @ np.asarray(weights, float)


def _by_other_channels(linear, grey: Grey, unknown: Mask, clipped, known: Mask) -> tuple[Grey, Mask]:
    measured = np.zeros_like(unknown)
    patterns = clipped @ np.array([1, 2, 4])
    for pattern in np.unique(patterns[unknown]):
        open_ = [i for i in range(3) if not (int(pattern) >> i) & 1]
        here = unknown & (patterns == pattern)
        if len(open_) == 0:
            continue
        seen = linear[..., open_].sum(axis=-1).astype(np.float64)
        usable = known & (seen > 0)
        share = _spread(np.log(np.maximum(grey, 1e-9)) - np.log(np.maximum(seen, 1e-9)), usable)
        agrees = here & (seen > 0)
        if len(open_) == 2:
            ratio = np.log(np.maximum(linear[..., open_[0]], 1e-9)) - np.log(np.maximum(linear[..., open_[1]], 1e-9))
            agrees &= np.abs(ratio - _spread(ratio.astype(np.float64), usable)) < _COLOUR_AGREES
        grey = np.where(agrees, seen * np.exp(share), grey)
        measured |= agrees
    return grey, measured


def _spread(values: Grey, known: Mask) -> Grey:
    """`values` averaged over the `known` pixels near by, by the narrowest Gaussian that reaches any."""
    share, total = known.astype(np.float64), np.where(known, values, 0.0)
    result, missing = np.zeros_like(values), np.ones_like(known)
    sigma = 4.0
    while missing.any() and sigma < 2 * max(values.shape):
        near, sums = _gaussian(share, sigma), _gaussian(total, sigma)
        reached = missing & (near > 0.02)
        result[reached] = sums[reached] / near[reached]
        missing &= ~reached
        sigma *= 2
    return result


def _gaussian(values: Grey, sigma: float) -> Grey:
    """A wide Gaussian at reduced size, which costs the same at every width."""
    step = max(1, int(sigma / 4))
    if step == 1:
        return cv2.GaussianBlur(values, (0, 0), sigma, borderType=cv2.BORDER_CONSTANT)
    size = (max(2, values.shape[1] // step), max(2, values.shape[0] // step))
    small = cv2.resize(values, size, interpolation=cv2.INTER_AREA)
    small = cv2.GaussianBlur(small, (0, 0), sigma / step, borderType=cv2.BORDER_CONSTANT)
    return cv2.resize(small, values.shape[::-1], interpolation=cv2.INTER_LINEAR)


def _smooth_through(values: Grey, known: Mask, hole: Mask) -> Grey:
    """`values` in the `hole`: a thin plate through a wide ring of what is known, at a size that a direct solve handles;
    its mismatch at the rim is taken back at full size."""
    reach = float(cv2.distanceTransform(hole.astype(np.uint8), cv2.DIST_L2, 5).max())
    near = known & (cv2.distanceTransform((~hole).astype(np.uint8), cv2.DIST_L2, 5) < max(4.0, 0.6 * reach))
    step = max(1, int(np.ceil(np.sqrt((hole.sum() + near.sum()) / _COARSE))))
    size = (-(-values.shape[1] // step), -(-values.shape[0] // step))
    share = _small(near.astype(np.float64), size)
    inside = (share > 0.3) | (_small(hole.astype(np.float64), size) > 0)
    middle = float(np.median(values[near])) if near.any() else 0.0
    mean = _small(np.where(near, values - middle, 0.0), size) / np.maximum(share, 1e-9)
    plate = middle + _thin_plate(mean, np.where(inside, share, 0.0), inside)
    fine = cv2.resize(np.where(inside, plate, _spread(plate, inside)), values.shape[::-1])
    ring = known & (cv2.dilate(hole.astype(np.uint8), np.ones((5, 5), np.uint8)) > 0)
    return fine + _spread(np.where(ring, values - fine, 0.0), ring)


def _small(values: Grey, size: tuple[int, int]) -> Grey:
    return cv2.resize(values, size, interpolation=cv2.INTER_AREA)


def _thin_plate(values: Grey, weight: Grey, inside: Mask) -> Grey:
    """The minimum of Σ weight (u − values)² + s Σ (u_xx² + 2 u_xy² + u_yy²) over the pixels `inside`."""
    index = np.full(inside.shape, -1)
    index[inside] = np.arange(int(inside.sum()))
    matrix = sp.diags(weight[inside] + 1e-10).tocsc()
    for scale, rows in _second_differences(index):
        matrix = matrix + _STIFFNESS * scale * (rows.T @ rows)
    result = np.zeros_like(values)
    result[inside] = spsolve(matrix.tocsc(), weight[inside] * values[inside], permc_spec="MMD_AT_PLUS_A")
    return result


def _second_differences(index: Int[np.ndarray, "height width"]) -> list[tuple[float, sp.csr_matrix]]:
    """u_xx, u_yy (weight 1) and u_xy (weight 2) as matrices over the numbered pixels."""
    across = [(index[:, :-2], 1), (index[:, 1:-1], -2), (index[:, 2:], 1)]
    down = [(index[:-2], 1), (index[1:-1], -2), (index[2:], 1)]
    mixed = [(index[:-1, :-1], 1), (index[1:, 1:], 1), (index[:-1, 1:], -1), (index[1:, :-1], -1)]
    count = int(index.max()) + 1
    return [(1.0, _rows(across, count)), (1.0, _rows(down, count)), (2.0, _rows(mixed, count))]


def _rows(terms: list[tuple[np.ndarray, int]], count: int) -> sp.csr_matrix:
    there = np.logical_and.reduce([column >= 0 for column, _ in terms])
    columns = np.stack([column[there] for column, _ in terms], axis=1)
    rows = np.repeat(np.arange(len(columns)), len(terms))
    data = np.tile(np.array([value for _, value in terms], float), len(columns))
    return sp.csr_matrix((data, (rows, columns.ravel())), shape=(len(columns), count))
