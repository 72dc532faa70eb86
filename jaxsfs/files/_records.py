"""JSON: results and cameras."""

import json
import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import jax
import numpy as np

from jaxsfs.camera import AbstractCamera, CameraFile, camera_from_dict, camera_to_dict
from jaxsfs.files._atomic import InputError, read_bytes, write_bytes
from jaxsfs.lights import Lights, lights_from_dict


def read_json(path: str | Path) -> dict[str, Any]:
    """The JSON object in `path`. Raises InputError, with line and column, for anything else."""
    try:
        # utf-8-sig: some editors begin a file with a byte-order mark.
        record = json.loads(read_bytes(path).decode("utf-8-sig"))
    except UnicodeDecodeError:
        raise InputError(f"{path} is not a text file; expected JSON in UTF-8") from None
    except json.JSONDecodeError as error:
        raise InputError(f"{path} is not JSON: {error.msg} in line {error.lineno}, column {error.colno}") from None
    if not isinstance(record, dict):
        raise InputError(f"{path} holds a JSON {type(record).__name__}; expected an object {{…}}")
    return record


def write_json(path: str | Path, record: Mapping[str, Any], *, force: bool = False) -> None:
    """`record` as indented JSON with sorted keys; arrays become lists, NaN and infinity become null (JSON has none)."""
    text = json.dumps(plain(record), indent=2, sort_keys=True, allow_nan=False, ensure_ascii=False)
    write_bytes(path, (text + "\n").encode(), force=force)


def read_camera(path: str | Path) -> CameraFile:
    """The camera file `path`. Raises InputError that names the file and the key that is wrong."""
    record = read_json(path)
    try:
        return camera_from_dict(record)
    except ValueError as error:
        raise InputError(f"{path}: {error}") from None


def read_lights(path: str | Path) -> Lights:
    """The lights file `path` (see `lights_from_dict`). Raises InputError that names the file and what is wrong."""
    record = read_json(path)
    try:
        return lights_from_dict(record)
    except ValueError as error:
        raise InputError(f"{path}: {error}") from None


def write_camera(path: str | Path, camera: AbstractCamera | CameraFile, *, force: bool = False) -> None:
    """The camera file that `read_camera` reads back."""
    write_json(path, camera_to_dict(camera), force=force)


def plain(value: Any) -> Any:
    """`value` as JSON has it: arrays as lists, NaN and infinity as None. Raises ValueError for other objects."""
    if isinstance(value, Mapping):
        return {str(key): plain(entry) for key, entry in value.items()}
    if isinstance(value, np.ndarray | np.generic | jax.Array):
        return plain(value.tolist())
    if isinstance(value, list | tuple):
        return [plain(entry) for entry in value]
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if value is None or isinstance(value, bool | int | str):
        return value
    if isinstance(value, Path):
        return str(value)
    raise ValueError(f"cannot write a {type(value).__name__} to JSON: {value!r}")
