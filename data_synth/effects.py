"""What a photograph adds to irradiance: colour, highlights, fall-off, blur, noise, clipping, tone curve, few bits.

stored = quantise(response(clip(noise(blur(gain · V(α) · (k_d E + k_s s cosⁿ2θ/r²)))))): the dichromatic model,
eq. (7), with a known body part.
"""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float, UInt8, UInt16
from scipy import ndimage

from data_synth.viewing import View
from jaxsfs.camera import AbstractCentralCamera
from jaxsfs.forms import Scalar
from jaxsfs.photometry import AbstractFalloff, AbstractResponse, NoFalloff, SRGBResponse

Colour = tuple[Scalar, Scalar, Scalar]
Picture = Float[np.ndarray, "height width 3"]

TISSUE: Colour = (0.75, 0.35, 0.28)  # linear red, green, blue of a mucosa
WHITE: Colour = (1.0, 1.0, 1.0)
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])  # weights of linear sRGB primaries (Rec. 709)

_SRGB = SRGBResponse()
_NO_FALLOFF = NoFalloff()


class Photo(eqx.Module):
    """A colour photograph of a scene, and the parts it was made of.

    `stored`: (height, width, 3) red, green, blue; whole numbers of 8 or 16 bit, or [0, 1] as float. `body` and
    `interface`: the two dichromatic parts in linear light with gain and fall-off, before blur, noise and clipping
    (1 = full scale). `gain`: linear light per unit of E of a body colour 1 where V = 1.
    """

    stored: UInt8[np.ndarray, "height width 3"] | UInt16[np.ndarray, "height width 3"] | Picture
    body: Picture
    interface: Picture
    gain: float


def body_image(view: View, colour: Colour | Picture = TISSUE) -> Picture:
    """Body part of the view in linear light: k_d E, k_d one colour or a colour per pixel."""
    return np.asarray(view.irradiance.values)[..., None] * np.asarray(colour, float)


def interface_image(view: View, strength: Scalar, lobe: Scalar = 40, colour: Colour = WHITE) -> Picture:
    """Highlights of the view in linear light: k_s s max(0, cos 2θ)ⁿ/r², n = `lobe`.

    The mirror direction is 2θ from the eye, where the light is too (Phong 1975). A distant light has no 1/r².
    """
    cosines = np.asarray(view.cosines)
    central = isinstance(view.camera, AbstractCentralCamera)
    arriving = 1 / np.asarray(view.surface.range) ** 2 if central else np.ones_like(cosines)
    values = strength * np.maximum(2 * cosines**2 - 1, 0) ** lobe * arriving
    return np.where(view.surface.valid, values, 0)[..., None] * np.asarray(colour, float)


def exposure(
    linear: Picture, valid: Bool[np.ndarray, "height width"], percentile: Scalar = 99, level: Scalar = 0.9
) -> float:
    """The gain that brings `percentile` of the brightest channel over the valid pixels to `level` of full scale.

    Raises ValueError where nothing is visible or all is black.
    """
    brightest = linear.max(axis=-1)[valid]
    reference = np.percentile(brightest, percentile) if brightest.size else 0.0
    if not reference > 0:
        raise ValueError("nothing to expose for: the scene fills no valid pixel of this camera, or is all black")
    return float(level / reference)


def blur(linear: Picture, valid: Bool[np.ndarray, "height width"], sigma_px: Scalar) -> Picture:
    """Gaussian blur among the valid pixels alone (the dark surround does not bleed in); 0 elsewhere."""
    if sigma_px == 0:
        return linear
    weight = ndimage.gaussian_filter(valid.astype(float), sigma_px)
    spread = ndimage.gaussian_filter(np.where(valid[..., None], linear, 0), (sigma_px, sigma_px, 0))
    return np.where(valid[..., None], spread / np.maximum(weight, 1e-12)[..., None], 0)


def add_noise(linear: Picture, *, seed: int, read: Scalar = 0.0, shot: Scalar = 0.0) -> Picture:
    """Adds Gaussian noise of variance read² + shot · value (full scale 1), the same for the same seed."""
    deviation = np.sqrt(read**2 + shot * np.maximum(linear, 0))
    return linear + deviation * np.random.default_rng(seed).standard_normal(linear.shape)


def quantise(stored: Picture, bits: int) -> UInt8[np.ndarray, "height width 3"] | UInt16[np.ndarray, "height width 3"]:
    """Values of [0, 1] as whole numbers of 8 or 16 bit, rounded to the nearest."""
    if bits not in (8, 16):
        raise ValueError(f"a stored photograph has 8 or 16 bits per channel, got {bits}")
    kind = np.uint8 if bits == 8 else np.uint16
    return np.rint(np.clip(stored, 0, 1) * np.iinfo(kind).max).astype(kind)


def take_photo(
    view: View,
    *,
    body_colour: Colour | Picture = TISSUE,
    interface_colour: Colour = WHITE,
    shine: Scalar = 0.0,
    lobe: Scalar = 40,
    glints: Float[np.ndarray, "height width"] | None = None,
    falloff: AbstractFalloff = _NO_FALLOFF,
    response: AbstractResponse = _SRGB,
    percentile: Scalar = 99,
    level: Scalar = 0.9,
    blur_px: Scalar = 0.0,
    read_noise: Scalar = 0.0,
    shot_noise: Scalar = 0.0,
    seed: int = 0,
    bits: int | None = 8,
) -> Photo:
    """A photograph of `view`.

    `shine` is the strength s of the highlights (0: none) relative to an albedo of 1, `glints` more of c_I in the
    unit of E (see `wet_glints`); the exposure is set on the body part, so highlights may clip. `bits`: 8, 16, or
    None for float values. Raises ValueError for an invisible scene.
    """
    valid = np.asarray(view.surface.valid)
    vignette = np.asarray(falloff(view.camera.rays()[..., 2]))[..., None]
    body = vignette * body_image(view, body_colour)
    gain = exposure(body, valid, percentile, level)
    body = gain * body
    interface = interface_image(view, shine, lobe, interface_colour)
    if glints is not None:
        interface = interface + glints[..., None] * np.asarray(interface_colour, float)
    interface = gain * vignette * interface
    linear = blur(body + interface, valid, blur_px)
    if read_noise or shot_noise:
        linear = np.where(valid[..., None], add_noise(linear, seed=seed, read=read_noise, shot=shot_noise), 0)
    stored = np.asarray(response.encode(jnp.asarray(np.clip(linear, 0, 1))))
    return Photo(stored if bits is None else quantise(stored, bits), body, interface, gain)
