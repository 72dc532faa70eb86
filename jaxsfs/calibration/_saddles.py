"""Corners where four squares of a checkerboard meet, to a few hundredths of a pixel."""

import cv2
import numpy as np
from jaxtyping import Float
from scipy import ndimage

from jaxsfs.calibration._field import Photograph

_FIRST = 12  # fewer peaks are no board
_EVEN = 6  # of the smoothing: the scale of light and shade that is divided out
_STEPS = 8


def saddle_points(photo: Photograph) -> Float[np.ndarray, "count 2"]:
    """Strong minima of the Hessian's determinant, refined."""
    grey = (photo.grey / max(float(np.percentile(photo.grey, 99.5)), 0.05)).astype(np.float32)
    sigma = smoothing(photo)
    smooth = ndimage.gaussian_filter(grey, sigma)
    fall, run = np.gradient(smooth)
    (yy, xy), xx = np.gradient(fall), np.gradient(run, axis=1)
    saddle = np.maximum(xy**2 - xx * yy, 0) * photo.usable
    score = saddle / (ndimage.gaussian_filter(grey, _EVEN * sigma) + 0.05) ** 2
    peak = (score == ndimage.maximum_filter(score, int(4 * sigma) | 1)) & (saddle > 0)
    if peak.sum() < _FIRST:
        return np.zeros((0, 2))
    strong = peak & (score > 0.15 * np.median(np.sort(score[peak])[-40:]))
    v, u = np.nonzero(strong)
    corners = np.stack([u, v], axis=1).astype(float)
    refined = refined_saddles(photo, corners, sigma)
    # an end of the board draws the search away: it is no corner of four squares
    return refined[np.hypot(*(refined - corners).T) < sigma]


def smoothing(photo: Photograph) -> float:
    """sd in px of the Gaussian under which corners are looked for."""
    return max(1.5, photo.size[0] / 400)


def refined_saddles(
    photo: Photograph, corners: Float[np.ndarray, "count 2"], sigma: float
) -> Float[np.ndarray, "count 2"]:
    """Where the gradient of the smoothed light is 0 near each corner, by Newton's method: a corner keeps its place
    under any symmetric blur, and under shade once the local mean is divided out."""
    even = photo.linear / (ndimage.gaussian_filter(photo.linear, _EVEN * sigma) + 1e-3)
    orders = ((0, 1), (1, 0), (0, 2), (1, 1), (2, 0))
    fields = [_derivative(even, sigma, *order) for order in orders]
    at = corners.astype(float)
    for _ in range(_STEPS if len(at) else 0):
        u, v = at.T.astype(np.float32)
        values = [cv2.remap(field, u[None], v[None], cv2.INTER_CUBIC)[0].astype(float) for field in fields]
        by_u, by_v, uu, uv, vv = values
        fall = np.minimum(uu * vv - uv**2, -1e-9)  # a saddle's determinant is negative
        move = np.stack([uv * by_v - vv * by_u, uv * by_u - uu * by_v], axis=1) / fall[:, None]
        at = at + np.clip(move, -0.5, 0.5)
    return at


def _derivative(picture: Float[np.ndarray, "height width"], sigma: float, down: int, right: int) -> np.ndarray:
    """∂^(down + right) of the smoothed picture by v and u."""
    along = ndimage.gaussian_filter1d(picture, sigma, axis=0, order=down)
    return ndimage.gaussian_filter1d(along, sigma, axis=1, order=right).astype(np.float32)
