"""Maps of lengths or vectors per pixel, and 8- or 16-bit pictures."""

import io
import math
from pathlib import Path

import cv2
import numpy as np
import tifffile
from jaxtyping import Bool, Float, Shaped

from jaxsfs.files._atomic import InputError, write_bytes
from jaxsfs.files._photo import _decode
from jaxsfs.files._records import read_json


def read_map(path: str | Path, scale: float | int | None = None) -> Float[np.ndarray, "height width"]:
    """Range or depth per pixel from TIFF, NPY or PNG: stored number · scale, NaN where it is not finite or not > 0.

    `scale`: length per stored unit. Floats have scale 1 by default; whole numbers have no unit of their own, so they
    need `scale`, or a file beside them with the same name and ending .json that holds {"scale": …} (`depth.json` for
    `depth.png`). The result is float64, in the unit that the scale gives.
    Raises InputError for a file that cannot be read, more than one channel, a missing scale, and a map without data.
    """
    path = Path(path)
    stored, _ = _decode(path)
    if stored.ndim == 3 and stored.shape[2] == 1:
        stored = stored[..., 0]
    if stored.ndim != 2 or stored.size == 0:
        raise InputError(f"{path} holds an array of shape {stored.shape}; expected a map (height, width)")
    if stored.dtype.kind not in "iuf":
        raise InputError(f"{path} holds numbers of type {stored.dtype}; expected integers or floats")
    beside = path.with_suffix(".json")
    if scale is None and beside.is_file():
        scale = read_json(beside).get("scale")
        if isinstance(scale, bool) or not isinstance(scale, int | float | None):
            raise InputError(f"'scale' in {beside} must be a number, got {scale!r}")
    if scale is None and stored.dtype.kind != "f":
        raise InputError(
            f"{path} holds whole numbers ({stored.dtype}), which have no unit; give their scale (length per step), or "
            f'write {{"scale": …}} to {beside.name} beside it'
        )
    scale = 1.0 if scale is None else float(scale)
    if not (math.isfinite(scale) and scale > 0):
        raise InputError(f"the scale of {path} must be positive and finite, got {scale:g}")
    values = stored.astype(np.float64) * scale
    known = np.isfinite(values) & (values > 0)
    if not known.any():
        raise InputError(f"{path} has no data: no value is finite and greater than 0")
    return np.where(known, values, np.nan)


def write_tiff(
    path: str | Path,
    values: Float[np.ndarray, "height width *channels"],
    valid: Bool[np.ndarray, "height width"],
    *,
    description: str = "",
    force: bool = False,
) -> None:
    """`values`, (height, width) or (height, width, 3), as an uncompressed float32 TIFF, NaN where not `valid`.

    `description` (ASCII: quantity and unit) goes into the TIFF's tag of that name.
    """
    shaped = valid if values.ndim == 2 else valid[..., None]
    buffer = io.BytesIO()
    tifffile.imwrite(
        buffer,
        np.where(shaped, values, np.nan).astype(np.float32),
        photometric="minisblack" if values.ndim == 2 else "rgb",
        description=description or None,
        metadata=None,
        software=False,
    )
    write_bytes(path, buffer.getvalue(), force=force)


def write_png(path: str | Path, picture: Shaped[np.ndarray, "height width *channels"], *, force: bool = False) -> None:
    """A PNG of `picture`: (height, width) or (height, width, 3) red, green, blue; uint8, uint16, or bool as 0 and 255.

    Raises ValueError for another type.
    """
    if picture.dtype == bool:
        picture = np.where(picture, np.uint8(255), np.uint8(0))
    if picture.dtype not in (np.uint8, np.uint16):
        raise ValueError(f"a PNG holds uint8, uint16 or bool, got {picture.dtype}; scale and round the values first")
    stored = picture if picture.ndim == 2 else picture[..., ::-1]
    done, data = cv2.imencode(".png", np.ascontiguousarray(stored))
    if not done:
        raise ValueError(f"cannot encode an image of shape {picture.shape} as PNG")
    write_bytes(path, data.tobytes(), force=force)
