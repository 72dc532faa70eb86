"""From a stored photograph to the irradiance that shape from shading reads: highlights out, clipped pixels restored.

Order: the response is inverted, highlights are removed in linear light (Section 3 of the paper and beyond), clipped
pixels are restored as far as they can be, channels are weighted, and the fall-off is divided out.
"""

from typing import Any, NamedTuple

import cv2
import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float

from jaxsfs.camera import AbstractCamera
from jaxsfs.forms import Scalar
from jaxsfs.irradiance import Irradiance
from jaxsfs.photo import PhotoReport, Weights, irradiance_of
from jaxsfs.photometry import AbstractFalloff, AbstractResponse, LinearResponse
from jaxsfs.specular import (
    HighlightRemoval,
    Method,
    SpecularReport,
    lost_edges,
    remove_highlights,
    restore_clipped,
    untouched,
)

_MOST_FILLED = 0.6  # of the usable pixels; beyond, a fill would be most of the picture
_RIM = 0.25  # share of a block that must be usable
_ENOUGH = 400_000  # pixels to find highlights in: of 1280 × 960 px, half the size leaves no larger errors


class Preparation(eqx.Module):
    """`irradiance`; pixels where E was measured with a highlight on it (`highlights`) or in the channels that were not
    clipped (`measured`); pixels where E is a smooth `filled` guess, so that their range is one too; reports."""

    irradiance: Irradiance
    highlights: Bool[np.ndarray, "height width"]
    measured: Bool[np.ndarray, "height width"]
    filled: Bool[np.ndarray, "height width"]
    photo: PhotoReport
    specular: SpecularReport

    def figures(self) -> dict[str, Any]:
        """Counts and colours, ready for JSON."""
        return {
            "highlights": self.specular.as_dict(),
            "restored_from_other_channels": int(self.measured.sum()),
            "filled_from_surroundings": int(self.filled.sum()),
        }


def prepare(
    photo: Float[np.ndarray, "height width *channels"],
    camera: AbstractCamera,
    *,
    response: AbstractResponse,
    falloff: AbstractFalloff,
    weights: Weights,
    valid: Bool[np.ndarray, "height width"] | None = None,
    specular: Method = "auto",
    clip_limit: Scalar | None = 254 / 255,
    smooth_px: Scalar = 0.0,
    blood: Scalar = 0.0,
    shrink: int | None = None,
    interface: Float[np.ndarray, "3"] | None = None,
) -> Preparation:
    """Irradiance of a photograph of stored values (full scale 1) with highlights and clipping dealt with.

    `specular`: how highlights are removed, "off" to leave them in. Clipped pixels are measured in the channels that
    are not clipped, and otherwise filled smoothly with at least the limit, unless they are most of the picture;
    then they are left out. `blood`: exponent s of E ← E (E/½(G + B))^s, which takes out the darkening by blood; with
    its optical densities ε in the weighted channels and ε' in green and blue s = ε/(ε' − ε), about 0.15 for red (Beer
    and Lambert). It assumes that nothing but blood colours the tissue, and needs a colour photograph.

    `shrink`: highlights and clipping are dealt with on a picture of 1/shrink of the size; if not given, of some 400 000
    pixels, and never more than the photograph has. `interface`: the highlights' colour k_s in linear light, estimated
    from the picture if not given.

    Raises ValueError as `irradiance_of` and `remove_highlights` do.
    """
    usable = np.ones(photo.shape[:2], bool) if valid is None else valid
    linear = np.asarray(response.decode(jnp.asarray(photo, jnp.float32)))
    clipped = np.zeros(photo.shape, bool) if clip_limit is None else photo >= clip_limit
    counted = clipped if photo.ndim == 2 else np.asarray(np.any(clipped & (np.asarray(weights) > 0), axis=-1))
    known = usable & ~counted
    readable = photo.shape[:2] == (camera.height, camera.width) and known.any() and linear[known].max() > 0
    limit = 1.0 if clip_limit is None else float(response.decode(jnp.asarray(clip_limit, jnp.float32)))
    method = specular if readable else "off"  # what is wrong with an unreadable picture is said below
    stored = _Stored(linear, usable, clipped, counted)
    shrink = max(1, round((usable.size / _ENOUGH) ** 0.5)) if shrink is None else shrink
    if shrink == 1 or not readable:
        body = _body(stored, weights, limit, method, interface)
    else:
        read = _shrunk(stored, shrink)
        body = _enlarged(_body(read, weights, limit, method, interface), read, stored, weights)
    values = body.values
    if blood:
        values = _without_blood(values, body.linear, float(blood))
    irradiance, report = irradiance_of(
        values.astype(np.float32),
        camera,
        valid=usable,
        response=LinearResponse(),
        falloff=falloff,
        weights=weights,
        smooth_px=smooth_px,
        clip_limit=None,
        clipped=body.unknown,
    )
    return Preparation(irradiance, body.highlights, body.measured, body.filled, report, body.report)


class _Stored(NamedTuple):
    """Linear light, the pixels to use, the channels that are clipped, and the pixels where that counts."""

    linear: Float[np.ndarray, "height width *channels"]
    usable: Bool[np.ndarray, "height width"]
    clipped: Bool[np.ndarray, "height width *channels"]
    counted: Bool[np.ndarray, "height width"]


class _Body(NamedTuple):
    """Weighted light without highlights and clipping, and the channels it is made of; pixels that stay unknown,
    had a highlight, are measured in other channels, or filled."""

    values: Float[np.ndarray, "height width"]
    linear: Float[np.ndarray, "height width *channels"]
    unknown: Bool[np.ndarray, "height width"]
    highlights: Bool[np.ndarray, "height width"]
    measured: Bool[np.ndarray, "height width"]
    filled: Bool[np.ndarray, "height width"]
    report: SpecularReport


