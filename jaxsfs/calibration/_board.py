"""Boards found in a photograph: checkerboard corners and dots, with their target coordinates in pitches."""

from typing import NamedTuple

import cv2
import numpy as np
from jaxtyping import Bool, Float, Int

from jaxsfs.calibration._blobs import blobs
from jaxsfs.calibration._field import Photograph
from jaxsfs.calibration._lattice import grow_lattice
from jaxsfs.calibration._saddles import refined_saddles, smoothing

_NEAR = 1.5  # px between a finder's corner and the refined one


class Board(NamedTuple):
    """Points of one photograph: `pixel` and `place` (column, row) in pitches."""

    pixel: Float[np.ndarray, "count 2"]
    place: Float[np.ndarray, "count 2"]


def find_checkerboard(photo: Photograph, columns: int, rows: int) -> Board | None:
    """Inner corners by OpenCV's two finders, on the picture and, small pictures, on enlarged ones."""
    size = (columns, rows)
    for scale in _scales(photo):
        picture = _eight_bit(photo, scale)
        sector = cv2.CALIB_CB_EXHAUSTIVE | cv2.CALIB_CB_ACCURACY | cv2.CALIB_CB_NORMALIZE_IMAGE
        found, corners = cv2.findChessboardCornersSB(picture, size, flags=sector)
        if not found:
            adaptive = cv2.CALIB_CB_ADAPTIVE_THRESH | cv2.CALIB_CB_NORMALIZE_IMAGE
            found, corners = cv2.findChessboardCorners(picture, size, flags=adaptive)
            if found:
                stop = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_COUNT, 40, 1e-3)
                corners = cv2.cornerSubPix(picture, corners, (5, 5), (-1, -1), stop)
        if found:
            return _upright(_sharpened(photo, _down(corners, scale)), _full_grid(columns, rows))
    return None


def _sharpened(photo: Photograph, corners: Float[np.ndarray, "count 2"]) -> Float[np.ndarray, "count 2"]:
    """OpenCV's corners, which shade and blur pull by tenths of a pixel, refined where that moves them a little."""
    refined = refined_saddles(photo, corners, smoothing(photo))
    near = np.hypot(*(refined - corners).T) < _NEAR
    return np.where(near[:, None], refined, corners)


def find_dots(photo: Photograph, columns: int, rows: int, asymmetric: bool) -> Board | None:
    """Dot centres on a lattice grown from our own dots, which knows the grid up to whole pitches (all that a pose
    needs); where too many of them are missing, by OpenCV's grid finder, which wants to see every dot."""
    board = lattice_of_dots(photo)
    if board is not None:
        # the shortest steps of an asymmetric grid are the diagonals of its pitch
        turned = np.stack([board.place[:, 0] - board.place[:, 1], board.place.sum(axis=1)], axis=1)
        extent = (2 * columns, rows) if asymmetric else (columns, rows)
        board = _smooth(_inside(Board(board.pixel, turned if asymmetric else board.place), extent))
        if 0.7 * columns * rows <= len(board.pixel) <= columns * rows:
            return board
    index = _full_grid(columns, rows)
    if asymmetric:
        index = np.stack([2 * index[:, 0] + index[:, 1] % 2, index[:, 1]], axis=1)
    kind = cv2.CALIB_CB_ASYMMETRIC_GRID if asymmetric else cv2.CALIB_CB_SYMMETRIC_GRID
    for scale in _scales(photo):
        picture = _eight_bit(photo, scale)
        for flags in (kind, kind | cv2.CALIB_CB_CLUSTERING):
            found, centres = cv2.findCirclesGrid(picture, (columns, rows), flags=flags)
            if found:
                seen = _refined(photo, _down(centres, scale))
                return _upright(seen, index)
    return None


def lattice_of_dots(photo: Photograph) -> Board | None:
    """Our own dots on a grown lattice."""
    points = blobs(photo)
    rows, index = grow_lattice(points)
    return Board(points[rows], index.astype(float)) if len(rows) >= 12 else None


def _inside(board: Board, extent: tuple[int, int]) -> Board:
    """The points in the window of `extent` places that holds most of them, turned so that columns are columns: specks
    beside the grid may have joined the lattice, which cannot know which way up the sheet is."""
    lying = Board(board.pixel, np.stack([board.place[:, 1], -board.place[:, 0]], axis=1))
    chosen = [(one, _window(one.place, extent)) for one in (board, lying)]
    best, inside = max(chosen, key=lambda pair: int(pair[1].sum()))
    return Board(best.pixel[inside], best.place[inside])


