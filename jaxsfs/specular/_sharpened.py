"""A body image found on a smaller picture, with the edges that colour shows at full size inside highlights."""

import cv2
import numpy as np
from jaxtyping import Bool, Float

from jaxsfs.specular._colour import noise_covariance
from jaxsfs.specular._dichromatic import Vector, body_strength, interface_free_vector
from jaxsfs.specular._local import blur_among, noise_by_level

Grey = Float[np.ndarray, "height width"]
Mask = Bool[np.ndarray, "height width"]

_BLUR = 1.0  # px per px of shrinking: σ within which an edge stands out from noise
_SUSPICION = 1.5  # times the noise's variance that detail must exceed
_STEEPEST = 1.0  # |ln| of detail


def lost_edges(
    linear: Float[np.ndarray, "height width 3"], data: Mask, where: Mask, body: Vector, interface: Vector, shrink: int
) -> Grey:
    """Detail of ln(a·I), a ⟂ k_s, that a picture of 1/`shrink` of the size has lost; 0 but in `data` and `where`.

    A veil covers contours too, and a contour that is blurred stops no front. What is noise is left out by Wiener's
    gain 1 − σ²/d² with the local mean of d².
    """
    light = body_strength(linear, interface_free_vector(body, interface, noise_covariance(linear, data)), body)
    light = np.ascontiguousarray(light, np.float32)
    floor = np.float32(0.02 * np.percentile(light[data], 95))
    known = data & (light > floor)
    level = np.maximum(light, floor)
    detail = np.log(level)
    detail = np.where(known, detail - _mean(detail, known, shrink), 0)
    noise = np.where(known, (noise_by_level(light, level, data) / level) ** 2, 0)
    sigma = _BLUR * shrink
    energy = blur_among(detail**2, known, sigma)
    gain = 1 - _SUSPICION * blur_among(noise.astype(np.float32), known, sigma) / np.maximum(energy, 1e-12)
    return np.where(where & known, np.clip(gain, 0, 1) * np.clip(detail, -_STEEPEST, _STEEPEST), 0).astype(np.float32)


def _mean(values: Grey, known: Mask, shrink: int) -> Grey:
    """Through blocks of `shrink` px and back, as the smaller picture goes."""
    height, width = known.shape
    size = (max(1, width // shrink), max(1, height // shrink))

    def through(x):
        small = cv2.resize(x.astype(np.float32), size, interpolation=cv2.INTER_AREA)
        return cv2.resize(small, (width, height), interpolation=cv2.INTER_LINEAR)

    return through(np.where(known, values, 0)) / np.maximum(through(known), 1e-3)
