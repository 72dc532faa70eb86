"""The bright cells between the dark lines of a printed grid, and which of them are neighbours."""

from heapq import heappop, heappush
from typing import NamedTuple

import cv2
import numpy as np
from jaxtyping import Bool, Float, Int
from scipy import ndimage

from jaxsfs.calibration._blobs import ellipticity
from jaxsfs.calibration._field import Photograph

_LEAST_AREA = 16
_LEAST_ELLIPTICITY = 0.75  # a square has 0.955
_LEAST_DEPTH = 0.12  # of the paper's brightness: shallower dips are shading and noise
_LEAST_BORDER = 0.4  # of a cell's side: diagonal neighbours share less
_STRAIGHT = 0.5  # of a step: how far it may lean
_SEEDS = 8
_MOST_SIDE = 1.3  # times what is typical of the cells beside one


class Cells(NamedTuple):
    """Middles (u, v) in px and the columns and rows of the largest connected lattice of cells; `cover`: share of its
    convex hull that the cells fill (a checkerboard's bright squares fill less than half)."""

    middle: Float[np.ndarray, "count 2"]
    place: Int[np.ndarray, "count 2"]
    cover: float


def find_cells(photo: Photograph) -> Cells:
    """The bright regions that dark lines enclose wholly inside the lit field, on the lattice that they form.

    Neighbours are cells whose borders meet along a line, however unequal a lens makes them. Glare inside a cell does
    no harm; where it hides a line two cells join, and are left out.
    """
    labels, middle, side = _regions(photo)
    near = _single(_neighbours(labels, side), side)
    best: dict[int, tuple[int, int]] = {}
    for seed in sorted(near, key=lambda cell: -side[cell] * (len(near[cell]) == 4))[:_SEEDS]:
        best = max(best, _walk(seed, near, side, middle), key=len)
    found = np.array(list(best), int)
    return Cells(middle[found], np.array(list(best.values()), int).reshape(-1, 2), _cover(labels, found))


def _cover(labels: np.ndarray, found: Int[np.ndarray, " count"]) -> float:
    if not len(found):
        return 0.0
    v, u = np.nonzero(np.isin(labels, found))
    hull = cv2.convexHull(np.stack([u, v], axis=1).astype(np.int32))
    return len(u) / max(cv2.contourArea(hull), 1.0)


def _regions(photo: Photograph) -> tuple[np.ndarray, Float[np.ndarray, "n 2"], Float[np.ndarray, " n"]]:
    """Labels of the whole cells (0: none), their middles and the square roots of their areas."""
    bright = np.logical_and(photo.field, np.logical_not(_dark_lines(photo)))
    bright = cv2.morphologyEx(bright.astype(np.uint8), cv2.MORPH_OPEN, np.ones((3, 3), np.uint8))
    _, labels, stats, middle = cv2.connectedComponentsWithStats(bright, connectivity=4)
    outside = ndimage.binary_dilation(np.logical_not(photo.field), iterations=2, border_value=1)
    whole = (stats[:, 4] >= _LEAST_AREA) & (stats[:, 2:4].min(axis=1) >= 3)
    touched = np.unique(np.asarray(labels)[np.asarray(outside, bool)]).astype(int)
    whole[touched] = whole[0] = False
    for label in np.nonzero(whole)[0].tolist():
        left, top, width, height, _ = stats[label]
        region = labels[top : top + height, left : left + width] == label
        whole[label] = ellipticity(region) > _LEAST_ELLIPTICITY
    return np.where(whole[labels], labels, 0), middle, np.sqrt(stats[:, 4])


def _dark_lines(photo: Photograph) -> Bool[np.ndarray, "height width"]:
    """Darker than the paper about (the closing, which fills lines narrower than its kernel) by a third of what the
    darkest places near are."""
    size = max(15, photo.size[0] // 16) | 1
    kernel = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (size, size))
    smooth = cv2.GaussianBlur(photo.linear.astype(np.float32), (0, 0), 1.0)
    paper = cv2.morphologyEx(smooth, cv2.MORPH_CLOSE, kernel)
    depth = 1 - smooth / np.maximum(paper, 0.003)
    about = cv2.GaussianBlur(cv2.dilate(cv2.GaussianBlur(depth, (0, 0), 1.0), kernel), (0, 0), size / 4)
    return depth > np.maximum(0.35 * about, _LEAST_DEPTH)


