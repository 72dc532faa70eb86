"""Photographs and masks: what the file stores, as numbers, and which pixels can be used."""

import io
from collections.abc import Callable
from pathlib import Path

import cv2
import equinox as eqx
import numpy as np
import tifffile
from jaxtyping import Bool, Float, Shaped, UInt8

from jaxsfs.files._atomic import InputError, read_bytes

_READABLE = "PNG, JPEG, BMP, TIFF, WebP, NPY or a DICOM still"


class Photo(eqx.Module):
    """A stored picture: `values` as the file has them (no response is inverted), (height, width) grey or
    (height, width, 3) in the order red, green, blue.

    Integers are divided by the largest number of their type, so they lie in [0, 1]; floats are taken as they are.
    `valid` is false, and `values` 0, where the file has NaN, infinity or a negative number, and where alpha is 0.
    `dtype`: the stored type, such as "uint8"; `format`: "png", "jpeg", "tiff", "npy" or "other".
    """

    values: Float[np.ndarray, "height width *channels"]
    valid: Bool[np.ndarray, "height width"]
    dtype: str
    format: str

    def rgb8(self) -> UInt8[np.ndarray, "height width 3"]:
        """The picture as 8-bit red, green, blue; float values above 1 are scaled so that the largest is 255."""
        scaled = self.values / max(1.0, float(self.values.max()))
        rgb = np.broadcast_to(scaled[..., None] if scaled.ndim == 2 else scaled, (*self.valid.shape, 3))
        return np.round(255 * rgb).astype(np.uint8)


def read_image(path: str | Path) -> Photo:
    """The photograph in a PNG, JPEG, BMP, TIFF, WebP, NPY or DICOM file (8 or 16 bit, or float; told by content, not
    name). Nothing but pixels is taken from a DICOM file, which needs the extra dicom.

    Rows and columns are those that the file stores: an EXIF orientation is ignored on purpose, because the camera
    file refers to stored pixels. Raises InputError for a file that is missing, cannot be decoded or is cut short, for
    more than one page, for another number of channels than 1, 3 or 4, and when no pixel can be used.
    """
    stored, kind = _decoded(Path(path))
    return photo_of(stored, path, kind)


def photo_of(stored: Shaped[np.ndarray, "height width *channels"], path: str | Path, kind: str = "other") -> Photo:
    """The photograph that an array as `read_image` or a frame's `read` gives it is; `path` for messages.

    Raises InputError when no pixel can be used, and for a type that is no number.
    """
    valid = np.ones(stored.shape[:2], bool)
    if stored.ndim == 3 and stored.shape[2] == 4:
        valid &= stored[..., 3] > 0
        stored = stored[..., :3]
    values = _as_float(stored, path)
    usable = np.isfinite(values) & (values >= 0)
    valid &= usable if values.ndim == 2 else usable.all(axis=-1)
    if not valid.any():
        raise InputError(
            f"{path} has no usable pixel: all of them are NaN, infinite, negative or fully transparent; "
            "expected values from 0 upwards"
        )
    values = np.where(valid if values.ndim == 2 else valid[..., None], values, 0).astype(values.dtype)
    return Photo(values, valid, str(stored.dtype), kind)


def decode_picture(path: str | Path) -> Shaped[np.ndarray, "height width *channels"]:
    """The stored numbers, (height, width) or (height, width, 3 or 4). Raises InputError as `read_image` does."""
    return _decoded(Path(path))[0]


def read_mask(path: str | Path) -> Bool[np.ndarray, "height width"]:
    """The pixels to use: true where the image in `path` is not zero (in any channel) and not transparent.

    JPEG does not keep zeros exactly, so a JPEG mask is true above half of its range. Raises InputError for a file that
    is no image and for a mask without a true pixel.
    """
    photo = read_image(path)
    threshold = 0.5 if photo.format == "jpeg" else 0.0
    above = photo.values > threshold
    mask = photo.valid & (above if above.ndim == 2 else above.any(axis=-1))
    if not mask.any():
        raise InputError(f"the mask {path} is empty: no pixel is above {threshold:g}; expected non-zero where valid")
    return mask


def _decoded(path: Path) -> tuple[np.ndarray, str]:
    """The stored array, checked, and the file's format."""
    stored, kind = _decode(path)
    if stored.ndim == 3 and stored.shape[2] == 1:
        stored = stored[..., 0]
    if stored.ndim not in (2, 3) or (stored.ndim == 3 and stored.shape[2] not in (3, 4)):
        raise InputError(
            f"{path} holds an array of shape {stored.shape}; expected (height, width) grey, or (height, width, 3 or 4) "
            "colour"
        )
    if stored.size == 0:
        raise InputError(f"{path} holds an image without pixels, shape {stored.shape}")
    return stored, kind


