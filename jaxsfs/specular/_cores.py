"""Saturated regions: which are the cores of highlights, and which are a near wall that saturates."""

import cv2
import numpy as np
from jaxtyping import Bool, Float

from jaxsfs.specular._detection import grown, outshines, touching
from jaxsfs.specular._dichromatic import Vector
from jaxsfs.specular._local import blur_among, local_ratio, regions, spread

Colours = Float[np.ndarray, "height width 3"]
Grey = Float[np.ndarray, "height width"]
Mask = Bool[np.ndarray, "height width"]

_PALE = 0.12  # of the way from the body's colour to the interface's
_LEAST_CONTRAST = 0.03  # |ln| between the two colours' ratios of two channels that shows paleness above colour errors
_FEWEST = 3  # pixels of a region


def highlight_cores(
    linear: Colours, luminance: Grey, saturated: Mask, usable: Mask, highlights: Mask, excess: Grey, interface: Vector
) -> Mask:
    """The `saturated` regions that are highlights and not body alone.

    Those that touch a found highlight, those that outshine what is round about, and those that are paler: where one
    channel is clipped, the ratio of the other two is nearer to that of the `interface` colour than it is around.
    """
    if not saturated.any():
        return saturated
    paleness, seen = _paleness(linear, saturated, usable, interface)
    # a near wall outshines what it hides, and its clipped channel makes it look pale: the other two tell
    body = seen & (blur_among(paleness.astype(np.float32), seen, 1.5) < _PALE)
    body |= _enclosed(saturated & ~seen, seen, body)
    whiter = saturated & ~body & (excess > 0.15 * luminance)  # a body that saturates keeps its colour for longer
    bright = outshines(luminance, whiter, usable, 1.5)
    return bright | touching(saturated, highlights, 3) | _paler(paleness, seen, saturated)


def _enclosed(parts: Mask, seen: Mask, body: Mask) -> Mask:
    """The `parts` without a colour of their own whose rim is body; that of a highlight's core is pale."""
    count, labels = regions(parts)
    wide = cv2.dilate(labels.astype(np.float32), np.ones((5, 5), np.uint8)).astype(np.int64)
    rim = seen & (wide > 0)
    share = np.bincount(wide[rim], body[rim], count) / np.maximum(np.bincount(wide[rim], minlength=count), 1)
    return parts & (share > 0.5)[labels]


def _paleness(linear: Colours, saturated: Mask, usable: Mask, interface: Vector) -> tuple[Grey, Mask]:
    """Where one channel alone is clipped: how far the other two are on the way to the interface's colour."""
    limit = linear.max(axis=-1)[saturated].min()
    clipped = (linear >= limit) & saturated[..., None]
    around = usable & ~grown(saturated, 1)
    paleness, seen = np.zeros(saturated.shape), np.zeros_like(saturated)
    for channel in range(3):
        first, second = (c for c in range(3) if c != channel)
        here = clipped[..., channel] & ~clipped[..., first] & ~clipped[..., second]
        if not here.any():
            continue
        body = np.log(_ratio(linear, first, second, around))
        contrast = float(np.log(interface[first] / interface[second])) - body
        shift = np.log(np.maximum(linear[..., first], 1e-5) / np.maximum(linear[..., second], 1e-5)) - body
        here &= np.abs(contrast) > _LEAST_CONTRAST
        paleness[here] = (shift / np.where(np.abs(contrast) > _LEAST_CONTRAST, contrast, 1.0))[here]
        seen |= here
    return paleness, seen


def _paler(paleness: Grey, seen: Mask, saturated: Mask) -> Mask:
    count, labels = regions(saturated)
    label, order = labels[seen], np.argsort(labels[seen], kind="stable")
    keep = np.zeros(count, bool)
    for part in np.split(order, np.cumsum(np.bincount(label, minlength=count))[:-1]):
        if len(part) >= _FEWEST:
            values = paleness[seen][part]
            keep[label[part[0]]] = np.median(values) > max(_PALE, 3 * spread(values) / np.sqrt(len(part)))
    return keep[labels] & saturated


def _ratio(linear: Colours, first: int, second: int, around: Mask) -> Grey:
    """Local ratio of two channels among what is `around`, within some ten px."""
    above, below = (np.ascontiguousarray(linear[..., c]) for c in (first, second))
    return np.maximum(local_ratio(above, below, around, 5.0), 1e-3)
