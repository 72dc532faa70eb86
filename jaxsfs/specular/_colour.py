"""The colours of a picture: its body's, its highlights', and the covariance of its noise."""

import cv2
import numpy as np
from jaxtyping import Bool, Float

from jaxsfs.specular._dichromatic import LUMINANCE, WHITE, Vector
from jaxsfs.specular._local import spread_from

Picture = Float[np.ndarray, "height width 3"]
Grey = Float[np.ndarray, "height width"]
Mask = Bool[np.ndarray, "height width"]

_DARKEST = 0.1  # share of the bright end of the luminance below which colours are noise
_FEWEST = 40  # pixels that a colour is estimated from
_FEWEST_SMALL = 20  # the same on highlights of a few pixels each
_PARALLEL = 0.05  # sine of an angle between colours below which they span no plane
# What endoscopes' light sources and white balances leave: no channel below a quarter of the strongest.
_MOST_TINTED = 0.25


def body_colour(linear: Picture, usable: Mask) -> Vector:
    """The dominant body colour k_d, of luminance 1: the median chromaticity of the pixels that are not dark.

    The median over the picture ignores highlights up to half of it. Raises ValueError where no pixel is usable.
    """
    values = linear[usable]
    if not values.size:
        raise ValueError("no usable pixel to estimate the body colour from: check the mask and the exposure")
    brightness = values @ LUMINANCE.astype(linear.dtype)
    lit = brightness >= _DARKEST * np.percentile(brightness, 95)
    lit &= brightness > 0
    if not lit.any():
        raise ValueError("the picture is black: it has no body colour")
    colour = np.median(values[lit] / brightness[lit, None], axis=0).astype(np.float64)
    return colour / (LUMINANCE @ colour)


def interface_colour(linear: Picture, excess: Grey, sample: Mask) -> Vector | None:
    """The highlights' colour k_s, its mean channel 1, from how each channel changes with the `excess` c_I; or None.

    k_s,c is the weighted median over `sample` of ∇I_c·∇c_I/|∇c_I|², weights |∇c_I|²: the steep flanks of highlights
    decide, where the smooth body hardly changes. None where there are too few pixels, or where the colour is none
    that a light source has.
    """
    if sample.sum() < _FEWEST:
        return None
    towards = _gradients(excess, sample)
    steepness = (towards**2).sum(axis=0)
    if not (steepness > 0).any():
        return None
    slopes = [(_gradients(linear[..., c], sample) * towards).sum(axis=0) for c in range(3)]
    colour = np.array([weighted_median(slope / np.maximum(steepness, 1e-30), steepness) for slope in slopes])
    if colour.min() < _MOST_TINTED * colour.max():
        return None
    return 3 * colour / colour.sum()


def added_colour(linear: Picture, sample: Mask, plain: Mask, body: Vector) -> Vector | None:
    """k_s, its mean channel 1, from what the pixels of `sample` have over the `plain` ones near by; or None.

    For highlights of a few pixels, which have no flank to measure slopes on. Highlights lie where the body is bright,
    so k_d of `body` is in what they add (`whitest_between`).
    """
    if sample.sum() < _FEWEST_SMALL or not plain.any():
        return None
    around = [spread_from(np.ascontiguousarray(linear[..., c]), plain)[sample] for c in range(3)]
    added = linear[sample].astype(np.float64) - np.stack(around, axis=-1)
    total = np.maximum(added.sum(axis=1), 0)
    if not (total > 0).any():
        return None
    colour = np.array([weighted_median(added[:, c] / np.maximum(total, 1e-9), total) for c in range(3)])
    return None if colour.min() < _MOST_TINTED * colour.max() else whitest_between(body, colour)


def whitest_between(body: Vector, colour: Vector) -> Vector | None:
    """The whitest colour in the plane of k_d and `colour`, its mean channel 1; None where they span none.

    Where the body brightens under its highlights, what they add is k_s and a multiple of k_d.
    """
    normal = np.cross(body / np.linalg.norm(body), colour / max(float(np.linalg.norm(colour)), 1e-12))
    if not np.linalg.norm(normal) > _PARALLEL:
        return None
    normal = normal / np.linalg.norm(normal)
    white = WHITE - (WHITE @ normal) * normal
    return 3 * white / white.sum() if white.min() >= _MOST_TINTED * white.max() else None


def _gradients(image: Grey, sample: Mask) -> Float[np.ndarray, "2 count"]:
    smooth = cv2.GaussianBlur(np.ascontiguousarray(image), (0, 0), 0.8)
    return np.stack([cv2.Sobel(smooth, -1, dx, 1 - dx)[sample].astype(np.float64) for dx in (1, 0)])


def noise_covariance(linear: Picture, usable: Mask) -> Float[np.ndarray, "3 3"]:
    """Covariance of the channels' noise: of the Laplacian of the picture, its largest tenth left out (edges).

    The Laplacian of white noise of variance σ² has 20 σ².
    """
    inner = _eroded(usable)
    if inner.sum() < 100:
        return np.eye(3)
    rough = np.stack([cv2.Laplacian(np.ascontiguousarray(linear[..., c]), -1)[inner] for c in range(3)], axis=-1)
    size = np.linalg.norm(rough, axis=1)
    calm = rough[size <= np.percentile(size, 90)].astype(np.float64)
    covariance = calm.T @ calm / (20 * len(calm))
    return covariance + 1e-6 * np.trace(covariance) * np.eye(3) + 1e-16 * np.eye(3)


def _eroded(mask: Mask) -> Mask:
    return cv2.erode(mask.astype(np.uint8), np.ones((3, 3), np.uint8), borderValue=0).astype(bool)


def weighted_median(values: Float[np.ndarray, "count"], weights: Float[np.ndarray, "count"]) -> float:
    """The value that half of the weight lies below."""
    order = np.argsort(values)
    below = np.cumsum(weights[order])
    return float(values[order][np.searchsorted(below, below[-1] / 2)])
