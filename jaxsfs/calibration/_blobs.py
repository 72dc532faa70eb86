"""Dots and their sub-pixel centres."""

import cv2
import numpy as np
from jaxtyping import Float

from jaxsfs.calibration._field import Photograph

_SPECK = 0.06  # of the typical area: smaller spots are grain


def blobs(photo: Photograph, least_area: int = 12) -> Float[np.ndarray, "count 2"]:
    """Centres (u, v) of compact dark spots wholly inside the usable field.

    A spot is a connected region beyond half the local contrast, of elliptic shape; its centre is the centroid weighted
    by contrast, over the region grown by 2 px.
    """
    return blobs_and_areas(photo, least_area)[0]


def blobs_and_areas(
    photo: Photograph, least_area: int = 12
) -> tuple[Float[np.ndarray, "count 2"], Float[np.ndarray, " count"]]:
    """The centres of `blobs` and their areas in px²."""
    contrast, weight = _contrast(photo)
    inside = np.logical_and(contrast > 0.5, photo.field)
    count, labels, stats, _ = cv2.connectedComponentsWithStats(inside.astype(np.uint8), connectivity=4)
    largest = 0.02 * photo.grey.size
    centres, areas = [], []
    for label in range(1, count):
        left, top, width, height, area = stats[label]
        if not least_area <= area <= largest or min(width, height) < 3:
            continue
        window = (
            slice(max(top - 3, 0), min(top + height + 3, labels.shape[0])),
            slice(max(left - 3, 0), min(left + width + 3, labels.shape[1])),
        )
        region = labels[window] == label
        grown = cv2.dilate(region.astype(np.uint8), np.ones((5, 5), np.uint8)) > 0
        others = (labels[window] > 0) & ~region
        if not photo.usable[window][grown].all() or (grown & others).any():
            continue
        if ellipticity(region) < 0.82:
            continue
        v, u = np.nonzero(grown)
        w = np.clip(weight[window][grown], 0, None)
        centres.append((np.sum(w * u) / w.sum() + window[1].start, np.sum(w * v) / w.sum() + window[0].start))
        areas.append(area)
    found, size = np.array(centres, float).reshape(-1, 2), np.array(areas, float)
    kept = size > _SPECK * _typical_area(size)
    return found[kept], size[kept]


def _typical_area(areas: Float[np.ndarray, " count"]) -> float:
    """The area at which half of the spots' total area lies in larger ones: dots count, grain does not."""
    ordered = np.sort(areas)
    return float(ordered[np.searchsorted(np.cumsum(ordered), ordered.sum() / 2)]) if len(areas) else 0.0


def _contrast(photo: Photograph) -> tuple[np.ndarray, np.ndarray]:
    """Darkness between the local paper (0) and the local ink (1), and its unsmoothed self for weights."""
    size = max(15, photo.size[0] // 12) | 1
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (size, size))
    linear = photo.linear.astype(np.float32)
    smooth = cv2.GaussianBlur(linear, (0, 0), 0.8)
    filled = np.where(photo.field, smooth, np.median(smooth[photo.field])).astype(np.float32)
    most = cv2.dilate(filled, kernel)
    paper = cv2.GaussianBlur(most, (0, 0), size / 4)
    ink = cv2.GaussianBlur(cv2.erode(filled, kernel), (0, 0), size / 4)
    depth = np.maximum(paper - ink, 0.15 * paper + 0.01)
    # the closing follows the paper where light falls off; the mere maximum is too bright on the side away from it
    even = cv2.GaussianBlur(cv2.erode(most, kernel), (0, 0), size / 12)
    return (paper - smooth) / depth, (even - linear) / depth


def ellipticity(region: np.ndarray) -> float:
    """Area over that of the ellipse with the region's second moments: 1 for an ellipse, 0.955 for a rectangle."""
    v, u = np.nonzero(region)
    spread = np.cov(np.stack([u, v])) + np.eye(2) / 12
    return len(u) / (4 * np.pi * np.sqrt(max(np.linalg.det(spread), 1e-12)))
