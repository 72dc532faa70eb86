"""Dots and their sub-pixel centres."""

import cv2
import numpy as np
from jaxtyping import Bool, Float

from jaxsfs.calibration._field import Photograph

_SPECK = 0.06  # of the typical area: smaller spots are grain
_SPOT, _BLURRED, _AROUND = 3, 4, 9  # px beyond a spot: what is weighed, and where its paper begins and ends
_LEAST_PAPER = 20  # px, for a plane
_LEAST_INK = 6  # px


def blobs(photo: Photograph, least_area: int = 12) -> Float[np.ndarray, "count 2"]:
    """Centres (u, v) of compact dark spots wholly inside the usable field.

    A spot is a connected region beyond half the local contrast, of elliptic shape; its centre is that of the ink,
    by the paper about it.
    """
    return blobs_and_areas(photo, least_area)[0]


def blobs_and_areas(
    photo: Photograph, least_area: int = 12
) -> tuple[Float[np.ndarray, "count 2"], Float[np.ndarray, " count"]]:
    """The centres of `blobs` and their areas in px²."""
    inside = np.logical_and(_contrast(photo) > 0.5, photo.field)
    count, labels, stats, _ = cv2.connectedComponentsWithStats(inside.astype(np.uint8), connectivity=4)
    largest = 0.02 * photo.grey.size
    centres, areas = [], []
    for label in range(1, count):
        left, top, width, height, area = stats[label]
        if not least_area <= area <= largest or min(width, height) < 3:
            continue
        window = (
            slice(max(top - _AROUND, 0), min(top + height + _AROUND, labels.shape[0])),
            slice(max(left - _AROUND, 0), min(left + width + _AROUND, labels.shape[1])),
        )
        region = labels[window] == label
        others = (labels[window] > 0) & ~region
        usable = photo.usable[window]
        if not usable[_grown(region, 2)].all() or (_grown(region, 2) & others).any():
            continue
        if ellipticity(region) < 0.82:
            continue
        paper = usable & ~_grown(region, _BLURRED) & ~_grown(others, _BLURRED)
        u, v = _centroid(photo.linear[window], region, paper)
        centres.append((u + window[1].start, v + window[0].start))
        areas.append(area)
    found, size = np.array(centres, float).reshape(-1, 2), np.array(areas, float)
    kept = size > _SPECK * _typical_area(size)
    return found[kept], size[kept]


def _grown(region: Bool[np.ndarray, "height width"], by: int) -> Bool[np.ndarray, "height width"]:
    return cv2.dilate(region.astype(np.uint8), np.ones((2 * by + 1, 2 * by + 1), np.uint8)) > 0


def _centroid(
    light: Float[np.ndarray, "height width"],
    region: Bool[np.ndarray, "height width"],
    paper: Bool[np.ndarray, "height width"],
) -> Float[np.ndarray, "2"]:
    """Middle (u, v) of a spot of even ink in light L = a + b·x, the plane through the `paper`.

    Blur moves no centroid: that of L − light is the centroid of L over the spot, which lies C b/L from the spot's
    middle, C its second moments. The spot's extent is where half of the light is taken.
    """
    v, u = np.mgrid[: light.shape[0], : light.shape[1]]
    design = np.stack([np.ones(light.shape), u, v], axis=-1)
    plane = np.array([np.max(light[region]), 0.0, 0.0])
    if paper.sum() >= _LEAST_PAPER:
        plane = np.linalg.lstsq(design[paper], light[paper], rcond=None)[0]
    even = np.maximum(design @ plane, 1e-6)
    share = 1 - light / even
    half = _grown(region, 2) & (share > 0.5 * np.percentile(share[region], 80))
    taken = np.where(_grown(half, _SPOT), even - light, 0.0)
    if half.sum() < _LEAST_INK or np.sum(taken) < 0.5 * np.sum(taken[half]):
        return np.array([u[region].mean(), v[region].mean()])  # no spot on paper: the lattice will tell
    centroid = np.array([np.sum(taken * u), np.sum(taken * v)]) / np.sum(taken)
    level = max(float(plane[0] + plane[1:] @ centroid), 1e-6)
    return centroid - np.cov(np.stack([u[half], v[half]])) @ plane[1:] / level


def _typical_area(areas: Float[np.ndarray, " count"]) -> float:
    """The area at which half of the spots' total area lies in larger ones: dots count, grain does not."""
    ordered = np.sort(areas)
    return float(ordered[np.searchsorted(np.cumsum(ordered), ordered.sum() / 2)]) if len(areas) else 0.0


def _contrast(photo: Photograph) -> Float[np.ndarray, "height width"]:
    """Darkness between the local paper (0) and the local ink (1)."""
    size = max(15, photo.size[0] // 12) | 1
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (size, size))
    linear = photo.linear.astype(np.float32)
    smooth = cv2.GaussianBlur(linear, (0, 0), 0.8)
    filled = np.where(photo.field, smooth, np.median(smooth[photo.field])).astype(np.float32)
    paper = cv2.GaussianBlur(cv2.dilate(filled, kernel), (0, 0), size / 4)
    ink = cv2.GaussianBlur(cv2.erode(filled, kernel), (0, 0), size / 4)
    depth = np.maximum(paper - ink, 0.15 * paper + 0.01)
    return ((paper - smooth) / depth).astype(float)


def ellipticity(region: np.ndarray) -> float:
    """Area over that of the ellipse with the region's second moments: 1 for an ellipse, 0.955 for a rectangle."""
    v, u = np.nonzero(region)
    spread = np.cov(np.stack([u, v])) + np.eye(2) / 12
    return len(u) / (4 * np.pi * np.sqrt(max(np.linalg.det(spread), 1e-12)))