def _neighbours(labels: np.ndarray, side: Float[np.ndarray, " n"]) -> dict[int, list[int]]:
    """Cells that meet along a line when all grow until they touch."""
    gap, nearest = ndimage.distance_transform_edt(labels == 0, return_indices=True)  # pyright: ignore
    v, u = np.asarray(nearest)
    grown = np.where(gap < 0.5 * side[labels[v, u]], labels[v, u], 0)
    meet = [np.stack([grown[:, :-1].ravel(), grown[:, 1:].ravel()]), np.stack([grown[:-1].ravel(), grown[1:].ravel()])]
    pairs = np.sort(np.concatenate(meet, axis=1), axis=0)
    pairs = pairs[:, (pairs[0] > 0) & (pairs[0] != pairs[1])]
    near: dict[int, list[int]] = {}
    for (a, b), length in zip(*_counted(pairs), strict=True):
        if length > _LEAST_BORDER * min(side[a], side[b]):
            near.setdefault(int(a), []).append(int(b))
            near.setdefault(int(b), []).append(int(a))
    return near


def _single(near: dict[int, list[int]], side: Float[np.ndarray, " n"]) -> dict[int, list[int]]:
    """Without the cells that are much larger than those round them: two or four that glare has joined, through which
    rows would be miscounted."""
    alone = {cell for cell, others in near.items() if side[cell] < _MOST_SIDE * np.median(side[others])}
    return {cell: [other for other in near[cell] if other in alone] for cell in near if cell in alone}


def _counted(pairs: Int[np.ndarray, "2 count"]) -> tuple[np.ndarray, np.ndarray]:
    found, length = np.unique(pairs.T, axis=0, return_counts=True)
    return found, length


def _walk(seed: int, near: dict[int, list[int]], side, middle) -> dict[int, tuple[int, int]]:
    """Column and row of every cell reached from `seed`, cells with four neighbours and large ones first; each step is
    read in the frame of the step before it."""
    basis = _basis(seed, near, middle)
    if basis is None:
        return {}
    index, frames, taken = {seed: (0, 0)}, {seed: basis}, {(0, 0)}
    queue = [(0, 0.0, seed)]
    while queue:
        cell = heappop(queue)[2]
        for other in near[cell]:
            step = middle[other] - middle[cell]
            along = np.linalg.solve(frames[cell].T, step)
            axis = int(np.abs(along[1]) > np.abs(along[0]))
            straight = abs(along[1 - axis]) < _STRAIGHT * abs(along[axis]) and 0.35 < abs(along[axis]) < 1.9
            if other in index or not straight:
                continue
            sign = 1 if along[axis] > 0 else -1
            column, row = index[cell]
            place = (column + sign, row) if axis == 0 else (column, row + sign)
            if place in taken:
                continue
            frames[other] = frames[cell].copy()
            frames[other][axis] = sign * step
            index[other] = place
            taken.add(place)
            heappush(queue, (abs(len(near[other]) - 4), -float(side[other]), other))
    return index


def _basis(seed: int, near: dict[int, list[int]], middle) -> Float[np.ndarray, "2 2"] | None:
    """Two steps from the seed to neighbours, the more horizontal first, as rows."""
    steps = np.array([middle[other] - middle[seed] for other in near[seed]])
    if len(steps) < 2:
        return None
    first = steps[np.argmax(np.abs(steps[:, 0]) - np.abs(steps[:, 1]))]
    sine = (first[0] * steps[:, 1] - first[1] * steps[:, 0]) / np.hypot(*first) / np.hypot(*steps.T)
    second = steps[np.argmax(np.abs(sine))]
    if np.abs(sine).max() < 0.5:
        return None
    return np.stack([first * np.sign(first[0] or 1.0), second * np.sign(second[1] or 1.0)])
