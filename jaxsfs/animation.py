"""The paper's method as a moving picture: the front of constant range advances over the photograph."""

from collections.abc import Iterator

import cv2
import numpy as np
from jaxtyping import Float, UInt8
from skimage.measure import find_contours

_LARGEST = 480  # px: long side of a frame
_AHEAD = 0.3  # brightness of what the front has not reached
_FRONT = (255, 225, 80)
_TRAIL = (90, 190, 120)
_TRAIL_EVERY = 6  # frames
_LAST = 0.995  # of the pixels are reached in the last frame; the rest may be far behind them


def front_frames(
    rgb: UInt8[np.ndarray, "height width 3"],
    time: Float[np.ndarray, "height width"],
    *,
    frames: int = 48,
    label: str = "r = {:.4g}",
    logarithmic: bool = True,
) -> Iterator[UInt8[np.ndarray, "_ _ 3"]]:
    """Pictures of the front {w = s} at even steps of its time s, from the first arrival to the last.

    `time`: when the front arrives at each pixel, w = ln r for a light at the camera (then `logarithmic`), z for a
    distant one; NaN where it never does. Behind the front the photograph is bright, ahead of it dark; earlier fronts
    stay as thin lines. `label` is formatted with r = e^s (or s). Long side at most 480 px.
    Raises ValueError where no pixel is reached and for fewer than two frames.
    """
    if frames < 2:
        raise ValueError(f"an animation needs at least 2 frames, got {frames}")
    reached = np.isfinite(time)
    if not reached.any():
        raise ValueError("the front reaches no pixel: there is nothing to animate")
    factor = min(1.0, _LARGEST / max(time.shape))
    # even sizes: video codecs want them
    width, height = (max(2, 2 * round(0.5 * factor * side)) for side in time.shape[::-1])
    photo = cv2.resize(rgb, (width, height), interpolation=cv2.INTER_AREA).astype(np.float32)
    rows = np.minimum((np.arange(height) + 0.5) / height * time.shape[0], time.shape[0] - 1).astype(int)
    columns = np.minimum((np.arange(width) + 0.5) / width * time.shape[1], time.shape[1] - 1).astype(int)
    small = time[np.ix_(rows, columns)]
    moments = np.linspace(np.nanmin(small), np.nanquantile(small, _LAST), frames)
    trails: list[list[np.ndarray]] = []
    for number, moment in enumerate(moments):
        lines = _front(small, moment)
        yield _drawn(photo, small, moment, lines, trails, label.format(np.exp(moment) if logarithmic else moment))
        if number % _TRAIL_EVERY == 0:
            trails.append(lines)


def _drawn(photo, time, moment: float, lines, trails, text: str) -> UInt8[np.ndarray, "_ _ 3"]:
    behind = np.where(np.nan_to_num(time, nan=np.inf) <= moment, 1.0, _AHEAD).astype(np.float32)
    frame = np.round(photo * behind[..., None]).astype(np.uint8)
    for trail in trails:
        cv2.polylines(frame, trail, False, _TRAIL, 1, cv2.LINE_AA, 4)
    cv2.polylines(frame, lines, False, _FRONT, 2, cv2.LINE_AA, 4)
    font, size, bottom = cv2.FONT_HERSHEY_SIMPLEX, frame.shape[0] / 700 + 0.15, frame.shape[0] - 10
    (wide, high), below = cv2.getTextSize(text, font, size, 1)
    cv2.rectangle(frame, (4, bottom - high - 5), (wide + 12, bottom + below), (0, 0, 0), -1)
    cv2.putText(frame, text, (8, bottom), font, size, (255, 255, 255), 1, cv2.LINE_AA)
    return frame


def _front(time: Float[np.ndarray, "height width"], moment: float) -> list[np.ndarray]:
    """The level set as polylines for OpenCV: (u, v) in sixteenths of a pixel."""
    known = np.isfinite(time)
    if min(known.shape) < 2:
        return []
    lines = find_contours(np.where(known, time, 0), moment, mask=known)
    return [np.round(16 * line[:, ::-1]).astype(np.int32)[:, None] for line in lines]
