"""Printed grid lines searched where a first fit predicts them, to the rim, and lines beyond those found at first.

Parallel lines x = i·pitch of one plane are seen on great circles whose normals form a pencil, n_i ∝ a + i b; b is the
plane's normal. Two families of lines of a grid share it.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from jaxsfs.calibration._field import Photograph
from jaxsfs.calibration._fit import Fit, rays_of
from jaxsfs.calibration._lens import ASPECT, SHAPE
from jaxsfs.calibration._line_edges import SIDES, Curve, Sides, blurred_width, both_edges
from jaxsfs.calibration._line_points import LEAST_POINTS, LinePoints

_BEYOND = 4  # lines looked for beyond the outermost found
_POINTS = 1800  # of a photograph's lines if all of them were clear
_MOST_POINTS = 1024  # found: one compiled size serves, and nearer ones share their errors
_LEAST_REACH = 2.6  # px to the sides
_REACH = 0.45  # of the gap to the next line
_CLEAR = 0.3  # of the gap between crossing lines: nearer to one, the paper is hidden


class Family(NamedTuple):
    """Parallel lines: `place` in the grid and unit `normal` of the great circle of each."""

    place: Int[np.ndarray, " lines"]
    normal: Float[np.ndarray, "lines 3"]


def search_lines(photo: Photograph, found: Fit, lines: LinePoints) -> LinePoints | None:
    """The same grid's lines with points all along them; None if too little is seen. `found`: a fit of "spherical" or
    "spherical-k" to `lines`."""
    families = [family for axis in (0, 1) if (family := _family(found, lines, axis)) is not None]
    if len(families) < 2:
        return None
    planes = np.stack([_pencil(family)[1] for family in families])
    planes = planes * np.where(planes[:, 2:] < 0, -1.0, 1.0)
    plane = planes.mean(axis=0) if np.min(planes @ planes.T) > 0.98 else None
    wide = [widened(family) for family in families]
    step = _step(photo, found, families)
    names = [(axis, row) for axis in (0, 1) for row in range(len(wide[axis].place))]
    curves = {name: _clear_curve(photo, found, wide, *name, step) for name in names}
    sides = {name: both_edges(photo, *curves[name][:2]) for name in names if len(curves[name][1])}
    blur, share = _blur_and_share(list(sides.values()), [curves[name][2] for name in sides])
    pixel, bend, line, kept = [], [], [], []
    for name, side in sides.items():
        seen = curves[name][0].at(side.good)
        moved, pulled = _moved_by_blur(seen, side.fall[side.good], blur)
        middle = _middles(found, seen, side, pulled, share * curves[name][2][side.good], plane)
        if len(middle) >= 2 * LEAST_POINTS:
            pixel.append(middle)
            bend.append(moved[:, None] * seen.normal)
            line.append(np.full(len(middle), len(kept)))
            kept.append((name[0], int(wide[name[0]].place[name[1]])))
    if len({axis for axis, _ in kept}) < 2:
        return None
    axes, places = np.array(kept).T
    every = np.concatenate(line)
    few = np.linspace(0, len(every) - 1, min(len(every), _MOST_POINTS)).round().astype(int)
    return LinePoints(np.concatenate(pixel)[few], every[few], lines.source, axes, places, np.concatenate(bend)[few])


def _blur_and_share(sides: list[Sides], gaps: list[np.ndarray]) -> tuple[float, float]:
    """sd in px of the blur, and the lines' width as a share of their spacing: those two that explain how wide the lines
    look all over the picture, near and far. One thin line alone does not tell them apart."""
    good = [side.good for side in sides]
    if not any(one.any() for one in good):
        return 0.0, 0.0
    seen, gap, smoothed = (
        np.concatenate(parts)
        for parts in (
            [(side.right - side.left)[one] for side, one in zip(sides, good, strict=True)],
            [gap[one] for gap, one in zip(gaps, good, strict=True)],
            [side.smoothed[one] for side, one in zip(sides, good, strict=True)],
        )
    )
    blur, share = 0.0, 0.0
    blurs, shares = np.linspace(0.3, 4.0, 38), np.linspace(0.02, 0.5, 49)
    for _ in range(2):
        misfit = [
            [np.median(np.abs(seen - blurred_width(share * gap, np.hypot(blur, smoothed)))) for share in shares]
            for blur in blurs
        ]
        row, column = np.unravel_index(int(np.argmin(misfit)), (len(blurs), len(shares)))
        blur, share = blurs[row], shares[column]
        blurs, shares = blur + np.linspace(-0.1, 0.1, 11), share + np.linspace(-0.01, 0.01, 11)
    return float(blur), float(share)


def _family(found: Fit, lines: LinePoints, axis: int) -> Family | None:
    rays = rays_of(found, lines.pixel)
    names = [name for name in np.nonzero(lines.axis == axis)[0] if (lines.line == name).sum() >= 3]
    if len(names) < 2:
        return None
    normal = np.stack([np.linalg.svd(rays[lines.line == name])[2][-1] for name in names])
    order = np.argsort(lines.place[names])
    return Family(lines.place[names][order], _alike(normal[order]))


def _alike(normal: Float[np.ndarray, "lines 3"]) -> Float[np.ndarray, "lines 3"]:
    """The same normals with signs such that each lies near the one before it."""
    turn = np.sign(np.sum(normal[1:] * normal[:-1], axis=1))
    return normal * np.cumprod(np.concatenate([[1.0], np.where(turn == 0, 1.0, turn)]))[:, None]


def _pencil(family: Family) -> tuple[Float[np.ndarray, "3"], Float[np.ndarray, "3"]]:
    """(a, b) of n_i ∝ a + i b, |b| = 1: the least |n_i × (a + i b)|², twice reweighted."""
    cross = np.stack([np.cross(n, np.eye(3)).T for n in family.normal])
    design = np.concatenate([cross, family.place[:, None, None] * cross], axis=2)
    weight = np.ones(len(family.place))
    both = np.zeros(6)
    for _ in range(3):
        both = np.linalg.svd((weight[:, None, None] * design).reshape(-1, 6))[2][-1]
        size = np.linalg.norm(both[:3] + family.place[:, None] * both[3:], axis=1)
        gap = np.linalg.norm(design @ both, axis=1) / size
        weight = 1 / size / (1 + (gap / (2 * np.median(gap) + 1e-4)) ** 2)
    return both[:3] / np.linalg.norm(both[3:]), both[3:] / np.linalg.norm(both[3:])


def widened(family: Family) -> Family:
    """The family with lines missing in it, and some beyond its ends, from the pencil (of three lines or more)."""
    if len(family.place) < 3:
        return family
    a, b = _pencil(family)
    place = np.arange(family.place[0] - _BEYOND, family.place[-1] + _BEYOND + 1)
    normal = a + place[:, None] * b
    return Family(place, normal / np.linalg.norm(normal, axis=1)[:, None])


def _pixels(found: Fit, ray: Float[np.ndarray, "count 3"]) -> Float[np.ndarray, "count 2"]:
    """Where r = f (s + k s³) sees unit rays; NaN behind the camera."""
    lens = found.parameters
    square = np.sum(ray[:, :2] ** 2, axis=1)
    scale = np.exp(lens[0]) * (1 + lens[SHAPE] * square)
    scale = np.where(ray[:, 2] > 0.05, scale, np.nan)
    return lens[1:3] + scale[:, None] * ray[:, :2] * np.array([1.0, np.exp(lens[ASPECT])])


def _circle(normal: Float[np.ndarray, "3"], count: int) -> Float[np.ndarray, "count 3"]:
    """Rays of the half great circle of `normal` in front of the camera."""
    across = np.cross(normal, [0.0, 0.0, 1.0])
    across = across / max(np.linalg.norm(across), 1e-12)
    ahead = np.cross(across, normal)
    ahead = ahead * (np.sign(ahead[2]) or 1.0)
    turn = np.linspace(-1.5, 1.5, count)[:, None]
    return np.cos(turn) * ahead + np.sin(turn) * across


def _curve(photo: Photograph, found: Fit, normal, step: float) -> Curve:
    """Points every `step` px along a line's image, inside the picture."""
    ray = _circle(normal, 1500)
    pixel = _pixels(found, ray)
    width, height = photo.size
    inside = ((pixel >= 2) & (pixel <= [width - 3, height - 3])).all(axis=1)
    ray, pixel = ray[inside], pixel[inside]
    if len(pixel) < 10:
        return Curve(ray[:0], pixel[:0], pixel[:0], pixel[:0], np.zeros(0))
    tangent = np.gradient(pixel, axis=0)
    length = np.hypot(*tangent.T)
    tangent = tangent / length[:, None]
    across = np.stack([-tangent[:, 1], tangent[:, 0]], axis=1)
    bend = np.sum(np.gradient(tangent, axis=0) * across, axis=1) / length
    place = np.cumsum(length)
    at = np.searchsorted(place, np.arange(place[0] + step / 2, place[-1], step))
    return Curve(ray, pixel, tangent, across, bend).at(at[at < len(pixel)])


