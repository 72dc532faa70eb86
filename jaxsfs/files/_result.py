"""A result that was written, read back."""

import io
import json
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jaxsfs.camera import camera_from_dict
from jaxsfs.files._atomic import InputError, read_bytes
from jaxsfs.files._formats import Unit
from jaxsfs.files._photo import _decode, read_mask
from jaxsfs.files._records import read_json
from jaxsfs.surface import Surface


class StoredResult(eqx.Module):
    """A surface that was stored, in `unit`; `sigma`: 1σ of its range, NaN where there is none, None if not stored.

    `trustworthy` and `message`: the status of the reconstruction that wrote it.
    """

    surface: Surface
    unit: Unit
    sigma: Float[np.ndarray, "height width"] | None
    trustworthy: bool
    message: str


def read_result(path: str | Path) -> StoredResult:
    """What `jaxsfs reconstruct` wrote: its folder (range.tiff and result.json), or the .npz file in it.

    A folder of `jaxsfs render` (range.tiff and camera.json) is read too. Raises InputError for anything else, and
    where map and camera are of different sizes.
    """
    path = Path(path)
    return _from_folder(path) if path.is_dir() else _from_npz(path)


def _from_folder(folder: Path) -> StoredResult:
    if not (folder / "range.tiff").is_file():
        raise InputError(f"{folder} has no range.tiff; give a folder that jaxsfs reconstruct wrote")
    described = folder / ("result.json" if (folder / "result.json").is_file() else "camera.json")
    record = read_json(described)
    camera = record.get("camera", {}) if described.name == "result.json" else record
    distance, _ = _decode(folder / "range.tiff")
    sigma = _decode(folder / "range_sigma.tiff")[0] if (folder / "range_sigma.tiff").is_file() else None
    contours = read_mask(folder / "contours.png") if (folder / "contours.png").is_file() else None
    maps = (distance, sigma, contours)
    return _stored(described, maps, camera, record.get("unit", "scene units"), record.get("status"))


def _from_npz(path: Path) -> StoredResult:
    data = read_bytes(path)
    try:
        with np.load(io.BytesIO(data), allow_pickle=False) as arrays:
            distance, record = arrays["range"], json.loads(str(arrays["record"]))
            maps = (distance, arrays.get("range_sigma"), arrays.get("contours"))
    except (ValueError, KeyError, OSError, EOFError, zipfile.BadZipFile) as error:
        raise InputError(f"cannot read a result from {path}: {error}; give what jaxsfs reconstruct wrote") from None
    return _stored(path, maps, record.get("camera", {}), record.get("unit"), record.get("status"))


def _stored(
    path: Path, maps: tuple[np.ndarray, Any, Any], camera: Mapping[str, Any], unit: Any, status: Any
) -> StoredResult:
    distance, sigma, contours = maps
    try:
        described = camera_from_dict(camera).camera
    except ValueError as error:
        raise InputError(f"{path}: {error}") from None
    size = (described.height, described.width)
    for name, array in (("range", distance), ("1σ of the range", sigma), ("mask of contours", contours)):
        if array is not None and array.shape != size:
            raise InputError(
                f"{path}: the {name} has shape {array.shape}, but the camera {size}; give files of one run"
            )
    if unit not in ("mm", "scene units"):
        raise InputError(f"{path}: 'unit' must be mm or scene units, got {unit!r}")
    valid = np.isfinite(distance)
    torn = None if contours is None else jnp.asarray(contours, bool)
    surface = Surface(described, jnp.asarray(np.where(valid, distance, 1), jnp.float32), jnp.asarray(valid), torn)
    status = status if isinstance(status, dict) else {}
    return StoredResult(
        surface,
        unit,
        None if sigma is None else np.asarray(sigma, np.float64),
        bool(status.get("trustworthy", True)),
        str(status.get("message", "")),
    )
