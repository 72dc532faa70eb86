"""Body and interface of every pixel with a local body colour, and with them where the highlights are."""

from typing import NamedTuple

import cv2
import numpy as np
from jaxtyping import Bool, Float

from jaxsfs.specular._colour import added_colour, body_colour, interface_colour, noise_covariance, whitest_between
from jaxsfs.specular._detection import Thresholds, grown, highlights_by_colour, spots_by_colour
from jaxsfs.specular._dichromatic import LUMINANCE, WHITE, Vector, body_strength, interface_free_vector, saturation
from jaxsfs.specular._local import blur_among, local_ratio, noise_by_level, spread
from jaxsfs.specular._one_colour import one_body_colour

Colours = Float[np.ndarray, "height width 3"]
Grey = Float[np.ndarray, "height width"]
Mask = Bool[np.ndarray, "height width"]

ESTIMATED = "estimated from the highlights"
GREYEST = 0.08  # saturation of the body below which its colour gives no signal
NEIGHBOURHOOD = 0.06  # σ of the local body colour, share of the short side

_LARGE = 600_000  # pixels from which colours and highlights are first looked for at half the size
_ROUNDS = 4
_FAR = 6  # times the neighbourhood in the first round
_MARGIN = 3  # px round highlights that are no sample of the body
_STRONG = 0.3  # interface over body in the pixels that show the interface colour
_TINTED = 0.05  # difference from white, in a channel, above what estimates of a white light vary by
_EVEN = 0.03  # spread of excess over luminance up to which tissue counts as even in colour
_SURE_OF_COLOUR = Thresholds(8.0, 0.03, 2.0, 0.005)  # where one body colour explains the picture
_SPOT = 0.12  # size of spots that stand out from uneven tissue, share of the short side


class Split(NamedTuple):
    """luminance = body + excess at every pixel, with body colour k_d, interface colour k_s, and the highlights.

    `uneven`: the tissue's own colours vary so much that only spots were looked for; `single`: they do not vary at all.
    """

    body_colour: Vector
    interface_colour: Vector
    interface_origin: str
    luminance: Grey
    body: Grey
    excess: Grey
    highlights: Mask
    uneven: bool = False  # in colour
    single: bool = False