def _step(photo: Photograph, found: Fit, families: list[Family]) -> float:
    """px between points so that the lines already found have about `_POINTS`, were they clear all along."""
    total = sum(4.0 * len(_curve(photo, found, n, 4.0).ray) for family in families for n in family.normal)
    return max(3.0, total / _POINTS)


def _clear_curve(photo: Photograph, found: Fit, families: list[Family], axis: int, row: int, step: float):
    """One line's image where the lines that cross it leave the paper beside it free, the px to search there, and those
    to the nearest line beside it."""
    family, other = families[axis], families[1 - axis]
    curve = _curve(photo, found, family.normal[row], step)
    if not len(curve.ray):
        return curve, np.zeros(0), np.zeros(0)
    gap = _gap(found, curve, np.delete(family.normal, row, axis=0))
    reach = _REACH * gap
    before, after = _crossings(found, curve, other.normal)
    clear = np.minimum(before, after) > np.maximum(_CLEAR * 0.5 * (before + after), 3.0)
    clear &= reach > _LEAST_REACH
    return curve.at(clear), np.minimum(reach[clear], 20.0), gap[clear]


def _gap(found: Fit, curve: Curve, normals) -> Float[np.ndarray, " count"]:
    """px from each point along its normal to the nearest of the great circles `normals`, to first order."""
    ahead = rays_of(found, curve.pixel + 0.5 * curve.normal) - rays_of(found, curve.pixel - 0.5 * curve.normal)
    return np.min(np.abs(curve.ray @ normals.T) / np.maximum(np.abs(ahead @ normals.T), 1e-9), axis=1)


