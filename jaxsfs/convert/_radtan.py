"""The pinhole with radial and tangential distortion, as OpenCV has it, as far as it is one-to-one."""

from collections.abc import Sequence

import cv2
import numpy as np
from jaxtyping import Float

LENGTHS = (4, 5, 8, 12, 14)  # of OpenCV's coefficient vectors
_DIRECTIONS, _STEPS = 96, 400


def radtan_samples(
    size: tuple[int, int], intrinsics: tuple[float, float, float, float], coefficients: Sequence[float]
) -> tuple[Float[np.ndarray, "count 3"], Float[np.ndarray, "count 2"]]:
    """Rays and the pixels of the image that see them, from the axis outwards until the distortion turns back.

    The polynomial grows only up to some angle, beyond which calibrations never looked; rays from there would fall back
    into the image. Raises ValueError when no pixel is left.
    """
    fx, fy, cx, cy = intrinsics
    turn = np.linspace(0, 2 * np.pi, _DIRECTIONS, endpoint=False)
    slope = np.concatenate([np.linspace(0, 1.5, _STEPS // 2), np.geomspace(1.5, 20, _STEPS // 2)[1:]])
    rays = np.stack(np.broadcast_arrays(np.cos(turn)[:, None] * slope, np.sin(turn)[:, None] * slope, 1.0), axis=-1)
    matrix = np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]], float)
    flat = rays.reshape(-1, 1, 3)
    pixels = cv2.projectPoints(flat, np.zeros(3), np.zeros(3), matrix, np.asarray(coefficients, float))[0]
    pixels = pixels.reshape(*rays.shape[:2], 2)
    radius = np.linalg.norm((pixels - (cx, cy)) / (fx, fy), axis=-1)
    growing = np.concatenate([np.ones((_DIRECTIONS, 1), bool), np.diff(radius, axis=1) > 0], axis=1)
    one_to_one = np.logical_and.accumulate(growing, axis=1)
    border = np.array(size) - 0.5
    shown = one_to_one & np.all((pixels >= -0.5) & (pixels <= border), axis=-1)
    if shown.sum() < 100:
        raise ValueError(
            f"the lens shows almost nothing in an image of {size[0]} x {size[1]} px: check focal lengths "
            f"({fx:g}, {fy:g} px), centre ({cx:g}, {cy:g}) and distortion"
        )
    return rays[shown] / np.linalg.norm(rays[shown], axis=-1, keepdims=True), pixels[shown]
