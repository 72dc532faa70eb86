"""How noisy a photograph is, and how much smoothing that asks for."""

import cv2
import numpy as np
from jaxtyping import Bool, Float

# The mask of Immerkær 1996 ("Fast noise variance estimation"): blind to planes, sum of squares 36.
_MASK = np.array([[1, -2, 1], [-2, 4, -2], [1, -2, 1]], np.float32)
# σ in px of the Gaussian for noise (sd, full scale 1) from each level on. Chosen by `experiments/photographs.py
# --smoothing`: 0.7 px halves the error at 0.4 % noise and changes clean scenes by less than 1e-3; edge-preserving
# (bilateral) smoothing of ln E was no better on any scene.
_LEVELS = ((0.0, 0.0), (5e-4, 0.7), (8e-3, 1.0), (1.5e-2, 1.5))


def noise_level(stored: Float[np.ndarray, "height width *channels"], valid: Bool[np.ndarray, "height width"]) -> float:
    """Standard deviation of the noise of stored values (full scale 1) among the valid pixels, channels averaged first.

    1.4826/6 · median |mask * image|: details that cover less than half of the picture do not count (Immerkær 1996,
    made robust). 0 where fewer than 100 pixels have all neighbours.
    """
    grey = np.asarray(stored if stored.ndim == 2 else stored.mean(axis=-1), np.float32)
    response = cv2.filter2D(grey, -1, _MASK)
    inner = cv2.erode(valid.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0
    inner[[0, -1]] = inner[:, [0, -1]] = False
    return float(1.4826 / 6 * np.median(np.abs(response[inner]))) if inner.sum() >= 100 else 0.0


def smoothing_for(noise: float) -> float:
    """σ in px of the Gaussian, in linear light, that suits photographs of this noise."""
    return next(sigma for level, sigma in reversed(_LEVELS) if noise >= level)
