"""Highlight removal by the intensity ratio (Shen & Zheng 2013), written from the paper's description.

For pixels of one material lit by white light, max/(max − min) of the body part is one number, and a highlight, which
adds equally to both, raises it. Pixels are grouped by the colours of a specular-free image (each pixel minus its
minimum, plus the mean minimum), each group's ratio is a median, and the excess over ratio · (max − min) is interface.
"""

import numpy as np


def body_image(linear: np.ndarray, valid: np.ndarray, clusters: int = 3) -> np.ndarray:
    """Body part in linear light of (height, width, 3) `linear`; white interface, few materials."""
    pixels = linear[valid]
    least, most = pixels.min(-1), pixels.max(-1)
    span = most - least
    free = pixels - least[:, None] + least.mean()
    chromaticity = np.stack([free.min(-1), free.max(-1)], -1) / free.sum(-1, keepdims=True)
    label = _grouped(chromaticity, clusters)
    excess = np.zeros(len(pixels))
    for group in range(clusters):
        member = (label == group) & (span > 0.02 * most)
        if member.any():
            ratio = np.median((most / np.maximum(span, 1e-9))[member])
            excess[member] = most[member] - ratio * span[member]
    # only pixels whose minimum is above the mean can be highlights
    excess = np.where(least > least.mean(), np.maximum(excess, 0), 0)
    body = linear.copy()
    body[valid] = np.maximum(pixels - excess[:, None], 0)
    return body


def _grouped(points: np.ndarray, clusters: int) -> np.ndarray:
    """k-means from centres at even quantiles: the same answer every time."""
    order = np.argsort(points[:, 1])
    centres = points[order[np.linspace(0, len(points) - 1, 2 * clusters + 1).astype(int)[1::2]]]
    label = np.zeros(len(points), int)
    for _ in range(20):
        label = np.argmin(((points[:, None] - centres) ** 2).sum(-1), axis=1)
        centres = np.stack(
            [points[label == k].mean(0) if (label == k).any() else centres[k] for k in range(len(centres))]
        )
    return label
