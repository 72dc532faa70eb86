"""Where the highlights are: relative to what surrounds them, never by brightness alone."""

from typing import NamedTuple

import cv2
import numpy as np
from jaxtyping import Bool, Float

from jaxsfs.forms import Scalar
from jaxsfs.specular._local import blur, blur_among, local_ratio, regions

Grey = Float[np.ndarray, "height width"]
Mask = Bool[np.ndarray, "height width"]

_SMOOTHING = 1.5  # px, σ
_NOISE_LEFT = 0.188  # of white noise after that blur: 1/(2σ√π)
_ADDED = 0.7  # least regression of brightness on excess in a highlight; 1 for added light, 0 for paler tissue
_EDGE_RISE, _OF_PEAK = 0.05, 0.1
_STEEP_RIM = 0.7  # share of a spot's rim that falls steeply; a fold falls on one side
_RING = 6  # px round a spot, which it must outshine
_PLAIN = 1.0  # interface over body from which no tissue colour explains a region


class Thresholds(NamedTuple):
    """Excess over the local body: in standard deviations of its noise plus a share of the luminance."""

    sure_noise: float = 8.0
    sure_share: float = 0.06
    edge_noise: float = 3.0
    edge_share: float = 0.015


def saturated(
    stored: Float[np.ndarray, "height width *channels"], threshold: Scalar = 254 / 255
) -> Bool[np.ndarray, "height width"]:
    """The paper's saturation mask: any channel of the stored value is at or above `threshold`."""
    above = stored >= threshold
    return above if above.ndim == 2 else np.any(above, axis=-1).astype(bool)


def highlights_by_colour(
    luminance: Grey,
    excess: Grey,
    noise: Grey,
    usable: Mask,
    thresholds: Thresholds = Thresholds(),  # noqa: B008
    *,
    paler_tissue: bool = True,
) -> Mask:
    """Regions whose colour leaves the local body colour towards the interface colour, and which are brighter for it.

    `excess`: the interface luminance that the local body colour leaves over; `noise`: its standard deviation. A region
    has a pixel above the sure threshold and extends to the edge threshold. Paler tissue has excess too, but no bump of
    brightness of the same shape: a region counts if brightness rises with excess, slope Σ∇L·∇S/Σ|∇S|² near 1; unless
    it is known that there is no `paler_tissue`.
    """
    smooth = blur_among(excess, usable, _SMOOTHING)
    level = blur_among(luminance, usable, _SMOOTHING)
    left = _NOISE_LEFT * noise
    edge = usable & (smooth > thresholds.edge_noise * left + thresholds.edge_share * level)
    sure = usable & (smooth > thresholds.sure_noise * left + thresholds.sure_share * level)
    count, labels = regions(edge)
    keep = np.bincount(labels[sure], minlength=count) > 0
    keep[0] = False
    if not keep.any():
        return np.zeros_like(usable)
    if paler_tissue:
        keep &= _is_added_light(level, smooth, labels, count, usable)
    return keep[labels]


def _is_added_light(level: Grey, excess: Grey, labels: np.ndarray, count: int, usable: Mask) -> Bool[np.ndarray, "_"]:
    wide = cv2.dilate(labels.astype(np.float32), np.ones((5, 5), np.uint8)).astype(np.int64)
    inner = cv2.erode(usable.astype(np.uint8), np.ones((5, 5), np.uint8), borderValue=0).astype(bool)
    label = wide[inner]
    slopes = [cv2.Sobel(image, -1, dx, 1 - dx)[inner] for image in (level, excess) for dx in (0, 1)]
    together = np.bincount(label, slopes[0] * slopes[2] + slopes[1] * slopes[3], minlength=count)
    alone = np.bincount(label, slopes[2] ** 2 + slopes[3] ** 2, minlength=count)
    slope = together / np.maximum(alone, 1e-30)
    body = np.maximum(level - excess, 0.02 * level + 1e-9)
    plain = np.bincount(labels.ravel(), (excess > _PLAIN * body).ravel(), minlength=count) > 0
    return (slope > _ADDED) | (plain & (slope > 0.5 * _ADDED))


def highlights_by_brightness(luminance: Grey, usable: Mask, size: Scalar, contrast: Scalar = 1.4) -> Mask:
    """Small spots with steep edges that are `contrast` times as bright as what surrounds them: all that grey can show.

    `size`: the widest spot in px. The surroundings are the picture opened by a disc of that size, so that a smooth
    bright near region, whose own size is larger, is its own surroundings.
    """
    level = blur_among(luminance, usable, 1.0)
    log = np.log(np.maximum(level, 1e-5)).astype(np.float32)
    opened = opened_by_disc(np.where(usable, log, log[usable].max(initial=-20)).astype(np.float32), size)
    rise = log - blur(np.minimum(opened, log), 1.0)
    edge, sure = usable & (rise > 0.3 * np.log(contrast)), usable & (rise > np.log(contrast))
    gradient = np.hypot(cv2.Sobel(log, -1, 1, 0, scale=1 / 8), cv2.Sobel(log, -1, 0, 1, scale=1 / 8))
    steep = gradient > 2.5 * np.log(contrast) / float(size)
    count, labels = regions(edge)
    rim = edge & ~cv2.erode(edge.astype(np.uint8), np.ones((3, 3), np.uint8)).astype(bool)
    steep_rim = np.bincount(labels[rim & steep], minlength=count) / np.maximum(
        np.bincount(labels[rim], minlength=count), 1
    )
    keep = (np.bincount(labels[sure], minlength=count) > 0) & (steep_rim > _STEEP_RIM)
    keep[0] = False
    return _standing_out(keep[labels], log, usable, size, contrast)


