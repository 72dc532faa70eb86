"""Depth as colours over the picture."""

import cv2
import numpy as np
from jaxtyping import Shaped, UInt8

from jaxsfs.forms import Scalar
from jaxsfs.frames import FrameResult, as_float
from jaxsfs.pictures import depth_picture


def overlay(
    stored: Shaped[np.ndarray, "height width *channels"], result: FrameResult, strength: Scalar = 0.6
) -> UInt8[np.ndarray, "height width 3"]:
    """The frame with its range over it, yellow near to violet far; the frame itself where there is no surface.

    `result` may be of a reduced size. `strength`: share of the colours, 0 to 1.
    """
    grey = stored if stored.ndim == 3 else np.repeat(stored[..., None], 3, axis=-1)
    picture = np.round(255 * np.clip(as_float(grey), 0, 1)).astype(np.uint8)
    height, width = picture.shape[:2]
    colours = depth_picture(result.range, result.valid)
    size = (width, height)
    colours = cv2.resize(colours, size, interpolation=cv2.INTER_NEAREST)
    valid = cv2.resize(result.valid.astype(np.uint8), size, interpolation=cv2.INTER_NEAREST) > 0
    mixed = cv2.addWeighted(picture, 1 - float(strength), colours, float(strength), 0)
    return np.where(valid[..., None], mixed, picture)
