"""Frames one after the other: a video, a folder of pictures, a DICOM file."""

import abc
import os
import re
from pathlib import Path

import cv2
import numpy as np
from jaxtyping import Shaped

from jaxsfs.files._atomic import InputError
from jaxsfs.files._photo import decode_picture

Stored = Shaped[np.ndarray, "height width *channels"]

_PICTURES = frozenset((".png", ".jpg", ".jpeg", ".bmp", ".tif", ".tiff", ".webp", ".npy"))


class AbstractFrames(abc.ABC):
    """Frames by number: `count` of them, each (height, width) grey or (height, width, 3) red, green, blue, as stored.

    `per_second`: frames per second, None where the source does not say. Frames of a video are read forwards; a number
    below the last one read starts the video again. Not to be shared between threads.
    """

    count: int
    per_second: float | None

    @abc.abstractmethod
    def read(self, index: int) -> Stored:
        """Frame `index`. Raises InputError where it cannot be decoded or is not there."""

    def close(self) -> None:  # noqa: B027 (only a video has something to close)
        """Lets go of the file."""


def open_frames(path: str | Path) -> AbstractFrames:
    """The frames of a video (MP4, AVI, MKV: what OpenCV decodes), of the pictures in a folder in the order of their
    names (numbers count as numbers: 2 before 10), or of a DICOM file (needs the extra dicom).

    Raises InputError for what is none of these.
    """
    path = Path(path)
    if path.is_dir():
        return FolderFrames(path)
    if not path.exists():
        raise InputError(f"there is no file or folder {path} (looked from {Path.cwd()})")
    if _is_dicom(path):
        from jaxsfs.files._dicom import open_dicom

        return open_dicom(path)
    if path.suffix.lower() in _PICTURES:
        raise InputError(f"{path} is one picture; expected a video or a folder (jaxsfs reconstruct takes pictures)")
    return VideoFrames(path)


class FolderFrames(AbstractFrames):
    """The pictures of a folder."""

    def __init__(self, folder: Path):
        found = [path for path in folder.iterdir() if path.suffix.lower() in _PICTURES and path.is_file()]
        self.paths = sorted(found, key=_natural)
        self.count, self.per_second = len(self.paths), None
        if not found:
            raise InputError(f"there is no picture in {folder}; expected files such as 0001.png or 0001.jpg")

    def read(self, index: int) -> Stored:
        """The stored picture; alpha is left out. Raises InputError that names the file."""
        picture = decode_picture(self.paths[index])
        return picture[..., :3] if picture.ndim == 3 and picture.shape[2] == 4 else picture


class VideoFrames(AbstractFrames):
    """What OpenCV decodes, 8 bit. Frames are counted through from the start: jumping by number is not exact in many
    files, and skipping a frame costs a small part of what solving it does."""

    def __init__(self, path: Path):
        self.path = path
        self._video = self._opened()
        self.count = int(self._video.get(cv2.CAP_PROP_FRAME_COUNT))
        rate = float(self._video.get(cv2.CAP_PROP_FPS))
        self.per_second = rate if 0 < rate < 1e4 else None
        self._next = 0
        if self.count <= 0:  # a stream without an index
            self.count = self._counted()
        if self.count <= 0:
            raise InputError(f"{path} holds no frame that can be decoded")

    def read(self, index: int) -> Stored:
        """Frame `index`, red, green, blue."""
        if index < self._next:
            self._video.release()
            self._video, self._next = self._opened(), 0
        while self._next < index:
            if not self._video.grab():
                raise InputError(f"{self.path} ends before frame {index}")
            self._next += 1
        there, frame = self._video.read()
        if not there:
            raise InputError(f"{self.path}: frame {index} cannot be decoded, or the video ends before it")
        self._next += 1
        return np.ascontiguousarray(frame[..., ::-1])

    def close(self) -> None:
        """Lets go of the file."""
        self._video.release()

    def _opened(self) -> cv2.VideoCapture:
        os.environ.setdefault("OPENCV_FFMPEG_LOGLEVEL", "-8")  # what is wrong is said below
        video = cv2.VideoCapture(str(self.path))
        if not video.isOpened():
            raise InputError(f"{self.path} is no video that can be read; expected MP4, AVI or MKV, or a folder")
        # a scope's image must not turn: camera files refer to stored pixels
        video.set(cv2.CAP_PROP_ORIENTATION_AUTO, 0)
        return video

    def _counted(self) -> int:
        count = 0
        while self._video.grab():
            count += 1
        self._video.release()
        self._video = self._opened()
        return count


def _natural(path: Path) -> list[tuple[int, str]]:
    """Sorts 2 before 10."""
    return [(int(part), "") if part.isdecimal() else (-1, part) for part in re.split(r"(\d+)", path.name.lower())]


def _is_dicom(path: Path) -> bool:
    with open(path, "rb") as file:
        return file.read(132)[128:] == b"DICM"
