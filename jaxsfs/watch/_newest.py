"""The newest frame of a source; older ones are dropped."""

import threading
import time
from collections.abc import Callable

import cv2
import numpy as np

from jaxsfs.files import InputError
from jaxsfs.files._frames import AbstractFrames, open_frames

Grab = Callable[[], np.ndarray | None]  # the next frame as red, green, blue; None at the end


class Newest:
    """Reads a source as fast as it comes and keeps the last frame only.

    `text`: the number of a camera, or a file or folder as `open_frames` takes it. A video plays at its own speed, so
    that what is shown is what a camera would have given; a folder gives a picture when asked, and drops none.
    """

    def __init__(self, text: str):
        self.dropped = 0
        self._frame: np.ndarray | None = None
        self._fresh = threading.Condition()
        self._over = False
        self._grab, self._close, self._waits = _source(text)
        self._error: BaseException | None = None
        self._thread = threading.Thread(target=self._read, name="jaxsfs-reader", daemon=True)
        self._thread.start()

    def next(self, timeout: float = 10.0) -> np.ndarray | None:
        """The newest frame that was not given yet; None when the source is over.

        Raises InputError where a camera gives none for `timeout` seconds, and what reading raised.
        """
        with self._fresh:
            if not self._fresh.wait_for(lambda: self._frame is not None or self._over, timeout):
                raise InputError(f"no frame came for {timeout:g} s; is the camera connected and free?")
            frame, self._frame = self._frame, None
            self._fresh.notify_all()
        if frame is None and self._error is not None:
            raise self._error
        return frame

    def close(self) -> None:
        """Lets go of the source."""
        with self._fresh:
            self._over = True
            self._fresh.notify_all()
        self._thread.join()
        self._close()

    def _read(self) -> None:
        try:
            while not self._over and (frame := self._grab()) is not None:
                with self._fresh:
                    if self._waits:
                        self._fresh.wait_for(lambda: self._frame is None or self._over)
                    self.dropped += self._frame is not None
                    self._frame = frame
                    self._fresh.notify_all()
        except Exception as error:  # raised again where the frame is awaited
            self._error = error
        finally:
            with self._fresh:
                self._over = True
                self._fresh.notify_all()


def _source(text: str) -> tuple[Grab, Callable[[], None], bool]:
    """How to get the next frame, how to end, and whether frames wait to be taken."""
    if text.isdecimal():
        return _camera(int(text))
    frames = open_frames(text)
    if frames.per_second is None:
        return _played(frames, None), frames.close, True
    return _played(frames, frames.per_second), frames.close, False


def _camera(number: int) -> tuple[Grab, Callable[[], None], bool]:
    video = cv2.VideoCapture(number)
    if not video.isOpened():
        raise InputError(f"there is no camera {number}; give the number of one that is connected, a video or a folder")

    def grab() -> np.ndarray | None:
        there, frame = video.read()
        return np.ascontiguousarray(frame[..., ::-1]) if there else None

    return grab, video.release, False


def _played(frames: AbstractFrames, per_second: float | None) -> Grab:
    started: list[float] = []
    numbers = iter(range(frames.count))

    def grab() -> np.ndarray | None:
        for number in numbers:
            started[:] = started or [time.monotonic()]
            if per_second is not None:
                time.sleep(max(0.0, started[0] + number / per_second - time.monotonic()))
            try:
                return frames.read(number)
            except InputError:  # one frame that cannot be decoded
                continue
        return None

    return grab
