"""The body inside highlights: measured by colour, weighted by its noise, and joined smoothly to what is around."""

from typing import NamedTuple

import cv2
import numpy as np
from jaxtyping import Bool, Float

from jaxsfs.specular._colour import weighted_median
from jaxsfs.specular._detection import grown, highlights_by_brightness
from jaxsfs.specular._dichromatic import LUMINANCE
from jaxsfs.specular._fill import Fit, fit_for, fit_smooth
from jaxsfs.specular._local import blur_among, local_ratio, noise_by_level, regions
from jaxsfs.specular._split import NEIGHBOURHOOD, Split

Picture = Float[np.ndarray, "height width *channels"]
Colours = Float[np.ndarray, "height width 3"]
Grey = Float[np.ndarray, "height width"]
Mask = Bool[np.ndarray, "height width"]

_TAIL = 2  # px by which a detected highlight is extended
_BLURRED_TAIL = 4  # px, on real tissue: optics and compression blur a highlight's rim
_COLOUR_ERROR = 0.12  # share of the interface part that an interface colour, not exact, leaves in the body
_EXACT_ERROR = 0.03  # the same where one body colour explains the whole picture
_LOCAL_ERROR = 0.2  # relative error of the body where its colour, which varies, is that of the surroundings
_BLOOM = 0.1  # relative error of the body beside an unmeasured pixel, falling by e per px
_ROUGHNESS = 0.004  # |Δ ln E| per px² of smooth tissue
_WIDE_ROUGHNESS = 0.02  # of all that a veil covers, contours and all
_TENSION, _UNEVEN_TENSION = 0.02, 0.2  # px⁻², where a bright rim must not be carried on inwards
_MISFIT = 1.5  # mean squared residual in σ from which a picture's own edges are followed
_DETAIL = 3.0  # px, σ of the blur that detail differs from
_SUSPICION = 1.5  # times the variance that detail must exceed
_DARKEST_BODY = 0.33  # share of the luminance below which the body is what errors of k_s and of the response make
_FEWEST = 6  # pixels of a highlight that tell its own colour
_MOST_LEFT = 0.5  # of the excess that a highlight's own colour can leave in the body
_SPOT = 0.08  # widest highlight that brightness alone can show, share of the short side


class Removed(NamedTuple):
    """`values` (single precision) are meant in the `hole`; `filled`: pixels of it without any measurement."""

    values: Picture
    hole: Mask
    filled: Mask


def remove_by_colour(
    linear: Colours, parts: Split, usable: Mask, data: Mask, cores: Mask, sample: Mask, *, fill: bool = False
) -> Removed:
    """Body image in and round the highlights of `parts` and the saturated `cores`.

    ln E is fitted to the body measured by colour with the inverse of its variance as weight (0 in saturated pixels,
    and everywhere inside if `fill`), to the luminance round about, and to smoothness. The colour is that of
    I − c_I k_s, passing into the local body colour where the highlight is stronger than the body.
    """
    luminance, body = parts.luminance, np.maximum(parts.body, 1e-5).astype(np.float32)
    tail = _BLURRED_TAIL if parts.uneven else _TAIL
    hole = (grown(parts.highlights, tail) | grown(cores, tail)) & usable
    if not hole.any():
        return Removed(linear, hole, hole)
    roughness = _WIDE_ROUGHNESS if parts.single else _ROUGHNESS
    fit = fit_for(hole, usable, roughness, _UNEVEN_TENSION if parts.uneven else _TENSION)
    if parts.uneven and not fill:
        body = _with_own_colours(fit, parts, body, hole, data, sample)
    measured, weight = _measured(parts, body, hole, data)
    if fill:
        weight = np.where(hole, 0.0, weight)
    fitted = _fit(fit, measured, weight, hole)
    fitted = _with_detail(fitted, measured, parts, body, data, hole & (weight > 0))
    level = np.exp(fitted).astype(np.float32)
    # a highlight adds light: where there is a luminance, the body is at most that
    level = np.where(data, np.minimum(level, luminance), level)
    smooth_colour = level[..., None] * _local_colour(linear, luminance, data & ~grown(parts.highlights, 3))
    k_s = (parts.interface_colour / (LUMINANCE @ parts.interface_colour)).astype(np.float32)
    without = np.maximum(linear - (luminance - level)[..., None] * k_s, 0.3 * smooth_colour)
    strength = np.clip((luminance - level) / np.maximum(level, 1e-6) - 0.5, 0, 1)
    strength = np.where(data, strength, 1)[..., None]
    return Removed((1 - strength) * without + strength * smooth_colour, hole, hole & (weight == 0))


def remove_by_brightness(linear: Picture, luminance: Grey, usable: Mask, data: Mask, cores: Mask) -> Removed:
    """Spots that are brighter than their surroundings, filled with the smoothest ln E."""
    size = _SPOT * min(data.shape)
    spots = highlights_by_brightness(luminance, data, size)
    hole = (grown(spots, _TAIL + 2) | grown(cores, _TAIL + 1)) & usable
    if not hole.any():
        return Removed(linear, hole, hole)
    sigma = noise_by_level(luminance, luminance, data) / np.maximum(luminance, 1e-5)
    measured = np.log(np.maximum(luminance, 1e-5)).astype(np.float64)
    weight = np.where(data & ~hole, 1 / (sigma.astype(np.float64) ** 2 + 1e-6), 0.0)
    level = np.exp(fit_smooth(fit_for(hole, usable, _ROUGHNESS), measured, weight, hole)).astype(np.float32)
    values = level if linear.ndim == 2 else level[..., None] * _local_colour(linear, luminance, data & ~hole)
    return Removed(values, hole, hole)


