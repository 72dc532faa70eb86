"""From a stored photograph to image irradiance: response inverted, one channel made, clipped and black pixels left out.

stored = response(gain · V(α) · ρ G(cos θ)/r²), so E = decode(stored)/V(α), known up to the gain.
"""

import math
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from jaxsfs.camera import AbstractCamera
from jaxsfs.differences import correlated
from jaxsfs.forms import Scalar
from jaxsfs.irradiance import Irradiance
from jaxsfs.photometry import AbstractFalloff, AbstractResponse, NoFalloff, SRGBResponse

Weights = tuple[Scalar, Scalar, Scalar]

_CHANNELS: dict[str, Weights] = {
    "luminance": (0.2126, 0.7152, 0.0722),  # Rec. 709, linear light
    "red": (1.0, 0.0, 0.0),
    "green": (0.0, 1.0, 0.0),
    "blue": (0.0, 0.0, 1.0),
}
_SRGB = SRGBResponse()
_NO_FALLOFF = NoFalloff()
_PLATEAU = 0.005  # share of the pixels on the highest value that looks clipped
_STANDS_OUT = 4  # times as many as on each of the next values
_BELOW = 5  # next values that are looked at
_FAINTEST = 1e-7  # linear light, as a share of the brightest pixel; below it a range is 3000 times the nearest one


class Plateau(NamedTuple):
    """The highest stored `value` (full scale 1) and the `share` of the usable pixels that have it in a channel."""

    value: float
    share: float


class PhotoReport(eqx.Module):
    """What became of a photograph's pixels, each counted once, in this order: `outside` the mask or unusable in the
    file, where the camera has `no_ray`, `clipped`, `black`; the rest is `used`. `largest` E among the used ones."""

    pixels: int
    used: int
    outside: int
    no_ray: int
    clipped: int
    black: int
    largest: float

    def as_dict(self) -> dict[str, Any]:
        """Plain numbers under the field names."""
        return dict(vars(self))


def parse_channel(text: str) -> Weights:
    """`luminance`, `red`, `green`, `blue` or `R,G,B` (three weights ≥ 0, not all 0) as weights that sum to 1.

    Raises ValueError that lists the forms.
    """
    name = text.strip().lower()
    if name in _CHANNELS:
        return _CHANNELS[name]
    usage = f"write one of: {', '.join(_CHANNELS)}, or three weights such as 0,0.5,0.5"
    try:
        weights = [float(part) for part in name.split(",")]
    except ValueError:
        raise ValueError(f"channel {text!r} is unknown; {usage}") from None
    if len(weights) != 3 or not all(math.isfinite(w) and w >= 0 for w in weights) or sum(weights) <= 0:
        raise ValueError(f"channel {text!r} needs three weights of at least 0 that are not all 0; {usage}")
    red, green, blue = (w / sum(weights) for w in weights)
    return red, green, blue


def automatic_response(dtype: str) -> str:
    """The response that a stored type stands for: `srgb` for 8 bit, `linear` for 16 bit and float."""
    return "srgb" if dtype in ("uint8", "int8", "bool") else "linear"


def clipping_limit(dtype: str) -> float | None:
    """The stored value from which a pixel counts as clipped: the last two steps of an integer type; none for float."""
    if not np.issubdtype(np.dtype(dtype), np.integer):
        return None
    top = np.iinfo(dtype).max
    return (top - 1) / top


def plateau(
    photo: Float[np.ndarray, "height width *channels"],
    valid: Bool[np.ndarray, "height width"],
    limit: Scalar | None,
) -> Plateau | None:
    """Where clipping does not reach the type's `limit`, as in 8-bit data times 256: the highest value, if 0.5 % of the
    usable pixels have it, and four times as many as the values just below. None otherwise.

    The top of a smooth surface has about as many pixels on each of the highest values.
    """
    values = photo[valid].reshape(int(valid.sum()), -1).max(axis=-1, initial=0)
    highest = float(values.max(initial=0))
    if not highest > 0 or (limit is not None and highest >= limit):
        return None
    there, counts = np.unique(values[values > 0.8 * highest], return_counts=True)
    share = counts[-1] / len(values)
    below = counts[-1 - _BELOW : -1]
    if share < _PLATEAU or len(there) < 2 or counts[-1] < _STANDS_OUT * below.mean():
        return None
    return Plateau(highest, float(share))


