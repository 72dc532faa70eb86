"""Sub-pixel edges near the rings that a fitted lens and pose predict."""

from math import erf
from typing import NamedTuple

import cv2
import numpy as np
from jaxtyping import Float, Int
from scipy import ndimage

from jaxsfs.calibration._field import Photograph
from jaxsfs.calibration._lens import LENS_SIZE
from jaxsfs.calibration._ring_images import RAYS, RingImages, px_per_mm, ring_images

_SAMPLES = 61  # of a profile across an edge
_SIDES = np.linspace(-1, 1, 13)  # of the way along an edge over which a profile is averaged
_ALONG = 6.0  # px, at most
_REACH = 18.0  # px to either side of a thin line or a band's edge
_WINDOW = 1.2  # of a thick line's width, to either side of its middle
_STANDS_OUT = 8.0  # times the paper's scatter
_LEAST_CONTRAST = 0.01  # of the brightest paper: less drowns in 8 bits
_LEAST_DEPTH = 0.08  # of the paper: shallower dips are noise
_BESIDE = 9  # rays


class Edges(NamedTuple):
    """Edge points of one photograph: `pixel`, index `ring` of the printed radius, `polarity` (see Observations),
    `expected`, how many ought to be seen, and `searched`, how many were looked for inside the usable field."""

    pixel: Float[np.ndarray, "count 2"]
    ring: Int[np.ndarray, " count"]
    polarity: Float[np.ndarray, " count"]
    expected: int
    bend: Float[np.ndarray, " count"]
    searched: int


def search_edges(
    photo: Photograph,
    name: str,
    parameters: np.ndarray,
    view: Float[np.ndarray, "6"],
    radii: Float[np.ndarray, " rings"],
    style: str,
) -> Edges:
    """Looks for every printed ring along the normal of its predicted image, on `RAYS` rays of the image."""
    seen = ring_images(name, parameters, view, radii, photo.size)
    base, radius, normal = seen.base, seen.radius, seen.normal
    width_px = abs(float(parameters[LENS_SIZE])) * px_per_mm(radius, radii)
    # a line and the paper to either side of it, at most half way to the next ring
    window = np.clip(seen.reach, 3.0, np.maximum(_REACH, _WINDOW * np.nan_to_num(width_px)))
    profile, ok, step = _profiles(photo, seen, window)
    visible = ok & np.isfinite(radius)
    if style == "bands":
        offset, polarity, good = _single_edges(profile)
    else:
        offset, polarity, good = _line_edges(profile if style == "dark" else -profile)
        polarity = polarity if style == "dark" else -polarity
    good = good & visible[..., None]
    clear = (
        np.ones_like(visible) if style == "bands" else _clear(profile, width_px, blur_sd(profile, offset, step, good))
    )
    expected = visible & (clear | good.any(-1))
    # blur moves an edge by −σ²/(2·radius), towards its centre of curvature, and by −σ² ∂ln(brightness)/∂x, from bright
    # to dark, whatever its profile
    blur = blur_sd(profile, offset, step, good)
    fall = 0.0 if style == "bands" else _brightness_slope(profile, step)  # a band's ends are ink and paper
    bend = blur**2 * (1 / (2 * radius) + fall)
    where = base[..., None, :] + (offset * step[..., None] + bend[..., None])[..., None] * normal[..., None, :]
    ring = np.broadcast_to(np.arange(len(radii))[None, :, None], good.shape)
    bends = np.broadcast_to(bend[..., None], good.shape)
    return Edges(
        where[good],
        ring[good],
        polarity[good],
        int(expected.sum()) * good.shape[-1],
        bends[good],
        int(visible.sum()) * good.shape[-1],
    )


