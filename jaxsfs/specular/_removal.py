"""A picture without its highlights: luminance where there is none, the invariant inside, a smooth fill in the cores."""

from typing import Any, Literal

import cv2
import equinox as eqx
import numpy as np
from jaxtyping import Bool, Float

from jaxsfs.specular._adaptive import Removed, remove_by_brightness, remove_by_colour
from jaxsfs.specular._colour import body_colour
from jaxsfs.specular._cores import highlight_cores
from jaxsfs.specular._detection import grown, outshines
from jaxsfs.specular._dichromatic import LUMINANCE, WHITE, Vector, saturation, separate
from jaxsfs.specular._split import GREYEST, Split, split

Picture = Float[np.ndarray, "height width *channels"]
Mask = Bool[np.ndarray, "height width"]
Method = Literal["auto", "mask", "dichromatic", "off"]

_WIDEST_FILL = 0.05  # distance to the nearest data, share of the short side, beyond which a fill is a guess
_NO_COLOUR = "the body is as grey as the interface, so colour tells nothing: spots found by brightness are filled"


class SpecularReport(eqx.Module):
    """What was found and done. Colours in linear light: k_d of luminance 1, k_s of mean 1; None on grey pictures.

    `method` that was applied: `adaptive`, `mask`, `dichromatic` or `off`. `saturation`: sine of the angle between k_d
    and k_s. `highlights`, `saturated`, `filled`, `unknown`: numbers of pixels. `message`: what to know, in words.
    """

    method: str
    body_colour: tuple[float, ...] | None
    interface_colour: tuple[float, ...] | None
    interface_origin: str
    saturation: float
    highlights: int
    saturated: int
    filled: int
    unknown: int
    message: str

    def as_dict(self) -> dict[str, Any]:
        """Plain values under the field names."""
        return dict(vars(self))


class HighlightRemoval(eqx.Module):
    """`values`: the body image in linear light, of the given shape, and exactly the given values outside `highlights`.

    `highlights`: pixels that were changed; `filled`: those of them where nothing was measured, so that the value comes
    from their surroundings alone; `unknown`: usable pixels whose value is no data and that a solver should leave out
    (saturated without being a highlight, or too far from any data). `filled` and `unknown` overlap in wide cores.
    """

    values: Picture
    highlights: Mask
    filled: Mask
    unknown: Mask
    report: SpecularReport


def remove_highlights(
    linear: Picture,
    usable: Mask | None = None,
    *,
    saturated: Mask | None = None,
    method: Method = "auto",
    interface: Vector | None = None,
    sample: Mask | None = None,
) -> HighlightRemoval:
    """The body part of a photograph in linear light, changed only where there are highlights.

    `linear`: (height, width, 3) or (height, width), response inverted; fall-off need not be divided out. `usable`:
    pixels to look at; `saturated`: pixels with a clipped channel (`saturated`), never used as data. `interface`: k_s;
    estimated from the highlights if not given, white where they do not show it. `sample`: pixels that colours may be
    estimated from, all by default.

    Methods: `auto` keeps the luminance outside the highlights, measures c_B inside them with a ⟂ k_s (eqs. 8 to 10)
    and the local body colour, and fits ln E smoothly to both, weighted by their noise; saturated cores are filled.
    `mask` fills all highlights. `dichromatic` is the paper's method with the automatic a, at every pixel. On grey
    pictures and grey tissue `auto` and `mask` find small spots by brightness and fill them.

    Raises ValueError for shapes that do not match, `dichromatic` of a grey picture, and no usable pixel.
    """
    shape = linear.shape[:2]
    usable, saturated, sample = (
        _checked(name, mask, shape, default)
        for name, mask, default in (("usable", usable, True), ("saturated", saturated, False), ("sample", sample, True))
    )
    saturated = saturated & usable
    if linear.ndim == 3 and linear.shape[2] != 3:
        raise ValueError(f"a picture has 1 or 3 channels, got {linear.shape[2]}; give red, green, blue or grey")
    if method not in ("auto", "mask", "dichromatic", "off"):
        raise ValueError(f"method must be auto, mask, dichromatic or off, got {method!r}")
    if not (usable & ~saturated).any():
        raise ValueError("no pixel is usable and unsaturated: check the mask and the exposure")
    if method == "off":
        return untouched(linear, saturated)
    if method == "dichromatic":
        return _everywhere(linear, usable, saturated, interface, sample)
    return _inside_highlights(linear, usable, saturated, method == "mask", interface, sample)


def untouched(linear: Picture, saturated: Mask) -> HighlightRemoval:
    """What method "off" gives: the picture as it is, its `saturated` pixels unknown."""
    none = np.zeros(saturated.shape, bool)
    report = _report("off", None, none, saturated, none, saturated, "highlights were not looked for")
    return HighlightRemoval(linear, none, none, saturated, report)