def _body(stored: _Stored, weights: Weights, limit: float, method: Method, interface) -> _Body:
    linear, usable, clipped, counted = stored
    if method == "off":
        removal = untouched(linear, counted & usable)
    else:
        removal = remove_highlights(linear, usable, saturated=counted, method=method, interface=interface)
    values, unknown, measured, filled = _restored(removal, clipped, usable, weights, limit)
    filled = filled | removal.filled
    return _Body(values, removal.values, unknown, removal.highlights, measured, filled, removal.report)


def _shrunk(stored: _Stored, shrink: int) -> _Stored:
    """The picture at 1/shrink of its size: means of the usable pixels of blocks."""
    height, width = stored.usable.shape
    size = (max(1, width // shrink), max(1, height // shrink))

    def means(x):
        return cv2.resize(x.astype(np.float32), size, interpolation=cv2.INTER_AREA)

    share = means(stored.usable)
    usable = share > _RIM
    counted, clipped = (means(x & _like(stored.usable, x)) > 0 for x in (stored.counted, stored.clipped))
    if not (usable & ~counted).any():
        return stored
    total = means(np.where(_like(stored.usable, stored.linear), stored.linear, 0))
    linear = np.where(_like(usable, total), total / _like(np.maximum(share, _RIM), total), 0)
    return _Stored(linear, usable, clipped, counted)


def _enlarged(small: _Body, read: _Stored, stored: _Stored, weights: Weights) -> _Body:
    """`small`, found in what was `read`, at full size where it changed anything, the picture itself elsewhere."""
    height, width = stored.usable.shape
    # the field's rim is in blocks that are hardly usable: they are what is beside them
    beside = cv2.dilate(read.usable.astype(np.uint8), np.ones((3, 3), np.uint8)).astype(bool) & ~read.usable

    def large(mask):
        mask = mask | (beside & cv2.dilate(mask.astype(np.uint8), np.ones((3, 3), np.uint8)).astype(bool))
        return (cv2.resize(mask.astype(np.uint8), (width, height), interpolation=cv2.INTER_NEAREST) > 0) & stored.usable

    def smooth(values):
        values = values.astype(np.float32)
        spread = cv2.blur(np.where(_like(read.usable, values), values, 0), (3, 3))
        share = cv2.blur(read.usable.astype(np.float32), (3, 3))
        values = np.where(_like(beside, values), spread / _like(np.maximum(share, 1e-3), values), values)
        return cv2.resize(values, (width, height), interpolation=cv2.INTER_LINEAR)

    highlights, measured, filled = large(small.highlights), large(small.measured), large(small.filled)
    changed = highlights | measured | filled
    linear = stored.linear
    grey = linear if linear.ndim == 2 else linear @ np.asarray(weights, linear.dtype)
    edges = np.exp(_edges(small, stored, highlights & ~filled))
    values = np.where(changed, smooth(small.values) * edges, grey)
    body = smooth(small.linear) * _like(edges, linear)
    linear = np.where(_like(changed, linear), body, linear)
    unknown = (large(small.unknown) & changed) | (stored.counted & stored.usable & ~changed)
    area = unknown.size / small.unknown.size
    counts = int(highlights.sum()), int((stored.counted & stored.usable).sum())
    guessed = (round(area * small.report.filled), round(area * small.report.unknown))
    report = eqx.tree_at(lambda r: (r.highlights, r.saturated, r.filled, r.unknown), small.report, counts + guessed)
    return _Body(values, linear, unknown, highlights, measured, filled, report)


def _edges(small: _Body, stored: _Stored, where) -> Float[np.ndarray, "height width"]:
    """ln of what the smaller picture has blurred of the body under highlights, where colour shows the body."""
    report = small.report
    if report.method != "adaptive" or report.body_colour is None or not where.any():
        return np.zeros(where.shape, np.float32)
    shrink = round((where.size / small.unknown.size) ** 0.5)
    body, interface = (np.asarray(colour, float) for colour in (report.body_colour, report.interface_colour))
    return lost_edges(stored.linear, stored.usable & ~stored.counted, where, body, interface, shrink)


def _like(mask, picture):
    return mask if picture.ndim == 2 else mask[..., None]


def _restored(removal: HighlightRemoval, clipped, usable, weights: Weights, limit: float):
    """Values, pixels that stay unknown, pixels measured in other channels, pixels filled."""
    values = removal.values
    # the clipping of a highlight's core says nothing of the body under it
    unknown = removal.unknown & ~removal.highlights & usable
    share = np.asarray(weights, np.float32) if values.ndim == 3 else np.zeros(0, np.float32)
    if unknown.sum() > _MOST_FILLED * usable.sum() or not unknown.any():
        grey = values if values.ndim == 2 else values @ share
        return grey, unknown, np.zeros_like(unknown), np.zeros_like(unknown)
    found = restore_clipped(values, unknown, clipped, usable, share, limit)
    return found.values, unknown & ~found.measured & ~found.filled, found.measured, found.filled


def _without_blood(values, linear, exponent: float):
    if linear.ndim != 3:
        raise ValueError("blood shows in colour only; a grey photograph needs blood = 0")
    others = np.maximum(0.5 * (linear[..., 1] + linear[..., 2]), 1e-6)
    return np.where(values > 0, values * (np.maximum(values, 1e-9) / others) ** exponent, 0)
