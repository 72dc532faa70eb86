"""Highlight removal by bilateral filtering (Yang, Wang & Ahuja 2010), written from the paper's description.

σ_max = max/(r + g + b) is largest in the body and falls in a highlight. It is filtered with the bilateral weights of a
guide that highlights do not change, λ_max = max of (σ_c − σ_min)/(1 − 3σ_min), and never allowed to fall, until it
stands still; body = I − (max − σ_max Σ)/(1 − 3σ_max) follows for white light.
"""

import cv2
import numpy as np


def body_image(linear: np.ndarray, valid: np.ndarray, rounds: int = 30) -> np.ndarray:
    """Body part in linear light of (height, width, 3) `linear`; white interface, body chromaticity drifts slowly."""
    total = linear.sum(-1)
    usable = valid & (total > 1e-3)
    chromaticity = linear / np.maximum(total, 1e-9)[..., None]
    largest, smallest = chromaticity.max(-1), chromaticity.min(-1)
    guide = (largest - smallest) / np.maximum(1 - 3 * smallest, 1e-3)
    coloured = usable & (largest - smallest > 0.02)
    if not coloured.any():
        return linear  # grey: nothing to go by
    current = np.where(coloured, largest, 0)
    for _ in range(rounds):
        filtered = _bilateral(current, guide, coloured, 0.06 * min(valid.shape))
        raised = np.where(coloured, np.maximum(current, filtered), current)
        change = np.max(raised - current)
        current = raised
        if change < 0.01:
            break
    excess = (linear.max(-1) - current * total) / np.minimum(1 - 3 * current, -1e-3)
    body = linear - np.where(coloured, np.maximum(excess, 0), 0)[..., None]
    return np.where(valid[..., None], np.maximum(body, 0), linear)


def _bilateral(values: np.ndarray, guide: np.ndarray, known: np.ndarray, sigma: float, levels: int = 24) -> np.ndarray:
    """Joint bilateral filter by slices of the guide: a blur each, interpolated between the two nearest."""
    low, high = np.percentile(guide[known], [1, 99])
    step = max((high - low) / (levels - 1), 1e-3)
    width = max(0.04, step)
    result, weight = np.zeros_like(values), np.zeros_like(values)
    for level in low + step * np.arange(levels):
        near = np.where(known, np.exp(-((guide - level) ** 2) / (2 * width**2)), 0)
        share = cv2.GaussianBlur(near, (0, 0), sigma)
        smooth = cv2.GaussianBlur(near * values, (0, 0), sigma) / np.maximum(share, 1e-9)
        take = np.clip(1 - np.abs(np.clip(guide, low, low + step * (levels - 1)) - level) / step, 0, 1)
        result += take * smooth
        weight += take
    return result / np.maximum(weight, 1e-9)