def irradiance_of(
    photo: Float[np.ndarray, "height width *channels"],
    camera: AbstractCamera,
    *,
    valid: Bool[np.ndarray, "..."] | None = None,
    response: AbstractResponse = _SRGB,
    falloff: AbstractFalloff = _NO_FALLOFF,
    weights: Weights = _CHANNELS["luminance"],
    smooth_px: Scalar = 0.0,
    clip_limit: Scalar | None = 254 / 255,
    clipped: Bool[np.ndarray, "height width"] | None = None,
    black: Scalar = 0.0,
) -> tuple[Irradiance, PhotoReport]:
    """Image irradiance E = smooth(Σ w_i decode(stored_i))/V(α), up to the camera's gain, and what was left out.

    `photo`: stored values, (height, width) grey or (height, width, 3) red, green, blue; full scale is 1. `valid`:
    pixels to use. `weights`: of the channels in linear light. A pixel is clipped, and no data, where a channel with a
    weight reaches `clip_limit` (None: nothing is clipped) or where `clipped` says so, and black where the weighted
    linear light is not above `black`. `smooth_px`: σ of a Gaussian among the valid pixels; others neither give nor get
    anything. α is the angle between ray and optical axis.

    Raises ValueError for another size than the camera's or the mask's, a negative σ, and when no pixel is left.
    """
    height, width = photo.shape[:2]
    if (camera.width, camera.height) != (width, height):
        raise ValueError(size_message("the photograph", (width, height), camera))
    if valid is not None and valid.shape != (height, width):
        raise ValueError(
            f"the mask is {valid.shape[1]} x {valid.shape[0]} px and the photograph {width} x {height} px; "
            "give a mask of the photograph's size"
        )
    if photo.ndim == 3 and photo.shape[2] != 3:
        raise ValueError(f"a photograph has 1 or 3 channels, got {photo.shape[2]}")
    if not smooth_px >= 0:
        raise ValueError(f"the smoothing's sigma must be 0 or more pixels, got {smooth_px}")
    dtype = jnp.result_type(float)
    wanted = np.ones((height, width), bool) if valid is None else valid
    limit = math.inf if clip_limit is None else clip_limit
    marked = np.zeros((height, width), bool) if clipped is None else clipped
    kernel = gaussian_kernel(float(smooth_px), dtype)
    scalars = jax.tree.map(lambda x: jnp.asarray(x, dtype), (tuple(weights), limit, black))
    values, kinds = _irradiance(
        jnp.asarray(photo, dtype), jnp.asarray(wanted), jnp.asarray(marked), camera, response, falloff, kernel, *scalars
    )
    counts = np.bincount(np.asarray(kinds).ravel(), minlength=5)
    used, outside, no_ray, too_bright, black_pixels = (int(count) for count in counts)
    if not used:
        raise ValueError(_nothing_left_message(outside, no_ray, too_bright, black_pixels))
    largest = float(jax.lax.stop_gradient(values).max())  # a report is no part of what is differentiated
    report = PhotoReport(height * width, used, outside, no_ray, too_bright, black_pixels, largest)
    return Irradiance(values, kinds == 0), report