def _crossings(found: Fit, curve: Curve, normals) -> tuple[np.ndarray, np.ndarray]:
    """px along the line to the nearest crossing line on either side, to first order; 60 where there is none."""
    ahead = rays_of(found, curve.pixel + 0.5 * curve.tangent) - rays_of(found, curve.pixel - 0.5 * curve.tangent)
    slope = ahead @ normals.T
    away = -(curve.ray @ normals.T) / np.where(np.abs(slope) < 1e-9, 1e-9, slope)
    return np.min(np.where(away < 0, -away, 60.0), axis=1), np.min(np.where(away >= 0, away, 60.0), axis=1)


def _moved_by_blur(seen: Curve, fall, blur: float) -> tuple[Float[np.ndarray, " count"], Float[np.ndarray, " count"]]:
    """px along the normal by which blur moves a line, and by which the mean along the tangent moves it as well: both
    pull a bent line towards its centre of curvature by half their variance times its curvature; blur moves it from
    bright to dark besides, by its variance times the slope of the brightness' logarithm."""
    by_blur = blur**2 * (0.5 * seen.bend - fall)
    return by_blur, by_blur + 0.5 * float(np.mean(np.square(SIDES))) * seen.bend


def _middles(found: Fit, seen: Curve, sides: Sides, pulled, width: Float[np.ndarray, " count"], plane):
    """The image of the middle between both edges on the paper; of the edges' images, where the `plane` is unknown: a
    line's image is wider on its nearer side, by its own `width` in px and not by what blur adds to it. `pulled`, px
    along the normal, is taken back."""
    good = sides.good
    if not good.any():
        return np.zeros((0, 2))
    middle = 0.5 * (sides.left + sides.right)[good] - pulled
    edges = [seen.pixel + offset[:, None] * seen.normal for offset in (middle - width / 2, middle + width / 2)]
    if plane is None:
        return 0.5 * (edges[0] + edges[1])
    rays = [rays_of(found, edge) for edge in edges]
    ray = sum(one / np.maximum(one @ plane, 0.05)[:, None] for one in rays)
    middle = _pixels(found, ray / np.linalg.norm(ray, axis=1)[:, None])
    # what the inverse of the lens is off by cancels
    return middle + 0.5 * sum(edge - _pixels(found, one) for edge, one in zip(edges, rays, strict=True))