def _inside_highlights(
    linear: Picture, usable: Mask, saturated: Mask, fill: bool, interface, sample
) -> HighlightRemoval:
    single = linear.astype(np.float32)
    data = usable & ~grown(saturated, 1)
    data = data if data.any() else usable & ~saturated
    luminance = single if single.ndim == 2 else single @ LUMINANCE.astype(np.float32)
    parts = split(single, data, interface, sample) if single.ndim == 3 else None
    if parts is None:
        cores = outshines(luminance, saturated, usable, 1.25)
        removed = remove_by_brightness(single, luminance, usable, data, cores)
    else:
        cores = highlight_cores(
            single, luminance, saturated, usable, parts.highlights, parts.excess, parts.interface_colour
        )
        removed = remove_by_colour(single, parts, usable, data, cores, sample, fill=fill)
    values = np.where(_like(removed.hole, linear), removed.values.astype(linear.dtype), linear)
    unknown = (saturated & ~removed.hole) | _far_from_data(removed, usable)
    message = _words(parts, removed.hole, unknown, linear.ndim == 2)
    name = "mask" if fill or parts is None else "adaptive"
    report = _report(name, parts, removed.hole, saturated, removed.filled, unknown, message)
    return HighlightRemoval(values, removed.hole, removed.filled, unknown, report)


def _everywhere(linear: Picture, usable: Mask, saturated: Mask, interface, sample) -> HighlightRemoval:
    """The paper's method: c_B k_d at every pixel, saturated ones left out."""
    if linear.ndim == 2:
        raise ValueError("a grey picture has no colour to separate by; use method 'auto' or 'mask'")
    data = usable & ~saturated
    k_d = body_colour(linear, data & sample if (data & sample).any() else data)
    k_s = WHITE if interface is None else interface
    if saturation(k_d, k_s) < GREYEST:
        raise ValueError(
            f"the body's colour is too close to the interface's (saturation {saturation(k_d, k_s):.3f}, needs "
            f"{GREYEST}); use method 'auto', which then goes by brightness"
        )
    body, _ = separate(linear, k_d, k_s)
    values = np.where(usable[..., None], np.maximum(body, 0), linear).astype(linear.dtype)
    luminance = linear @ LUMINANCE.astype(linear.dtype)
    parts = Split(
        k_d, k_s, "white, by default" if interface is None else "given", luminance, luminance, luminance, data
    )
    none = np.zeros_like(usable)
    message = "one body colour for the whole picture; noise grows by 1/saturation"
    report = _report("dichromatic", parts, usable, saturated, none, saturated, message)
    return HighlightRemoval(values, usable, none, saturated, report)


def _checked(name: str, mask: Mask | None, shape: tuple[int, ...], default: bool) -> Mask:
    if mask is None:
        return np.full(shape, default)
    if mask.shape != shape:
        raise ValueError(f"the mask {name!r} has the shape {mask.shape} and the picture {shape}; give one of its size")
    return mask


def _like(mask: Mask, picture: Picture) -> Bool[np.ndarray, "..."]:
    return mask if picture.ndim == 2 else mask[..., None]


def _far_from_data(removed: Removed, usable: Mask) -> Mask:
    """Filled pixels whose nearest pixel with data is too far for a guess."""
    distance = cv2.distanceTransform(removed.filled.astype(np.uint8), cv2.DIST_L2, 5)
    return removed.filled & (distance > max(4.0, _WIDEST_FILL * min(usable.shape)))


def _words(parts: Split | None, hole: Mask, unknown: Mask, grey: bool) -> str:
    words = []
    if parts is None:
        words.append("the picture is grey: spots found by brightness are filled" if grey else _NO_COLOUR)
    if not hole.any():
        words.append("no highlight was found: nothing is changed")
    if unknown.any():
        words.append("saturated pixels without data near by stay unknown")
    return "; ".join(words)


def _report(method: str, parts: Split | None, hole, saturated, filled, unknown, message: str) -> SpecularReport:
    return SpecularReport(
        method=method,
        body_colour=None if parts is None else tuple(parts.body_colour.tolist()),
        interface_colour=None if parts is None else tuple(map(float, parts.interface_colour)),
        interface_origin="none" if parts is None else parts.interface_origin,
        saturation=0.0 if parts is None else saturation(parts.body_colour, parts.interface_colour),
        highlights=int(hole.sum()),
        saturated=int(saturated.sum()),
        filled=int(filled.sum()),
        unknown=int(unknown.sum()),
        message=message,
    )
