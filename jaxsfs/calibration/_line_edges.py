"""Both edges of a dark line in a photograph, searched across its predicted image."""

from math import erf
from typing import NamedTuple

import cv2
import numpy as np
from jaxtyping import Bool, Float
from scipy import ndimage

from jaxsfs.calibration._field import Photograph

SAMPLES = 41
SIDES = (-1.5, -0.5, 0.5, 1.5)  # px along the line over which a profile is averaged
_SMOOTH = 0.8  # samples
_LEAST_DEPTH = 0.1  # of the paper
_LEAST_RATIO = 6.0  # of a line's depth to the scatter of the paper at its sides
_WIDEST = 0.5  # of the reach: wider lines run together with their neighbours


class Curve(NamedTuple):
    """A line's predicted image: unit `ray`, `pixel`, unit `tangent` and `normal`, and the `bend` κ (1/px, positive
    where the centre of curvature lies along the normal) of points along it."""

    ray: Float[np.ndarray, "count 3"]
    pixel: Float[np.ndarray, "count 2"]
    tangent: Float[np.ndarray, "count 2"]
    normal: Float[np.ndarray, "count 2"]
    bend: Float[np.ndarray, " count"]

    def at(self, rows) -> "Curve":
        return Curve(*(part[rows] for part in self))


class Sides(NamedTuple):
    """Offsets in px along the normals of a line's two edges, whether both are `good`, `fall`, ∂ ln(paper's
    brightness)/∂x in 1/px across the line, and the sd in px by which the profile itself was `smoothed`."""

    left: Float[np.ndarray, " count"]
    right: Float[np.ndarray, " count"]
    good: Bool[np.ndarray, " count"]
    fall: Float[np.ndarray, " count"]
    smoothed: Float[np.ndarray, " count"]


def both_edges(photo: Photograph, curve: Curve, reach) -> Sides:
    """Half-depth crossings on both sides of a dark line; the paper's brightness is a straight line between the
    profile's ends."""
    along = np.linspace(-1, 1, SAMPLES)
    linear, mask = photo.linear.astype(np.float32), photo.usable.astype(np.uint8)
    profile, ok = np.zeros((len(reach), SAMPLES)), np.ones(len(reach), bool)
    for side in SIDES:
        at = (curve.pixel + side * curve.tangent)[:, None] + (reach[:, None] * along)[..., None] * curve.normal[:, None]
        at = at.astype(np.float32)
        profile += cv2.remap(linear, at[..., 0], at[..., 1], cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)
        ok &= cv2.remap(mask, at[..., 0], at[..., 1], cv2.INTER_NEAREST).all(axis=1)
    profile = profile / len(SIDES)
    depth = depth_of(profile)
    left, right, peak, found = half_depth(depth)
    ends = SAMPLES // 8
    scatter = np.maximum(depth[:, :ends].std(axis=1), depth[:, -ends:].std(axis=1))
    good = ok & found & (peak > _LEAST_DEPTH) & (peak > _LEAST_RATIO * scatter)
    good &= (left > -_WIDEST) & (right < _WIDEST)
    before, after = (np.maximum(profile[:, part].mean(axis=1), 1e-3) for part in (slice(ends), slice(-ends, None)))
    fall = np.clip(np.log(after / before) / (2 * reach * (1 - ends / SAMPLES)), -0.3, 0.3)
    spacing = 2 * reach / (SAMPLES - 1)
    return Sides(reach * left, reach * right, good, fall, _SMOOTH * spacing)


def blurred_width(width: Float[np.ndarray, " count"], blur: Float[np.ndarray, " count"]) -> Float[np.ndarray, " count"]:
    """px between the half-depth crossings of a line of `width` px under a Gaussian blur of sd `blur`: 2.355 sd if the
    line is much thinner, its width if it is much wider."""
    ratio = width / blur
    return np.where(ratio < _WIDTHS[0][-1], blur * np.interp(ratio, *_WIDTHS), width)


def _widths() -> tuple[np.ndarray, np.ndarray]:
    """Widths of lines and what they are at half depth under blur, both in sds of the blur, by bisection."""
    width = np.linspace(0.0, 8.0, 161)[1:]
    depth = np.vectorize(lambda at, w: erf((at + w / 2) / np.sqrt(2)) - erf((at - w / 2) / np.sqrt(2)))
    low, high = np.zeros_like(width), 2 + width
    for _ in range(30):
        middle = 0.5 * (low + high)
        deep = depth(middle, width) > 0.5 * depth(0.0, width)
        low, high = np.where(deep, middle, low), np.where(deep, high, middle)
    return np.concatenate([[0.0], width]), np.concatenate([[2 * np.sqrt(2 * np.log(2))], 2 * low])


_WIDTHS = _widths()


def depth_of(profile: Float[np.ndarray, "count samples"]) -> Float[np.ndarray, "count samples"]:
    """1 − value over the paper's, a straight line between the means of the profile's ends, slightly smoothed."""
    ends = SAMPLES // 8
    left, right = profile[:, :ends].mean(axis=1), profile[:, -ends:].mean(axis=1)
    ramp = np.linspace(0, 1, SAMPLES)
    ground = left[:, None] * (1 - ramp) + right[:, None] * ramp
    return ndimage.gaussian_filter1d(1 - profile / np.maximum(ground, 0.003), _SMOOTH, axis=1)


def half_depth(depth: Float[np.ndarray, "count samples"]):
    """Coordinates (−1 … 1) of the crossings of half the deepest value on either side of it, that value, and whether
    both were found."""
    ends = SAMPLES // 8
    deepest = ends + depth[:, ends:-ends].argmax(axis=1)
    peak = depth[np.arange(len(depth)), deepest]
    left, found_left = _half(depth, deepest, peak, -1)
    right, found_right = _half(depth, deepest, peak, 1)
    return left, right, peak, found_left & found_right


def _half(depth, start, peak, direction: int) -> tuple[Float[np.ndarray, " n"], Bool[np.ndarray, " n"]]:
    """Coordinate (−1 … 1) where `depth` first falls to half its `peak` from `start` on, and whether it does."""
    index, value = np.arange(SAMPLES), depth - 0.5 * peak[:, None]
    below = (direction * (index - start[:, None]) > 0) & (value <= 0)
    found = below.any(axis=1)
    first = np.where(direction > 0, below.argmax(axis=1), SAMPLES - 1 - below[:, ::-1].argmax(axis=1))
    first = np.where(found, first, start + direction)
    rows = np.arange(len(depth))
    low, high = value[rows, first], value[rows, first - direction]
    at = first - direction * low / np.where(low == high, -1.0, low - high)
    return 2 * at / (SAMPLES - 1) - 1, found
