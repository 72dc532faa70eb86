"""Points on straight printed lines, found without knowing their number: line grids, dot grids, checkerboards."""

from typing import NamedTuple

import cv2
import numpy as np
from jaxtyping import Bool, Float, Int
from scipy import ndimage

from jaxsfs.calibration._blobs import blobs
from jaxsfs.calibration._field import Photograph
from jaxsfs.calibration._lattice import grow_lattice

LEAST_POINTS = 5  # of a line
_SAMPLES = 41


class LinePoints(NamedTuple):
    """`pixel` and index of the `line` of every point; `source`: "dots", "line grid" or "checkerboard"."""

    pixel: Float[np.ndarray, "count 2"]
    line: Int[np.ndarray, " count"]
    source: str


def find_lines(photo: Photograph) -> LinePoints | None:
    """The straight lines of whichever pattern gives the largest lattice; None if no line has enough points."""
    dots, cells, saddles = blobs(photo), blobs(photo, dark=False), saddle_points(photo)
    lattices = {
        "dots": (dots, *grow_lattice(dots)),
        "line grid": (cells, *grow_lattice(cells)),
        "checkerboard": (saddles, *grow_lattice(saddles)),
    }
    source = max(lattices, key=lambda name: _smooth_runs(*lattices[name]))
    points, rows, index = lattices[source]
    if len(rows) < 12:
        return None
    if source == "line grid":
        pixel, line = _between_cells(photo, points[rows], index)
    else:
        pixel = np.concatenate([points[rows], points[rows]])
        line = np.concatenate([index[:, 0], 1000 + index[:, 1]])
    return _long_enough(pixel, line, source)


def _smooth_runs(points: Float[np.ndarray, "count 2"], rows, index) -> int:
    """Number of four neighbours in a row whose third difference is below 6 % of their step: what a printed lattice has
    and a chance one has not."""
    at = {tuple(key): points[row] for row, key in zip(rows, index, strict=True)}
    count = 0
    for i, j in at:
        for di, dj in ((1, 0), (0, 1)):
            four = [at[key] for n in range(4) if (key := (i + n * di, j + n * dj)) in at]
            if len(four) == 4:
                a, b, c, d = four
                count += int(np.hypot(*(d - 3 * c + 3 * b - a)) < 0.06 * np.hypot(*(c - b)))
    return count


def _long_enough(pixel, line, source: str) -> LinePoints | None:
    """The points of smooth lines: those within 4 robust sd of a polynomial along the line's chord; lines that are
    rough (sd above 0.6 px) or of which 30 % does not fit are left out."""
    kept_pixel, kept_line = [], []
    for name in np.unique(line):
        points = pixel[line == name]
        if len(points) < LEAST_POINTS:
            continue
        near = _near_curve(points)
        if near.sum() >= LEAST_POINTS and near.mean() > 0.7:
            kept_pixel.append(points[near])
            kept_line.append(np.full(int(near.sum()), len(kept_line)))
    if len(kept_line) < 2:
        return None
    return LinePoints(np.concatenate(kept_pixel), np.concatenate(kept_line), source)


def _near_curve(points: Float[np.ndarray, "count 2"]) -> Bool[np.ndarray, " count"]:
    centred = points - points.mean(axis=0)
    chord = np.linalg.svd(centred, full_matrices=False)[2][0]
    along, across = centred @ chord, centred @ np.array([-chord[1], chord[0]])
    terms = 6 if len(points) >= 14 else min(4, len(points) - 2)
    design = np.vander(along / max(np.abs(along).max(), 1e-9), terms)
    weight = np.ones(len(points))
    gap = np.zeros(len(points))
    for _ in range(12):
        gap = across - design @ np.linalg.lstsq(design * weight[:, None], across * weight, rcond=None)[0]
        scale = max(1.4826 * float(np.median(np.abs(gap))), 0.1)
        weight = 1 / (1 + (gap / (2 * scale)) ** 2)
    scale = max(1.4826 * float(np.median(np.abs(gap))), 0.1)
    return (np.abs(gap) < 4 * scale) & (scale < 0.6)