def _with_own_colours(fit: Fit, parts: Split, body: Grey, hole: Mask, data: Mask, sample: Mask) -> Grey:
    """Body + ε·excess, with the ε of each highlight that brings it to the level of what is around.

    One k_s for all highlights of a real picture is not exact (soft clipping, several lights): a·k_s is then not 0, and
    a multiple of the excess is left in the body. ε is a weighted median over the `sample`, of few pixels so nothing
    but the level can be brought in from around: what varies inside stays measured.
    """
    around, weight = _measured(parts, body, hole, data)
    filled = np.exp(fit_smooth(fit, around, np.where(hole, 0.0, weight), hole))
    count, labels = regions(hole)
    counted = hole & sample & (weight > 0) & (parts.excess > 0.1 * body)
    label, excess = labels[counted], parts.excess[counted].astype(np.float64)
    missing = filled[counted] - body[counted]
    shares = np.zeros(count)
    order = np.argsort(label, kind="stable")
    for part in np.split(order, np.cumsum(np.bincount(label, minlength=count))[:-1]):
        if len(part) >= _FEWEST:
            left = weighted_median(missing[part] / excess[part], excess[part])
            shares[label[part[0]]] = np.clip(left, -_MOST_LEFT, _MOST_LEFT)
    return np.maximum(body + shares[labels] * np.maximum(parts.excess, 0), 1e-5).astype(np.float32)


def _colour_error(parts: Split) -> float:
    return _EXACT_ERROR if parts.single else _COLOUR_ERROR


def _measured(parts: Split, body: Grey, hole: Mask, data: Mask) -> tuple[Grey, Grey]:
    """ln E as measured, by colour in the hole and as luminance elsewhere, and the weights 1/variance."""
    luminance = np.maximum(parts.luminance, 1e-5)
    outside = noise_by_level(parts.luminance, luminance, data) / luminance
    interface = _colour_error(parts) * np.maximum(parts.excess, 0)
    inside = np.hypot(noise_by_level(parts.body, luminance, data), interface) / body
    known = data & (~hole | (parts.body > _DARKEST_BODY * luminance))
    apart = cv2.distanceTransform((known | ~hole).astype(np.uint8), cv2.DIST_L2, 5)
    inside = np.hypot(inside, _BLOOM * np.exp(-np.maximum(apart - 1, 0)))
    # one colour is exact, and highlights on uneven tissue are brought to the level around them
    inside = inside if parts.single or parts.uneven else np.hypot(inside, _LOCAL_ERROR)
    variance = np.where(hole, inside, outside).astype(np.float64) ** 2 + 1e-6
    return np.log(np.where(hole & data, body, luminance)).astype(np.float64), np.where(known, 1 / variance, 0.0)


def _fit(fit: Fit, measured: Grey, weight: Grey, hole: Mask) -> Grey:
    """A smooth fit, done again with more weight where the measurements together insist on an edge."""
    fitted = fit_smooth(fit, measured, weight, hole)
    misfit = np.where(hole, (fitted - measured) ** 2 * weight, 0).astype(np.float32)
    misfit = blur_among(misfit, hole & (weight > 0), 1.5).astype(np.float64)
    insists = hole & (misfit > _MISFIT)
    if not insists.any():
        return fitted
    heavier = weight * np.where(insists, np.minimum(misfit / _MISFIT, 10) ** 2, 1)
    return fit_smooth(fit, measured, heavier, hole, fitted)


def _with_detail(fitted: Grey, measured: Grey, parts: Split, body: Grey, data: Mask, known: Mask) -> Grey:
    """The fit with the detail of the measured ln E that is more than its noise and than what the highlight leaves.

    Wiener's gain 1 − σ²/d² with the local mean of d². An error of k_s leaves a multiple of the excess, and its detail a
    multiple of the excess's: a texture shows on a smooth highlight, and not at its rim.
    """
    level = np.maximum(body, 1e-5)
    noise = noise_by_level(parts.body, np.maximum(parts.luminance, 1e-5), data) / level
    detail = _detail(measured - fitted, known)
    rim = _colour_error(parts) * np.abs(_detail(np.where(known, parts.excess / level, 0).astype(np.float64), known))
    error = np.where(known, noise.astype(np.float64) ** 2 + rim**2, 0).astype(np.float32)
    energy = blur_among((detail**2).astype(np.float32), known, _DETAIL)
    gain = 1 - _SUSPICION * blur_among(error, known, _DETAIL) / np.maximum(energy, 1e-12)
    return fitted + np.where(known, np.clip(gain, 0, 1) * detail, 0)


def _detail(values: Grey, known: Mask) -> Grey:
    return np.where(known, values - blur_among(values.astype(np.float32), known, _DETAIL), 0.0)


def _local_colour(linear: Colours, luminance: Grey, keep: Mask) -> Colours:
    sigma = NEIGHBOURHOOD * min(keep.shape)
    channels = [local_ratio(np.ascontiguousarray(linear[..., c]), luminance, keep, sigma) for c in range(3)]
    return np.stack(channels, axis=-1)
