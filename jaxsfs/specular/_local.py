"""Local statistics of a picture: blurs among chosen pixels, slowly varying ratios, noise by brightness."""

import cv2
import numpy as np
from jaxtyping import Bool, Float, Int

from jaxsfs.forms import Scalar

Grey = Float[np.ndarray, "height width"]
Mask = Bool[np.ndarray, "height width"]

_LARGEST_SIGMA = 4.0  # px; wider blurs are made on a picture reduced until the sigma is this
_SCALES = 4  # octaves from the widest neighbourhood to the asked one
_TRUST = 0.02  # share of a neighbourhood that must be data before it is believed over the wider one
_BINS = 12


def blur(values: Grey, sigma: Scalar) -> Grey:
    """Gaussian blur of any width in constant time per pixel: wide ones on a reduced picture."""
    reduction = max(1, int(float(sigma) / _LARGEST_SIGMA))
    if reduction == 1:
        return cv2.GaussianBlur(values, (0, 0), float(sigma), borderType=cv2.BORDER_REFLECT)
    height, width = values.shape
    size = (max(2, -(-width // reduction)), max(2, -(-height // reduction)))
    small = cv2.resize(values, size, interpolation=cv2.INTER_AREA)
    small = cv2.GaussianBlur(small, (0, 0), float(sigma) / reduction, borderType=cv2.BORDER_REFLECT)
    return cv2.resize(small, (width, height), interpolation=cv2.INTER_LINEAR)


def blur_among(values: Grey, chosen: Mask, sigma: Scalar) -> Grey:
    """Gaussian blur among the chosen pixels alone; 0 elsewhere."""
    weight = blur(chosen.astype(values.dtype), sigma)
    spread = blur(np.where(chosen, values, 0).astype(values.dtype), sigma)
    return np.where(chosen, spread / np.maximum(weight, 1e-6), 0)


def local_ratio(numerator: Grey, denominator: Grey, chosen: Mask, sigma: Scalar) -> Grey:
    """Σ numerator / Σ denominator over the chosen pixels of a Gaussian neighbourhood, at every pixel.

    Where few pixels near by are chosen the ratio of a wider neighbourhood takes over. Sums are divided, not ratios
    averaged: noise of mean 0 leaves no bias.
    """
    above = np.where(chosen, numerator, 0).astype(numerator.dtype)
    below = np.where(chosen, denominator, 0).astype(numerator.dtype)
    total = float(below.sum())
    ratio = np.full_like(above, float(above.sum()) / total if total > 0 else 0.0)
    share = _TRUST * total / max(int(chosen.sum()), 1)
    for octave in reversed(range(_SCALES)):
        width = float(sigma) * 2**octave
        ratio = (blur(above, width) + share * ratio) / np.maximum(blur(below, width) + share, 1e-12)
    return ratio


def noise_by_level(values: Grey, level: Grey, chosen: Mask) -> Grey:
    """Standard deviation of the white noise of `values` as a function of `level`, at every pixel.

    The median absolute Laplacian in bins of equal count, 1.4826 MAD/√20, so edges and highlights do not count.
    """
    inner = cv2.erode(chosen.astype(np.uint8), np.ones((3, 3), np.uint8), borderValue=0).astype(bool)
    if inner.sum() < 100:
        return np.zeros_like(values)
    rough = np.abs(cv2.Laplacian(values, -1)[inner]) * (1.4826 / np.sqrt(20))
    levels = level[inner]
    edges = np.unique(np.quantile(levels[:: max(1, len(levels) // 20000)], np.linspace(0, 1, _BINS + 1)))
    if len(edges) < 3:
        return np.full_like(values, np.median(rough))
    which = np.clip(np.searchsorted(edges, levels, side="right") - 1, 0, len(edges) - 2)
    medians = [float(np.median(rough[which == b])) if (which == b).any() else np.nan for b in range(len(edges) - 1)]
    centres, medians = 0.5 * (edges[1:] + edges[:-1]), np.array(medians)
    known = np.isfinite(medians)
    return np.interp(level, centres[known], medians[known]).astype(values.dtype)


def regions(mask: Mask) -> tuple[int, Int[np.ndarray, "height width"]]:
    """Number of labels and the label of every pixel: 0 outside the mask, one for each 8-connected region."""
    count, labels = cv2.connectedComponents(mask.astype(np.uint8), connectivity=8)
    return count, np.asarray(labels, np.int32)


def spread_from(values: Grey, known: Mask) -> Grey:
    """`values` averaged over the `known` pixels near by, by the narrowest Gaussian that reaches any."""
    share, total = known.astype(np.float32), np.where(known, values, 0).astype(np.float32)
    result, missing = np.zeros(values.shape), np.ones_like(known)
    sigma = 2.0
    while missing.any() and sigma < 2 * max(values.shape):
        near, sums = blur(share, sigma), blur(total, sigma)
        reached = missing & (near > 0.02)
        result[reached] = sums[reached] / near[reached]
        missing &= ~reached
        sigma *= 2
    return result


def spread(values: Float[np.ndarray, "_"]) -> float:
    """σ of `values` by 1.4826 times the median absolute deviation."""
    return 1.4826 * float(np.median(np.abs(values - np.median(values))))
