"""Points on straight printed lines, found without knowing their number: line grids, dot grids, checkerboards."""

from typing import NamedTuple

import cv2
import numpy as np
from jaxtyping import Bool, Float, Int

from jaxsfs.calibration._blobs import blobs
from jaxsfs.calibration._cells import Cells, find_cells
from jaxsfs.calibration._field import Photograph
from jaxsfs.calibration._lattice import grow_lattice
from jaxsfs.calibration._line_edges import SAMPLES, depth_of, half_depth
from jaxsfs.calibration._saddles import saddle_points

LEAST_POINTS = 5  # of a line
_LEAST_CELLS = 9
_LEAST_COVER = 0.54
_MANY = 3  # cells for each good run of corners


class LinePoints(NamedTuple):
    """`pixel` and index of the `line` of every point; `source`: "dots", "line grid" or "checkerboard"; `axis` (0 or 1)
    and `place` of every line in the grid; `bend`, px by which blur was found to move every point, and taken back."""

    pixel: Float[np.ndarray, "count 2"]
    line: Int[np.ndarray, " count"]
    source: str
    axis: Int[np.ndarray, " lines"]
    place: Int[np.ndarray, " lines"]
    bend: Float[np.ndarray, "count 2"]


def find_lines(photo: Photograph) -> LinePoints | None:
    """The straight lines of whichever pattern gives the largest lattice; None if no line has enough points."""
    cells, dots = find_cells(photo), blobs(photo)
    grown = grow_lattice(dots)
    saddles = saddle_points(photo)
    lattices = {"dots": (dots, *grown), "checkerboard": (saddles, *grow_lattice(saddles))}
    least = max(_LEAST_CELLS, _smooth_runs(*lattices["dots"]))
    # a checkerboard's bright squares are cells too, but fill less, and its corners are as many
    filled = cells.cover > _LEAST_COVER or len(cells.middle) > _MANY * _smooth_runs(*lattices["checkerboard"])
    if len(cells.middle) >= least and filled:
        return _long_enough(*_between_cells(photo, cells), "line grid")
    source = max(lattices, key=lambda name: _smooth_runs(*lattices[name]))
    points, rows, index = lattices[source]
    if len(rows) < 12:
        return None
    pixel = np.concatenate([points[rows], points[rows]])
    axis = np.repeat([0, 1], len(rows))
    return _long_enough(pixel, np.stack([axis, index.T.ravel()], axis=1), source)


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


def _long_enough(pixel, name: Int[np.ndarray, "count 2"], source: str) -> LinePoints | None:
    """The points of smooth lines (`name`: axis and place): those within 4 robust sd of a polynomial along the line's
    chord; lines that are rough (sd above 0.6 px) or of which 30 % does not fit are left out."""
    kept_pixel, kept_line, names = [], [], []
    for one in np.unique(name, axis=0):
        points = pixel[(name == one).all(axis=1)]
        if len(points) < LEAST_POINTS:
            continue
        near = _near_curve(points)
        if near.sum() >= LEAST_POINTS and near.mean() > 0.7:
            kept_pixel.append(points[near])
            kept_line.append(np.full(int(near.sum()), len(kept_line)))
            names.append(one)
    if len(kept_line) < 2:
        return None
    axis, place = np.array(names).T
    middle = np.concatenate(kept_pixel)
    return LinePoints(middle, np.concatenate(kept_line), source, axis, place, np.zeros_like(middle))


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


def _between_cells(photo: Photograph, cells: Cells) -> tuple[np.ndarray, np.ndarray]:
    """Middles of the dark lines between neighbouring cells, and (axis, place) of each: three profiles from each cell
    to the next, shifted along the line by a quarter of a cell."""
    middle, at = cells.middle, {tuple(key): row for row, key in enumerate(cells.place.tolist())}
    starts, ends, names = [], [], []
    for axis, (right, down) in enumerate([(1, 0), (0, 1)]):
        for (i, j), row in at.items():
            other = at.get((i + right, j + down))
            if other is None:
                continue
            across = [at.get((i + s * down, j + s * right)) for s in (-1, 1)]
            shifts = [0.28 * (middle[n] - middle[row]) for n in across if n is not None]
            for shift in [np.zeros(2), *shifts]:
                starts.append(middle[row] + shift)
                ends.append(middle[other] + shift)
                names.append((axis, (i, j)[axis]))
    if not starts:
        return np.zeros((0, 2)), np.zeros((0, 2), int)
    found, good = _line_middles(photo, np.array(starts), np.array(ends))
    return found[good], np.array(names)[good]


def _line_middles(photo: Photograph, start: Float[np.ndarray, "n 2"], end: Float[np.ndarray, "n 2"]):
    """Middle between the two half-depth crossings of the dark line between `start` and `end`, both on paper."""
    along = np.linspace(0, 1, SAMPLES)
    grid = (start[:, None] + along[None, :, None] * (end - start)[:, None]).astype(np.float32)
    profile = cv2.remap(photo.linear.astype(np.float32), grid[..., 0], grid[..., 1], cv2.INTER_CUBIC).astype(float)
    usable = cv2.remap(photo.usable.astype(np.uint8), grid[..., 0], grid[..., 1], cv2.INTER_NEAREST).all(axis=1)
    left, right, peak, good = half_depth(depth_of(profile))
    middle = 0.25 * (left + right) + 0.5
    return start + middle[:, None] * (end - start), good & usable & (peak > 0.2) & (right - left < 1.2)