def _clear(profile: np.ndarray, width_px: np.ndarray, blur: float) -> np.ndarray:
    """Where a printed line would stand out: ink on paper of this brightness, thinned by blur, against the scatter of
    the paper at the profile's ends. The dark rim and foreshortened rings show nothing, and are not missed."""
    ends = _SAMPLES // 7
    sides = np.concatenate([profile[..., :ends], profile[..., -ends:]], axis=-1)
    scatter = np.sqrt(0.5 * (profile[..., :ends].var(-1) + profile[..., -ends:].var(-1)))
    share = np.vectorize(erf)(np.nan_to_num(width_px) / (2 * np.sqrt(2) * max(blur, 0.5)))
    level = np.abs(sides).mean(-1)
    contrast = 0.9 * share * level
    return (contrast > _STANDS_OUT * scatter) & (
        contrast > _LEAST_CONTRAST * max(float(np.percentile(level, 90)), 1e-3)
    )


def blur_sd(profile, offset, step, good) -> float:
    """sd in px of the blur across the edges: a blurred step passes from ¼ to ¾ of its height within 1.349 sd, so its
    steepest slope is contrast/(√(2π)·sd). The median over the good edges; 0 without any."""
    if not good.any():
        return 0.0
    smooth, ends = ndimage.gaussian_filter1d(profile, 1.0, axis=-1), _SAMPLES // 7
    slope = np.abs(np.gradient(smooth, axis=-1))
    at = np.clip(np.round((offset + 1) / 2 * (_SAMPLES - 1)), 0, _SAMPLES - 1).astype(int)
    steepest = np.take_along_axis(slope, at, -1) * (_SAMPLES - 1) / (2 * step[..., None])
    contrast = (smooth.max(-1) - smooth.min(-1))[..., None]
    if offset.shape[-1] == 2:  # each edge of a line has its own side's paper
        sides = np.stack([profile[..., :ends].mean(-1), profile[..., -ends:].mean(-1)], axis=-1)
        contrast = np.maximum(sides - smooth.min(-1)[..., None], smooth.max(-1)[..., None] - sides)
    square = (contrast / (np.sqrt(2 * np.pi) * np.maximum(steepest, 1e-6))) ** 2
    square = square - (2 * step[..., None] / (_SAMPLES - 1)) ** 2  # of the smoothing
    return float(np.sqrt(np.clip(np.median(square[good]), 0.1, 36.0)))


def _brightness_slope(profile: np.ndarray, step: np.ndarray) -> np.ndarray:
    """∂ ln(paper's brightness)/∂x in 1/px across the edges, from the profiles' ends."""
    ends = _SAMPLES // 7
    left, right = (np.maximum(profile[..., part].mean(-1), 1e-3) for part in (slice(ends), slice(-ends, None)))
    return np.clip(np.log(right / left) / (2 * step * (1 - ends / _SAMPLES)), -0.3, 0.3)


def _profiles(photo: Photograph, seen: RingImages, step: Float[np.ndarray, "rays rings"]):
    """Grey values along the normals over ±`step` px, averaged along the edge (an arc) half way to the next rays,
    whether all of them are usable, and px per unit of the profile's coordinate (−1 … 1)."""
    base, normal, reach, curvature = seen.base, seen.normal, seen.reach, seen.curvature
    along = np.linspace(-1, 1, _SAMPLES)
    tangent = np.stack([-normal[..., 1], normal[..., 0]], axis=-1)
    safe = np.where(np.isfinite(base), base, -100.0)
    total = np.zeros((*base.shape[:-1], _SAMPLES))
    grey = photo.linear.astype(np.float32)
    ok = reach > 2.5
    bend = np.where(np.isfinite(curvature), curvature, 0.0)
    along_edge = np.clip(np.pi / RAYS / np.maximum(bend, 1e-6), 2.0, _ALONG)
    mask = photo.usable.astype(np.uint8)
    for share in _SIDES:
        side = share * along_edge[..., None]
        sag = side**2 / 2 * bend[..., None] * normal
        at = safe + np.where(np.isfinite(tangent), side * tangent - sag, 0)
        points = at[..., None, :] + (step[..., None] * along)[..., None] * normal[..., None, :]
        points = np.where(np.isfinite(points), points, -100.0).astype(np.float32)
        flat = points.reshape(points.shape[0], -1, 2)
        sampled = cv2.remap(grey, flat[..., 0], flat[..., 1], cv2.INTER_CUBIC, borderMode=cv2.BORDER_REPLICATE)
        total = total + sampled.reshape(points.shape[:-1]).astype(float) / len(_SIDES)
        usable = cv2.remap(mask, flat[..., 0], flat[..., 1], cv2.INTER_NEAREST)
        ok = ok & usable.reshape(points.shape[:-1]).all(axis=-1)
    return total, ok, step