@jax.jit
def _irradiance(photo, wanted, marked, camera, response, falloff, kernel, weights, limit, black):
    """E, and per pixel 0 used, 1 outside, 2 no ray, 3 clipped, 4 black."""
    if photo.ndim == 3:
        weight = jnp.stack(weights)
        linear = response.decode(photo) @ weight
        clipped = ((photo >= limit) & (weight > 0)[None, None]).any(axis=-1)
    else:
        linear = response.decode(photo)
        clipped = photo >= limit
    clipped = clipped | marked
    no_ray = ~camera.field(photo.dtype)
    no_data = ~wanted | no_ray | clipped
    brightest = jnp.max(jnp.where(no_data, 0, linear))
    dark = ~(linear > jnp.maximum(black, _FAINTEST * brightest))
    kinds = jnp.select([~wanted, no_ray, clipped, dark], [jnp.array(i, jnp.int32) for i in (1, 2, 3, 4)], 0)
    usable = kinds == 0
    linear = jnp.where(usable, linear, 0)
    if kernel is not None:
        linear = smoothed_within(linear, usable, kernel)
    vignette = falloff(camera.rays(photo.dtype)[..., 2])
    # a fall-off that reaches 0 has no light to divide by
    lit = usable & (vignette > 0)
    values = jnp.where(lit, linear / jnp.where(lit, vignette, 1), 0)
    return values, jnp.where(usable & ~lit, jnp.array(2, kinds.dtype), kinds)


def gaussian_kernel(sigma: float, dtype: jnp.dtype) -> Float[Array, " taps"] | None:
    """Odd kernel of sum 1 to four standard deviations of `sigma` px; None for 0."""
    if sigma == 0:
        return None
    reach = max(1, math.ceil(4 * sigma))
    kernel = np.exp(-0.5 * (np.arange(-reach, reach + 1) / sigma) ** 2)
    return jnp.asarray(kernel / kernel.sum(), dtype)


def smoothed_within(
    image: Float[Array, "height width"], mask: Bool[Array, "height width"], kernel: Float[Array, " taps"] | None
) -> Float[Array, "height width"]:
    """`image` smoothed by `kernel` both ways among the pixels of `mask`, 0 elsewhere; others give nothing."""
    inside = jnp.where(mask, image, 0)
    if kernel is None:
        return inside
    weight = jnp.where(mask, _blurred(mask.astype(image.dtype), kernel), 1)
    return jnp.where(mask, _blurred(inside, kernel) / weight, 0)


def _blurred(image: Float[Array, "height width"], kernel: Float[Array, " taps"]) -> Float[Array, "height width"]:
    """Separable convolution with a symmetric kernel, zeros beyond the image."""
    return correlated(correlated(image, kernel, 0), kernel, 1)


def size_message(what: str, size: tuple[int, int], camera: AbstractCamera) -> str:
    """What to say when an image of `size` (width, height) is not the camera's."""
    (width, height), (wide, high) = size, (camera.width, camera.height)
    message = f"{what} is {width} x {height} px, but the camera file is for {wide} x {high} px; "
    if abs(width * high - height * wide) <= max(wide, high):  # the same aspect to a pixel
        return message + (
            "the aspect is the same: resize the camera with the picture (in Python camera.resized("
            f"{width}, {height})), or give the picture in its original size"
        )
    return message + "give the picture in its original size, or crop the camera with it (camera.cropped in Python)"


def _nothing_left_message(outside: int, no_ray: int, clipped: int, black: int) -> str:
    total = outside + no_ray + clipped + black
    parts = {
        "outside the mask": outside,
        "without a ray of the camera": no_ray,
        "clipped": clipped,
        "black": black,
    }
    kinds = ", ".join(f"{count} {name}" for name, count in parts.items() if count)
    message = f"the photograph has no usable pixel: of {total}, {kinds}; "
    if black >= max(clipped, no_ray) and black > 0:
        return message + "a black picture holds no shading: check that it is the right file and the light was on"
    if clipped >= no_ray and clipped > 0:
        return message + "a white picture holds no shading: lower the exposure"
    return message + "check that mask and camera belong to this picture"