def _decode(path: Path) -> tuple[np.ndarray, str]:
    """The stored array, colour in the order red, green, blue, and the file's format."""
    data = read_bytes(path)
    if data[128:132] == b"DICM":
        return _decode_dicom(path), "other"
    if data.startswith(b"\x93NUMPY"):
        return _decode_npy(data, path), "npy"
    if data[:4] in (b"II*\0", b"MM\0*", b"II+\0", b"MM\0+"):
        return _decode_tiff(data, path), "tiff"
    jpeg = data.startswith(b"\xff\xd8")
    # Decoders fill what a cut JPEG lacks with grey. The end marker cannot occur inside the compressed data.
    if jpeg and data.rfind(b"\xff\xd9") < data.rfind(b"\xff\xda"):
        raise InputError(f"{path} is cut short: the JPEG has no end; copy or export it again")
    return _decode_opencv(data, path), "jpeg" if jpeg else "png" if data.startswith(b"\x89PNG") else "other"


def _decode_dicom(path: Path) -> np.ndarray:
    from jaxsfs.files._dicom import open_dicom

    frames = open_dicom(path)
    try:
        if frames.count != 1:
            raise InputError(f"{path} holds {frames.count} frames; expected one picture (jaxsfs video takes several)")
        return frames.read(0)
    finally:
        frames.close()


def _decode_npy(data: bytes, path: Path) -> np.ndarray:
    try:
        array = np.load(io.BytesIO(data), allow_pickle=False)
    except (ValueError, EOFError, OSError) as error:
        raise InputError(f"cannot read the array in {path}: {error}") from None
    return array


def _decode_tiff(data: bytes, path: Path) -> np.ndarray:
    try:
        with tifffile.TiffFile(io.BytesIO(data)) as tiff:
            pages = [page for page in tiff.pages if not getattr(page, "is_reduced", False)]
            if len(pages) > 1:
                raise InputError(f"{path} holds {len(pages)} pages; expected one image, save the wanted page by itself")
            page = tiff.pages.first
            plain = page.photometric in (tifffile.PHOTOMETRIC.MINISBLACK, tifffile.PHOTOMETRIC.RGB)
            array = page.asarray() if plain else None
            separate = page.axes.startswith("S")
    except InputError:
        raise
    # tifffile has no common class for what damaged files and missing codecs raise.
    except Exception as error:
        array, separate, reason = None, False, f": {error}"
    else:
        reason = ""
    # Palettes, inverted grey, and compressions that tifffile leaves to another package.
    if array is None:
        return _decode_opencv(data, path, reason)
    return np.moveaxis(array, 0, -1) if separate else array


def _decode_opencv(data: bytes, path: Path, reason: str = "") -> np.ndarray:
    # OpenCV 4 has the setting in `cv2`, OpenCV 5 in `cv2.utils.logging`; 0 is silent: the error is reported below.
    set_level: Callable[[int], int] = vars(vars(cv2.utils).get("logging", cv2))["setLogLevel"]
    level = set_level(0)
    try:
        # IMREAD_UNCHANGED keeps the bit depth and the alpha channel, and ignores the EXIF orientation.
        image = cv2.imdecode(np.frombuffer(data, np.uint8), cv2.IMREAD_UNCHANGED)
    except cv2.error as error:
        image, reason = None, f": {error.err or error}"
    finally:
        set_level(level)
    if image is None:
        raise InputError(f"{path} is not an image that can be read{reason}; expected {_READABLE}, whole")
    if image.ndim == 3 and image.shape[2] in (3, 4):
        return image[..., [2, 1, 0, 3][: image.shape[2]]]
    return image


def _as_float(stored: np.ndarray, path: str | Path) -> np.ndarray:
    if stored.dtype == bool:
        return stored.astype(np.float32)
    if stored.dtype.kind in "iu":
        # float64 for wide integers: float32 has 24 bits.
        dtype = np.float32 if stored.dtype.itemsize <= 2 else np.float64
        return (stored / np.iinfo(stored.dtype).max).astype(dtype)
    if stored.dtype.kind == "f":
        return stored.astype(np.float64 if stored.dtype.itemsize > 4 else np.float32)
    raise InputError(f"{path} holds numbers of type {stored.dtype}; expected integers or floats")