def _standing_out(spots: Mask, log: Grey, usable: Mask, size: Scalar, contrast: Scalar) -> Mask:
    """The spots that outshine what is round about, and not only what is between them: the white between dark dots is
    as bright as the sheet beyond."""
    if not spots.any():
        return spots
    whole = opened_by_disc((~spots).astype(np.float32), size) < 0.5  # closed by the disc
    whole |= spots
    count, labels = regions(whole)
    deep = cv2.distanceTransform(whole.astype(np.uint8), cv2.DIST_L2, 3)
    near = spots & (deep <= 0.25 * float(size))  # the light itself may fall off across a wide region
    wide = cv2.dilate(labels.astype(np.float32), np.ones((2 * _RING + 1,) * 2, np.uint8)).astype(np.int64)
    ring = usable & ~whole & (wide > 0)
    inside = np.bincount(labels[near], log[near], count) / np.maximum(np.bincount(labels[near], minlength=count), 1)
    around = np.bincount(wide[ring], log[ring], count) / np.maximum(np.bincount(wide[ring], minlength=count), 1)
    return spots & (inside - around > 0.5 * np.log(contrast))[labels]


def grown(mask: Mask, radius: int) -> Mask:
    """Dilated by a disc of `radius` px."""
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * radius + 1, 2 * radius + 1))
    return cv2.dilate(mask.astype(np.uint8), disc).astype(bool)


def outshines(luminance: Grey, saturated: Mask, usable: Mask, contrast: Scalar = 1.5) -> Mask:
    """The saturated regions that are highlights: `contrast` times as bright (at least) as what lies a few px away.

    A near wall that saturates is hardly brighter than its surroundings; its pixels are unknown, but no highlight.
    """
    if not saturated.any():
        return np.zeros_like(saturated)
    around = usable & ~grown(saturated, 3)
    background = local_ratio(luminance, np.ones_like(luminance), around, 5.0)
    count, labels = regions(saturated)
    rises = (luminance > contrast * background) & saturated
    share = np.bincount(labels.ravel(), rises.ravel(), minlength=count) / np.bincount(labels.ravel(), minlength=count)
    keep = share > 0.5
    keep[0] = False
    return keep[labels]


def touching(areas: Mask, others: Mask, reach: int) -> Mask:
    """The connected areas that come within `reach` px of `others`; what is less than 4 px apart is one region."""
    count, labels = regions(grown(areas, 2))
    keep = np.bincount(labels[grown(others, reach)], minlength=count) > 0
    keep[0] = False
    return keep[labels] & areas


def top_hat(values: Grey, known: Mask, size: Scalar) -> Grey:
    """What of `values` a disc of `size` px does not fit under; 0 at unknown pixels, which hollow nothing out.

    Large discs are fitted on a picture reduced until they are about 15 px wide: the cost does not grow with the disc.
    """
    opened = opened_by_disc(np.where(known, values, values.max()).astype(values.dtype), size)
    return np.where(known, np.maximum(values - opened, 0), 0).astype(values.dtype)


def opened_by_disc(values: Grey, size: Scalar) -> Grey:
    """Morphological opening by a disc of `size` px, at the resolution that the disc needs."""
    height, width = values.shape
    reduction = max(1, round(float(size) / 15))
    small = values
    if reduction > 1:
        shape = (max(2, -(-width // reduction)), max(2, -(-height // reduction)))
        small = cv2.resize(values, shape, interpolation=cv2.INTER_AREA)
    reach = 2 * round(0.5 * float(size) / reduction) + 1
    opened = cv2.morphologyEx(small, cv2.MORPH_OPEN, cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (reach, reach)))
    return opened if reduction == 1 else cv2.resize(opened, (width, height), interpolation=cv2.INTER_LINEAR)


def spots_by_colour(luminance: Grey, excess: Grey, noise: Grey, usable: Mask, size: int, sure_share: Scalar) -> Mask:
    """Spots smaller than `size` px that stand out from uneven tissue both in excess and in luminance.

    A spot has a pixel where both rise by `sure_share` of the luminance, and ends where the rise falls below a tenth
    of the highest near by, so that it does not run out into the pale tissue around.
    """
    level = blur_among(luminance, usable, 1.0)
    rise = np.minimum(top_hat(blur_among(excess, usable, 1.0), usable, size), top_hat(level, usable, size))
    left = 0.28 * noise  # of white noise after the blur: 1/(2σ√π)
    sure = usable & (rise > 8 * left + float(sure_share) * level)
    # a square is separable: its cost does not grow with its area
    near = np.ones((size // 2 | 1, size // 2 | 1), np.uint8)
    peak = cv2.dilate(np.where(sure, rise, 0).astype(rise.dtype), near)
    edge = usable & (peak > 0) & (rise > 3 * left + _EDGE_RISE * level) & (rise > _OF_PEAK * peak)
    count, labels = regions(edge)
    keep = np.bincount(labels[sure & edge], minlength=count) > 0
    keep[0] = False
    return keep[labels]
