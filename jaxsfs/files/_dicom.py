"""Frames of a DICOM file: a still, several frames, or a video inside. Its tags never leave this module."""

import tempfile
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Shaped

from jaxsfs.files._atomic import InputError
from jaxsfs.files._frames import AbstractFrames, VideoFrames

# MPEG-2, MPEG-4 AVC/H.264 and HEVC/H.265: the file holds a video stream, not frames
_VIDEO = frozenset(f"1.2.840.10008.1.2.4.{number}" for number in (*range(100, 109), "100.1", "101.1", "102.1"))
_VIDEO |= {f"1.2.840.10008.1.2.4.{number}.1" for number in range(103, 107)}


def open_dicom(path: Path) -> AbstractFrames:
    """The frames of a DICOM file. Raises InputError where it holds none, or one that pydicom cannot decode here."""
    try:
        import pydicom
    except ImportError:
        raise InputError(f"{path} is a DICOM file; install the extra: pip install 'jaxsfs[dicom]'") from None
    try:
        header = pydicom.dcmread(path, stop_before_pixels=True)
        syntax = str(header.file_meta.TransferSyntaxUID)
    except Exception as error:  # pydicom has no common class for what damaged files raise
        raise InputError(f"cannot read the DICOM file {path}: {error}") from None
    if syntax in _VIDEO:
        return _EncapsulatedVideo(path)
    if "Rows" not in header:
        raise InputError(f"{path} is a DICOM file without an image")
    return _DicomFrames(path, header)


class _DicomFrames(AbstractFrames):
    def __init__(self, path: Path, header: Any):
        self.path = path
        self.count = int(header.get("NumberOfFrames", 1) or 1)
        milliseconds = float(header.get("FrameTime", 0) or 0)
        self.per_second = 1000 / milliseconds if milliseconds > 0 else None
        self._bits = int(header.get("BitsStored", 8))
        self._colours = str(header.get("PhotometricInterpretation", ""))

    def read(self, index: int) -> Shaped[np.ndarray, "height width *channels"]:
        """Frame `index`, colour as red, green, blue; full scale is that of the stored bits."""
        from pydicom.pixels.utils import iter_pixels

        try:
            frame = next(iter_pixels(self.path, indices=[index]))  # YBR comes as RGB
        except Exception as error:
            raise InputError(f"{self.path}: frame {index} cannot be decoded: {error}") from None
        frame = np.asarray(frame)
        if frame.dtype.kind != "u":
            raise InputError(f"{self.path} holds {frame.dtype} pixels; expected unsigned ones, as scopes store them")
        if self._colours == "PALETTE COLOR":
            raise InputError(f"{self.path} holds palette colours; export it as RGB")
        full, stored = np.iinfo(frame.dtype).max, 2**self._bits - 1
        if self._colours == "MONOCHROME1":
            frame = (stored - frame).astype(frame.dtype)
        if stored < full:  # such as 12 bits in 16: the largest value is to be the type's largest
            frame = np.minimum(frame.astype(np.uint64) * full // stored, full).astype(frame.dtype)
        return np.ascontiguousarray(frame)


class _EncapsulatedVideo(VideoFrames):
    """A video stream in DICOM, unpacked into a temporary file, without any tag."""

    def __init__(self, path: Path):
        import pydicom
        from pydicom.encaps import generate_fragments

        data = pydicom.dcmread(path)
        # what the file is called says nothing: FFmpeg looks at the content (MP4, transport or elementary stream)
        self._unpacked = tempfile.NamedTemporaryFile(prefix="jaxsfs-", suffix=".mp4")  # noqa: SIM115 (kept open)
        fragments = generate_fragments(data.PixelData)
        next(fragments)  # the table of offsets
        for fragment in fragments:
            self._unpacked.write(fragment)
        self._unpacked.flush()
        try:
            super().__init__(Path(self._unpacked.name))
        except InputError:
            raise InputError(f"the video inside {path} cannot be decoded by this OpenCV") from None
        self.path = path

    def _opened(self):
        path, self.path = self.path, Path(self._unpacked.name)
        try:
            return super()._opened()
        finally:
            self.path = path

    def close(self) -> None:
        """Removes the temporary file."""
        super().close()
        self._unpacked.close()
