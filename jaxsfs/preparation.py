"""From a stored photograph to the irradiance that shape from shading reads: highlights out, clipped pixels restored.

Order: the response is inverted, highlights are removed in linear light (Section 3 of the paper and beyond), clipped
pixels are restored as far as they can be, channels are weighted, and the fall-off is divided out.
"""

from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float

from jaxsfs.camera import AbstractCamera
from jaxsfs.forms import Scalar
from jaxsfs.irradiance import Irradiance
from jaxsfs.photo import PhotoReport, Weights, irradiance_of
from jaxsfs.photometry import AbstractFalloff, AbstractResponse, LinearResponse
from jaxsfs.specular import HighlightRemoval, Method, SpecularReport, remove_highlights, restore_clipped, untouched

_MOST_FILLED = 0.6  # of the usable pixels; beyond, a fill would be most of the picture


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
) -> Preparation:
    """Irradiance of a photograph of stored values (full scale 1) with highlights and clipping dealt with.

    `specular`: how highlights are removed, "off" to leave them in. Clipped pixels are measured in the channels that
    are not clipped, and otherwise filled by a smooth ln E of at least the limit, unless they are most of the picture;
    then they are left out. `blood`: exponent s of E ← E (E/½(G + B))^s, which takes out the darkening by blood; with
    its optical densities ε in the weighted channels and ε' in green and blue s = ε/(ε' − ε), about 0.15 for red (Beer
    and Lambert). It assumes that nothing but blood colours the tissue, and needs a colour photograph.

    Raises ValueError as `irradiance_of` and `remove_highlights` do.
    """
    usable = np.ones(photo.shape[:2], bool) if valid is None else valid
    linear = np.asarray(response.decode(jnp.asarray(photo, jnp.float32)))
    clipped = np.zeros(photo.shape, bool) if clip_limit is None else photo >= clip_limit
    counted = clipped if photo.ndim == 2 else np.asarray(np.any(clipped & (np.asarray(weights) > 0), axis=-1))
    known = usable & ~counted
    readable = photo.shape[:2] == (camera.height, camera.width) and known.any() and linear[known].max() > 0
    if specular == "off" or not readable:  # what is wrong with an unreadable picture is said below
        removal = untouched(linear, counted & usable)
    else:
        removal = remove_highlights(linear, usable, saturated=counted, method=specular)
    limit = 1.0 if clip_limit is None else float(response.decode(jnp.asarray(clip_limit, jnp.float32)))
    values, unknown, measured, filled = _restored(removal, clipped, usable, weights, limit)
    if blood:
        values = _without_blood(values, removal.values, float(blood))
    irradiance, report = irradiance_of(
        values.astype(np.float32),
        camera,
        valid=usable,
        response=LinearResponse(),
        falloff=falloff,
        weights=weights,
        smooth_px=smooth_px,
        clip_limit=None,
        clipped=unknown,
    )
    filled = filled | removal.filled
    return Preparation(irradiance, removal.highlights, measured, filled, report, removal.report)


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