def _line_edges(profile: np.ndarray):
    """Both edges of a dark line: crossings of half its depth, the background being a straight line between the means
    of the profile's ends."""
    ends = _SAMPLES // 7
    left, right = profile[..., :ends].mean(-1), profile[..., -ends:].mean(-1)
    ramp = np.linspace(0, 1, _SAMPLES)
    offset = 2.0 if (profile < 0).any() else 0.0  # bright lines come negated: keep the background positive
    ground = left[..., None] * (1 - ramp) + right[..., None] * ramp + offset
    depth = 1 - (profile + offset) / np.maximum(ground, 0.02)
    smooth = ndimage.gaussian_filter1d(depth, 1.0, axis=-1)
    middle = ends + np.argmax(smooth[..., ends:-ends], axis=-1)
    peak = np.take_along_axis(smooth, middle[..., None], -1)
    inner, found_in = _crossing(smooth - 0.5 * peak, middle, -1)
    outer, found_out = _crossing(smooth - 0.5 * peak, middle, 1)
    peak = peak[..., 0]
    # lines fade towards a blurred rim: typical is what lies beside on the same ring
    typical = ndimage.median_filter(peak, (_BESIDE, 1), mode="wrap")
    scatter = np.sqrt(0.5 * (depth[..., :ends].var(-1) + depth[..., -ends:].var(-1)))
    clean = np.abs(depth[..., :ends]).max(-1) + np.abs(depth[..., -ends:]).max(-1) < 0.9 * peak
    good = (
        found_in
        & found_out
        & (peak > 0.5 * typical)
        & (peak > (_LEAST_DEPTH if offset == 0 else 0.02))
        & (peak > 5 * scatter)
        & clean
    )
    offsets = np.stack([inner, outer], axis=-1)
    polarity = np.broadcast_to(np.array([-1.0, 1.0]), offsets.shape)
    return offsets, polarity, np.repeat(good[..., None], 2, axis=-1)


def _crossing(value: np.ndarray, start: np.ndarray, direction: int):
    """Coordinate (−1 … 1) where `value` first falls through 0 from `start` on, by linear interpolation."""
    index = np.arange(_SAMPLES)
    beyond = (index >= start[..., None]) if direction > 0 else (index <= start[..., None])
    below = beyond & (value <= 0)
    found = below.any(-1)
    first = np.argmax(below, -1) if direction > 0 else _SAMPLES - 1 - np.argmax(below[..., ::-1], -1)
    first = np.clip(first, 1, _SAMPLES - 2)
    low = np.take_along_axis(value, first[..., None], -1)[..., 0]
    high = np.take_along_axis(value, (first - direction)[..., None], -1)[..., 0]
    at = first - direction * low / np.where(low - high == 0, -1.0, low - high)
    return 2 * at / (_SAMPLES - 1) - 1, found


def _single_edges(profile: np.ndarray):
    """The one edge of a band: where the profile crosses the mean of its two ends' levels."""
    ends = _SAMPLES // 5
    left, right = profile[..., :ends].mean(-1), profile[..., -ends:].mean(-1)
    rise = np.sign(right - left)
    value = (profile - 0.5 * (left + right)[..., None]) * -rise[..., None]
    value = ndimage.gaussian_filter1d(value, 1.0, axis=-1)
    at, found = _crossing(value, np.full(left.shape, ends), 1)
    contrast = np.abs(right - left) / np.maximum(np.maximum(left, right), 0.02)
    typical = np.median(contrast[contrast > np.percentile(contrast, 60)])
    flat = np.maximum(profile[..., :ends].std(-1), profile[..., -ends:].std(-1)) < 0.25 * np.abs(right - left)
    good = found & (contrast > 0.35 * typical) & flat
    return at[..., None], rise[..., None], good[..., None]
