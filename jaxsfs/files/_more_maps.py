"""Maps of lengths in further formats: PFM, 16-bit PNG with its scale, EXR."""

from pathlib import Path

import numpy as np
from jaxtyping import Float

from jaxsfs.files._atomic import InputError, write_bytes
from jaxsfs.files._maps import write_png
from jaxsfs.files._records import write_json

Map = Float[np.ndarray, "height width"]


def write_pfm(path: str | Path, values: Map, *, force: bool = False) -> None:
    """`values` as a little-endian grey PFM, float32, the lowest row first as the format wants; NaN stays NaN."""
    height, width = values.shape
    data = np.ascontiguousarray(values[::-1], "<f4").tobytes()
    write_bytes(path, f"Pf\n{width} {height}\n-1.0\n".encode("ascii") + data, force=force)


def write_png16(path: str | Path, values: Map, quantity: str, unit: str, *, force: bool = False) -> None:
    """`values` > 0 as a 16-bit PNG, 0 where NaN, and beside it a .json with `scale`: length per step.

    `read_map` finds that scale. The step is the largest value / 65535. Raises ValueError where a value is not > 0.
    """
    known = np.isfinite(values)
    if (values[known] <= 0).any():
        raise ValueError(f"a 16-bit PNG holds lengths above 0, got {values[known].min():g}; write TIFF instead")
    scale = float(values[known].max()) / 65535 if known.any() else 1.0
    # 0 means no data, so the smallest length is one step
    steps = np.where(known, np.clip(np.round(np.where(known, values, 0) / scale), 1, 65535), 0)
    write_png(path, steps.astype(np.uint16), force=force)
    record = {"quantity": quantity, "scale": scale, "unit": unit, "no_data": 0}
    write_json(Path(path).with_suffix(".json"), record, force=force)


def write_exr(path: str | Path, values: Map, quantity: str, unit: str) -> None:
    """`values` as an OpenEXR picture with one 32-bit channel, Z, NaN where there is none; `quantity` and `unit` in
    its header. Raises InputError where the extra is not installed or the file cannot be written."""
    openexr = exr_library()
    header = {"compression": openexr.ZIP_COMPRESSION, "type": openexr.scanlineimage, "comments": f"{quantity}, {unit}"}
    try:
        openexr.File(header, {"Z": np.ascontiguousarray(values, np.float32)}).write(str(path))
    except (OSError, RuntimeError) as error:
        raise InputError(f"cannot write {path}: {error}") from None


def exr_library():
    """The module OpenEXR. Raises InputError where the extra is not installed."""
    try:
        import OpenEXR
    except ImportError:
        raise InputError("EXR needs an extra: pip install 'jaxsfs[exr]'") from None
    return OpenEXR