def saddle_points(photo: Photograph) -> Float[np.ndarray, "count 2"]:
    """Corners where four squares meet: strong minima of the Hessian's determinant, refined by OpenCV."""
    grey = (photo.grey / max(float(np.percentile(photo.grey, 99.5)), 0.05)).astype(np.float32)
    sigma = max(1.5, photo.size[0] / 400)
    smooth = ndimage.gaussian_filter(grey, sigma)
    fall, run = np.gradient(smooth)
    (yy, xy), xx = np.gradient(fall), np.gradient(run, axis=1)
    saddle = np.maximum(xy**2 - xx * yy, 0) * photo.usable
    score = saddle / (ndimage.gaussian_filter(grey, 6 * sigma) + 0.05) ** 2
    peak = (score == ndimage.maximum_filter(score, int(4 * sigma) | 1)) & (saddle > 0)
    if peak.sum() < 12:
        return np.zeros((0, 2))
    strong = peak & (score > 0.15 * np.median(np.sort(score[peak])[-40:]))
    v, u = np.nonzero(strong)
    corners = np.ascontiguousarray(np.stack([u, v], axis=1), np.float32)
    stop = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 40, 1e-3)
    window = (max(3, int(1.5 * sigma)),) * 2
    picture = (255 * np.clip(grey, 0, 1)).astype(np.uint8)
    refined = cv2.cornerSubPix(picture, corners[:, None].copy(), window, (-1, -1), stop)[:, 0]
    near = np.hypot(*(refined - corners).T) < 3 * sigma
    return refined[near].astype(float)


def _between_cells(photo: Photograph, cells: Float[np.ndarray, "count 2"], index: Int[np.ndarray, "count 2"]):
    """Middles of the dark lines between neighbouring cells: three profiles from each cell to the next, shifted
    along the line by a quarter of a cell."""
    at = {tuple(key): row for row, key in enumerate(index)}
    starts, ends, lines = [], [], []
    for axis in (0, 1):
        for (i, j), row in at.items():
            other = at.get((i + 1, j) if axis == 0 else (i, j + 1))
            if other is None:
                continue
            across = [at.get((i, j + s) if axis == 0 else (i + s, j)) for s in (-1, 1)]
            shifts = [cells[n] - cells[row] for n in across if n is not None]
            for fraction in (0.0, 0.28):
                for shift in shifts[:1] if fraction == 0 else shifts:
                    starts.append(cells[row] + fraction * shift)
                    ends.append(cells[other] + fraction * shift)
                    lines.append(i + 1000 * axis if axis == 0 else 1000 + j)
    if not starts:
        return np.zeros((0, 2)), np.zeros(0, int)
    middle, good = _line_middles(photo, np.array(starts), np.array(ends))
    return middle[good], np.array(lines)[good]


def _line_middles(photo: Photograph, start: Float[np.ndarray, "n 2"], end: Float[np.ndarray, "n 2"]):
    """Middle between the two half-depth crossings of the dark line between `start` and `end`."""
    along = np.linspace(0, 1, _SAMPLES)
    points = start[:, None] + along[None, :, None] * (end - start)[:, None]
    grid = points.astype(np.float32)
    linear = photo.linear.astype(np.float32)
    profile = cv2.remap(linear, grid[..., 0], grid[..., 1], cv2.INTER_CUBIC).astype(float)
    usable = cv2.remap(photo.usable.astype(np.uint8), grid[..., 0], grid[..., 1], cv2.INTER_NEAREST).all(axis=1)
    profile = ndimage.gaussian_filter1d(profile, 1.0, axis=1)
    paper = np.percentile(profile, 80, axis=1)
    depth = 1 - profile / np.maximum(paper, 0.01)[:, None]
    deepest = depth[:, 5:-5].argmax(axis=1) + 5
    level = 0.5 * depth[np.arange(len(depth)), deepest]
    left, right = np.zeros(len(depth)), np.zeros(len(depth))
    good = usable & (level > 0.12)
    for row in np.nonzero(good)[0]:
        below = depth[row] < level[row]
        before, after = np.nonzero(below[: deepest[row]])[0], np.nonzero(below[deepest[row] :])[0]
        if not len(before) or not len(after):
            good[row] = False
            continue
        left[row] = _cross(depth[row], int(before[-1]), int(before[-1]) + 1, level[row])
        right[row] = _cross(depth[row], int(deepest[row] + after[0]), int(deepest[row] + after[0]) - 1, level[row])
    middle = 0.5 * (left + right) / (_SAMPLES - 1)
    return start + middle[:, None] * (end - start), good & (right - left < 0.6 * _SAMPLES)


def _cross(depth: np.ndarray, low: int, high: int, level: float) -> float:
    return low + (high - low) * (level - depth[low]) / (depth[high] - depth[low])