def split(linear: Colours, data: Mask, interface: Vector | None, sample: Mask) -> Split | None:
    """The picture split by a ⟂ k_s, or None where the body is as grey as the interface.

    c_B from a ⟂ k_s of the dominant body colour is scaled by the local ratio of luminance to c_B outside highlights,
    which is what a slowly varying body colour changes; what is left of the luminance is the excess. Where one body
    colour explains the whole picture, it is the scale everywhere, and a veil over all of the picture is found too.
    Else highlights leave the sample and it is done again. An interface colour that is not given starts white and is
    estimated where the excess is strong. `data`: pixels that are usable and not saturated; `sample`: those to estimate
    colours from.
    """
    if data.size > _LARGE:
        return _split_large(linear, data, interface, sample)
    k_d = body_colour(linear, data & sample if (data & sample).any() else data)
    k_s = WHITE if interface is None else interface
    covariance = noise_covariance(linear, data)
    if saturation(k_d, k_s) < GREYEST:
        return None
    origin = "given" if interface is not None else "white, by default"
    single = one_body_colour(linear, data & sample, k_s)
    if single is not None:
        found = _split_by(linear, data, single, k_s, covariance)
        estimate = _highlight_colour(linear, found, data, sample) if interface is None else None
        estimate = None if estimate is None else whitest_between(single, estimate)
        if estimate is None or np.abs(estimate - k_s).max() < _TINTED:
            return found._replace(interface_origin=origin)
        again = one_body_colour(linear, data & sample, estimate)
        found = _split_by(linear, data, single if again is None else again, estimate, covariance)
        return found._replace(interface_origin=ESTIMATED)
    found = _split_with(linear, data, k_d, k_s, covariance, sample)
    for _ in range(2 if interface is None else 0):
        estimate = _highlight_colour(linear, found, data, sample)
        if estimate is None or saturation(k_d, estimate) < GREYEST:
            break
        found = _split_with(linear, data, k_d, estimate, covariance, sample, found.highlights, _ROUNDS // 2)
        origin = ESTIMATED
    if origin == ESTIMATED:
        single = one_body_colour(linear, data & sample, found.interface_colour)
        found = found if single is None else _split_by(linear, data, single, found.interface_colour, covariance)
    return found._replace(interface_origin=origin)


def _highlight_colour(linear: Colours, found: Split, data: Mask, sample: Mask) -> Vector | None:
    """k_s by the flanks of the highlights, or where they have none by what they add."""
    strong = data & sample & grown(found.highlights & (found.excess > _STRONG * np.maximum(found.body, 1e-6)), 1)
    estimate = interface_colour(linear, found.excess, strong & ~grown(~data, 2))
    if estimate is not None:
        return estimate
    plain = data & ~grown(found.highlights | ~data, _MARGIN)
    return added_colour(linear, strong, plain, found.body_colour)


def _split_by(linear: Colours, data: Mask, k_d: Vector, k_s: Vector, covariance) -> Split:
    """With one body colour for the whole picture, so that a veil over all of it is one."""
    luminance = linear @ LUMINANCE.astype(linear.dtype)
    body = body_strength(linear, interface_free_vector(k_d, k_s, covariance), k_d)
    excess = luminance - body
    noise = noise_by_level(excess, luminance, data)
    highlights = highlights_by_colour(luminance, excess, noise, data, _SURE_OF_COLOUR, paler_tissue=False)
    return Split(k_d, k_s, "", luminance, body, excess, highlights, single=True)


def _split_large(linear: Colours, data: Mask, interface: Vector | None, sample: Mask) -> Split | None:
    """Colours and highlights found at half the size, where noise is less, and the highlights once more at full size."""
    size = (data.shape[1] // 2, data.shape[0] // 2)
    whole, counted = (
        cv2.resize(mask.astype(np.float32), size, interpolation=cv2.INTER_AREA) for mask in (data, sample)
    )
    small = cv2.resize(linear, size, interpolation=cv2.INTER_AREA)
    found = split(small, (whole > 0.999) if (whole > 0.999).any() else whole > 0, interface, counted > 0.5)
    if found is None:
        return None
    start = cv2.resize(found.highlights.astype(np.uint8), data.shape[::-1], interpolation=cv2.INTER_NEAREST) > 0
    covariance = noise_covariance(linear, data)
    if found.single:
        full = _split_by(linear, data, found.body_colour, found.interface_colour, covariance)
    else:
        full = _split_with(linear, data, found.body_colour, found.interface_colour, covariance, sample, start, 1)
    return full._replace(interface_origin=found.interface_origin)


def _split_with(
    linear: Colours,
    data: Mask,
    k_d: Vector,
    k_s: Vector,
    covariance,
    sample: Mask,
    start: Mask | None = None,
    rounds: int = _ROUNDS,
) -> Split:
    luminance = linear @ LUMINANCE.astype(linear.dtype)
    strength = body_strength(linear, interface_free_vector(k_d, k_s, covariance), k_d)
    sigma = NEIGHBOURHOOD * min(data.shape)
    highlights = np.zeros_like(data) if start is None else start
    body, excess, uneven = luminance, luminance, False
    for turn in range(rounds):
        # a broad highlight would be its own neighbourhood: before it is found, the body colour is that of far around
        width = _FAR * sigma if start is None and turn == 0 else sigma
        keep = data & sample & ~grown(highlights, _MARGIN)
        keep = keep if keep.sum() >= 100 else data
        body = strength * np.clip(local_ratio(luminance, strength, keep, width), 0.3, 3)
        excess = luminance - body
        before, (highlights, uneven) = highlights, _highlights(luminance, excess, data)
        if turn and (before ^ highlights).mean() < 1e-4:
            break
    return Split(k_d, k_s, "", luminance, body, excess, highlights, uneven)


def _highlights(luminance: Grey, excess: Grey, data: Mask) -> tuple[Mask, bool]:
    """Spots above their surroundings and, if the tissue is even in colour, all regions above noise; and whether not."""
    noise = noise_by_level(excess, luminance, data)
    lit = data & (luminance > 0.05 * np.percentile(luminance[data], 95))
    share = (blur_among(excess, data, 1.5) / np.maximum(luminance, 1e-6))[lit]
    unevenness = spread(share) if share.size else 0.0
    size = 2 * round(0.5 * _SPOT * min(data.shape)) + 1
    spots = spots_by_colour(luminance, excess, noise, data, size, float(np.clip(4 * unevenness, 0.33, 0.55)))
    if unevenness > _EVEN:
        return spots, True
    adapted = Thresholds(8.0, max(0.06, 5 * unevenness), 3.0, max(0.015, 2 * unevenness))
    return spots | highlights_by_colour(luminance, excess, noise, data, adapted), False
