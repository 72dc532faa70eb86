"""Whether one body colour and the highlights' colour explain a whole picture, and that body colour."""

import cv2
import numpy as np
from jaxtyping import Bool, Float

from jaxsfs.specular._dichromatic import LUMINANCE, Vector
from jaxsfs.specular._local import blur_among, spread

_BLUR = 2.0  # px, σ: of the noise a seventh is left
_DARKEST = 0.15  # share of the bright end of the luminance below which chromaticities are noise
_FEWEST = 400  # pixels
_PLANAR, _PLANAR_TAIL = 0.002, 0.006  # spread across the line in chromaticity, 1σ and 95th percentile
_LONG = 3.0  # times that: spread along the line
_DIRECTION = 2.0  # degrees between the line and that towards the interface's colour
_PURE = 2.0  # percentile of the paleness that is the bare body


def one_body_colour(
    linear: Float[np.ndarray, "height width 3"], data: Bool[np.ndarray, "height width"], interface: Vector
) -> Vector | None:
    """k_d of luminance 1 if the picture is c_B k_d + c_I k_s with one k_d (eq. 7); None if not.

    Chromaticities I/ΣI then lie on the line from k_d's towards k_s's, and pale regions are veiled ones, however wide.
    Tissue whose own colour varies leaves the line, or runs along another: blood darkens green and blue at once and
    misses white by some ten degrees. k_d is the line's end away from k_s, which the bare body makes dense.
    """
    smooth = [blur_among(np.ascontiguousarray(linear[..., c], np.float32), data, _BLUR) for c in range(3)]
    colours = np.stack(smooth, axis=-1)
    inner = cv2.erode(data.astype(np.uint8), np.ones((9, 9), np.uint8), borderValue=0).astype(bool)
    brightness = colours @ LUMINANCE.astype(np.float32)
    if inner.sum() < _FEWEST:
        return None
    inner &= brightness > _DARKEST * np.percentile(brightness[inner], 95)
    if inner.sum() < _FEWEST:
        return None
    found = colours[inner].astype(np.float64)
    found /= found.sum(axis=1, keepdims=True)
    middle = np.median(found, axis=0)
    _, axes = np.linalg.eigh(np.cov((found - middle).T))
    along, across = ((found - middle) @ axes[:, i] for i in (2, 1))
    towards = interface / interface.sum() - middle
    cosine = float(axes[:, 2] @ towards) / max(float(np.linalg.norm(towards)), 1e-12)
    planar = spread(across) < _PLANAR and np.percentile(np.abs(across), 95) < _PLANAR_TAIL
    if not planar:
        return None
    direction = np.sign(cosine) * axes[:, 2]
    if along.std() < _LONG * across.std():
        direction = towards / np.linalg.norm(towards)  # a few glints at most: noise has no direction
    elif abs(cosine) < np.cos(np.deg2rad(_DIRECTION)):
        return None
    # noise spreads a dense end, 2.05 σ at that percentile
    end = np.percentile((found - middle) @ direction, _PURE) + 2.05 * spread(across)
    colour = np.maximum(middle + end * direction, 1e-6)
    return colour / (LUMINANCE @ colour)
