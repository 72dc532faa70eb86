"""Contours of equal range over the photograph: where the paper's front stands at equal steps of its time."""

import dataclasses

import cv2
import numpy as np
from jaxtyping import Bool, Float, UInt8
from skimage.measure import find_contours

from jaxsfs.report._panels import jpeg, panel, shrunk, stride
from jaxsfs.report._scale import Scale, ends, round_step

_LINES = 15
_LARGEST = 480  # px: the map is thinned to that for the contours
_SMALLEST = 12  # px of the thinned map: shorter contours are noise
_TOLERANCE = 0.25  # px: how far a drawn line may leave the contour
_LABEL = 0.035  # of the long side

Map = Float[np.ndarray, "height width"]
Line = Float[np.ndarray, "_ 2"]


def fronts_panel(
    rgb: UInt8[np.ndarray, "height width 3"],
    distance: Float[np.ndarray, "height width"],
    valid: Bool[np.ndarray, "height width"],
    scale: Scale,
) -> str:
    """The photograph with lines of equal range in even steps of the front's time s = ln r (of z for a distant light,
    whose `scale` is not logarithmic); every third one is labelled."""
    height, width = valid.shape
    step = stride(height, width, _LARGEST)
    scale = dataclasses.replace(scale, colours="summer")
    levels = front_levels(np.where(valid, distance, np.nan), scale.even == "logarithm")
    lines = {level: _contours(level, distance, valid, step) for level in levels}
    size = _LABEL * max(height, width)
    drawn = [_paths(contours, scale, level) for level, contours in lines.items() if contours]
    drawn += _labels({level: contours[-1] for level, contours in lines.items() if contours}, valid.shape, size)
    picture = (
        f'<svg class="fronts" viewBox="0 0 {width} {height}" role="img" aria-label="contours of equal range">'
        f'<image href="{jpeg(shrunk(rgb))}" width="{width}" height="{height}"/>{"".join(drawn)}</svg>'
    )
    note = f"Where the front stands at even steps of its time, {levels[0]:.6g} to {levels[-1]:.6g}."
    return panel("Fronts: contours of equal range", picture, scale.bar(), note)


def front_levels(distance: Map, logarithmic: bool) -> list[float]:
    """About fifteen ranges, even in ln r and rounded to three digits, or at round numbers."""
    low, high = ends(distance, 0.5, 99.5)
    if logarithmic:
        inner = np.geomspace(low, high, _LINES + 2)[1:-1]
        return [float(f"{level:.3g}") for level in inner]
    step = round_step((high - low) / _LINES)
    first = int(np.ceil(low / step))
    return [step * k for k in range(first, max(first + 2, int(high / step) + 1))]


def _contours(level: float, distance: Map, valid: Bool[np.ndarray, "height width"], step: int) -> list[Line]:
    """The contours (v, u) in px of the photograph, the longest last."""
    if min(distance[::step, ::step].shape) < 2:
        return []
    lines = find_contours(distance[::step, ::step], level, mask=valid[::step, ::step])
    return [step * line for line in sorted(lines, key=len) if len(line) >= _SMALLEST]


def _paths(lines: list[Line], scale: Scale, level: float) -> str:
    colour = "#" + bytes(scale.rgb(np.array([level]))[0]).hex()
    paths = "".join(_path(_simplified(line)) for line in lines)
    return f'<path class="under" d="{paths}"/><path stroke="{colour}" d="{paths}"/>'


def _simplified(line: Line) -> Line:
    """After Douglas and Peucker; scikit-image's own pulls in a fifth of a second of imports."""
    return cv2.approxPolyDP(line[:, None].astype(np.float32), _TOLERANCE, False)[:, 0].astype(float)


def _path(points: Line) -> str:
    """`points` at pixel centres; the picture's corner is half a pixel away."""
    return "M" + "L".join(f"{u + 0.5:.1f} {v + 0.5:.1f}" for v, u in points)


def _labels(longest: dict[float, Line], shape: tuple[int, ...], size: float) -> list[str]:
    """Every third line's range where it is nearest to the picture's middle, if there is room."""
    placed: list[np.ndarray] = []
    texts = []
    for level, line in list(longest.items())[::3]:
        point = line[np.argmin(np.hypot(*(line - np.array(shape) / 2).T))]
        if all(abs(point[0] - p[0]) > size or abs(point[1] - p[1]) > 2.5 * size for p in placed):
            placed.append(point)
            v, u = point
            texts.append(f'<text x="{u:.0f}" y="{v:.0f}" font-size="{size:.0f}">{level:.6g}</text>')
    return texts