def _window(place: Float[np.ndarray, "count 2"], extent: tuple[int, int]) -> Bool[np.ndarray, " count"]:
    best = np.zeros(len(place), bool)
    spare = np.maximum(np.ptp(place, axis=0) + 1 - extent, 0).astype(int)
    for shift in np.ndindex(spare[0] + 1, spare[1] + 1):
        away = place - place.min(axis=0) - shift
        inside = ((away >= 0) & (away < extent)).all(axis=1)
        best = inside if inside.sum() > best.sum() else best
    return best


def _smooth(board: Board) -> Board:
    """The points within a quarter of a step of a smooth map from places to pixels (a robust polynomial): what a printed
    grid under any lens is, and a chance lattice of specks is not."""
    if len(board.place) < 12:
        return board
    x, y = (board.place - board.place.mean(axis=0)).T
    degree = 2 + (len(x) >= 40) + (len(x) >= 80) + (len(x) >= 120)
    design = np.stack([x**i * y ** (n - i) for n in range(degree + 1) for i in range(n, -1, -1)], axis=1)
    weight, gap = np.ones(len(x)), np.zeros(len(x))
    step = 1.0
    for _ in range(10):
        found = np.linalg.lstsq(design * weight[:, None], board.pixel * weight[:, None], rcond=None)[0]
        gap, step = np.hypot(*(board.pixel - design @ found).T), float(np.sqrt(np.abs(np.linalg.det(found[1:3]))))
        weight = 1 / (1 + (gap / (0.1 * step)) ** 2)
    near = gap < 0.25 * step
    return Board(board.pixel[near], board.place[near])


def _refined(photo: Photograph, centres: Float[np.ndarray, "count 2"]) -> Float[np.ndarray, "count 2"]:
    """OpenCV's centres replaced by our contrast-weighted ones where there is one within 2 px."""
    points = blobs(photo)
    if not len(points):
        return centres
    gap = np.hypot(*(centres[:, None] - points[None]).transpose(2, 0, 1))
    nearest = gap.argmin(axis=1)
    return np.where((gap.min(axis=1) < 2.0)[:, None], points[nearest], centres)


def _scales(photo: Photograph) -> tuple[float, ...]:
    width = photo.size[0]
    if width < 400:
        return 3.0, 2.0, 1.0
    return (1.0, 2.0) if width < 900 else (1.0, 0.5)


def _eight_bit(photo: Photograph, scale: float) -> np.ndarray:
    top = float(np.percentile(photo.grey, 99.5))
    picture = np.clip(255 * photo.grey / max(top, 0.05), 0, 255).astype(np.uint8)
    if scale == 1:
        return picture
    how = cv2.INTER_CUBIC if scale > 1 else cv2.INTER_AREA
    size = (round(picture.shape[1] * scale), round(picture.shape[0] * scale))
    return cv2.resize(picture, size, interpolation=how)


def _down(points: np.ndarray, scale: float) -> Float[np.ndarray, "count 2"]:
    """Pixels of the scaled picture in those of the photograph: pixel borders, not centres, map to each other."""
    return (np.asarray(points, float).reshape(-1, 2) + 0.5) / scale - 0.5


def _full_grid(columns: int, rows: int) -> Int[np.ndarray, "count 2"]:
    row, column = np.divmod(np.arange(columns * rows), columns)
    return np.stack([column, row], axis=1)


def _upright(pixel: Float[np.ndarray, "count 2"], index: Int[np.ndarray, "count 2"]) -> Board:
    """Turned by 180° if its columns run to the left (poses then need no roll beyond 90°), mirrored if it is seen
    from behind (finders may count from any corner)."""
    design = np.column_stack([index, np.ones(len(index))])
    steps = np.linalg.lstsq(design, pixel, rcond=None)[0][:2]
    centred = index - index.mean(axis=0)
    if np.linalg.det(steps) < 0:
        centred, steps = centred * np.array([1.0, -1.0]), steps * np.array([[1.0], [-1.0]])
    return Board(pixel, centred if steps[0, 0] >= 0 else -centred)
