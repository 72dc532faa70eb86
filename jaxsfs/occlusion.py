"""Occluding contours from brightness alone: where a front must not cross, since range jumps.

At the limb of a smooth body the surface turns away from the light: cos θ falls like the square root of the distance
to the limb, so q = E^{2/a} (G = cos^a, r nearly constant) falls to zero in a straight line. A pixel is beside a limb
where that line, drawn through the pixels before it, reaches zero within two pixels, while the picture goes on: what
follows is brighter somewhere along the contour, and nowhere falls further. A shadow line of a smooth wall levels out
before it is dark, a concave crease falls in a straight line to something far from zero; neither is taken.
(Brightness that vanishes at limbs: Horn & Brooks 1989, ch. 1; local solutions between cuts: Breuß et al. 2012.)
"""

import cv2
import numpy as np
from jaxtyping import Bool, Float
from skimage.filters import apply_hysteresis_threshold
from skimage.morphology import remove_small_objects, skeletonize

Picture = Float[np.ndarray, "height width"]
Mask = Bool[np.ndarray, "height width"]

_SCALES = (1, 2, 4)  # px: blur and noise hide from one scale what a coarser one shows
_REACH = 2.0  # px from a pixel to the zero of its line
_WEAK, _STRONG = -1.0, 0.25  # ln q after over before: along a contour, and somewhere on it
_SHORTEST = 8  # px: a shorter contour holds nothing back
_DIRECTIONS = ((1, 0), (0, 1), (1, 1), (1, -1))
_DISC = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * _SCALES[-1] + 1,) * 2)


def find_occlusions(irradiance: Picture, valid: Mask, exponent: float | int = 1.0) -> Mask:
    """Pixels of occluding contours, closed against diagonal steps: no 8-neighbour of one side is on the other.

    `irradiance`: E where `valid`. `exponent`: the a of G = cos^a. Thresholds were chosen on `data_synth`'s tuning
    seeds (`experiments/occlusions.py`).
    """
    q = np.where(valid, np.maximum(irradiance, 0), 0).astype(np.float32)
    peak = float(q.max(initial=0.0))
    if not peak > 0:
        return np.zeros_like(valid)
    q = (q / peak) ** (2 / exponent)
    found = [_contours(q, valid, scale) for scale in _SCALES if min(valid.shape) >= 16 * scale]
    if not found:
        return np.zeros_like(valid)
    thin = found[0] | skeletonize(np.any(found, axis=0))
    # what two scales put on two sides of one limb is one contour
    joined = cv2.morphologyEx(thin.astype(np.uint8), cv2.MORPH_CLOSE, _DISC) > 0
    return _without_diagonal_gaps(joined & valid, q) & valid


def _contours(q: Picture, valid: Mask, scale: int) -> Mask:
    """Limb pixels of the picture at 1/scale of its size, on the picture."""
    if scale > 1:
        whole = _block_means(valid.astype(np.float32), scale) > 0.99
        contours = _contours(_block_means(q, scale), whole, 1)
        return np.kron(contours, np.ones((scale, scale), bool))[: q.shape[0], : q.shape[1]]
    rise = _limb_rise(np.where(valid, q, 0), valid)
    contours = apply_hysteresis_threshold(rise, _WEAK, _STRONG)
    return remove_small_objects(contours, max_size=_SHORTEST - 1, connectivity=2)


def _without_diagonal_gaps(line: Mask, q: Picture) -> Mask:
    """Where `line` goes on diagonally only, the darker of the two pixels between becomes part of it."""
    closed = line.copy()
    for near, far in ((np.s_[:-1], np.s_[1:]), (np.s_[1:], np.s_[:-1])):
        # corners of every square of four pixels: a and d on the diagonal, b and c between them
        (a, b, c, d), values = (
            [image[row, column] for row in (near, far) for column in (np.s_[:-1], np.s_[1:])] for image in (line, q)
        )
        gap = a & d & ~b & ~c
        darker = values[1] < values[2]
        closed[near, 1:] |= gap & darker
        closed[far, :-1] |= gap & ~darker
    return closed


def _limb_rise(q: Picture, valid: Mask) -> Picture:
    """ln of q behind over q at the limb, the most of eight directions; −∞ where there is no limb."""
    rise = np.full_like(q, -np.inf)
    floor = np.finfo(q.dtype).tiny
    for du, dv in _DIRECTIONS:
        for sign in (1, -1):
            steps = [_shifted(q, sign * n * du, sign * n * dv) for n in (-2, -1, 1, 2)]
            farther, before, next_one, one_after = steps
            slope = 0.5 * (farther - q)
            ends = (farther > before) & (before > q) & (q < _REACH * slope)
            # brighter behind, or at least no longer falling
            goes_on = (np.maximum(next_one, one_after) > q) | (one_after > 0.9 * next_one)
            log = np.log(np.maximum(np.maximum(next_one, one_after), floor) / np.maximum(q, floor))
            rise = np.where(valid & ends & goes_on, np.maximum(rise, log), rise)
    return rise


def _shifted(image: Picture, du: int, dv: int) -> Picture:
    """image(u + du, v + dv); 0 beyond it."""
    reach = max(abs(du), abs(dv))
    padded = np.pad(image, reach)
    height, width = image.shape
    return padded[reach + dv : reach + dv + height, reach + du : reach + du + width]


def _block_means(image: Picture, scale: int) -> Float[np.ndarray, "rows columns"]:
    height, width = (-(-size // scale) * scale for size in image.shape)
    padded = np.pad(image, ((0, height - image.shape[0]), (0, width - image.shape[1])))
    return padded.reshape(height // scale, scale, width // scale, scale).mean(axis=(1, 3))
