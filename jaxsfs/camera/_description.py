"""Camera files: what the JSON says, and cameras from it. (Reading and writing the file itself: `jaxsfs.files`.)"""

import math
from collections.abc import Mapping
from typing import Any

import equinox as eqx

from jaxsfs.camera._base import AbstractCamera
from jaxsfs.camera._orthographic import Orthographic
from jaxsfs.camera._radial import (
    Equidistant,
    Equisolid,
    KannalaBrandt,
    Perspective,
    Spherical,
    Stereographic,
)
from jaxsfs.camera._scaramuzza import Scaramuzza

# model name → class, scalar parameters, vector parameters with their lengths, optional scalars with defaults
_MODELS: dict[str, tuple[type[AbstractCamera], tuple[str, ...], dict[str, int], dict[str, float]]] = {
    "spherical": (Spherical, ("f",), {}, {"aspect": 1.0, "k": 0.0}),
    "perspective": (Perspective, ("fx", "fy"), {}, {}),
    "equidistant": (Equidistant, ("f",), {}, {"aspect": 1.0}),
    "equisolid": (Equisolid, ("f",), {}, {"aspect": 1.0}),
    "stereographic": (Stereographic, ("f",), {}, {"aspect": 1.0}),
    "kannala-brandt": (KannalaBrandt, ("fx", "fy"), {"k": 4}, {}),
    "scaramuzza": (Scaramuzza, (), {"a": 5}, {"c": 1.0, "d": 0.0, "e": 0.0}),
    "orthographic": (Orthographic, ("scale",), {}, {"aspect": 1.0}),
}
_COMMON = ("width", "height", "cx", "cy")
_POSITIVE = ("f", "fx", "fy", "scale", "aspect")


class CameraFile(eqx.Module):
    """All that a camera file holds: the camera, its photometry, and every other key untouched."""

    camera: AbstractCamera
    photometry: dict[str, Any]
    other: dict[str, Any]


def camera_from_dict(description: Mapping[str, Any]) -> CameraFile:
    """The camera that `description` (a parsed camera file) names.

    Raises ValueError that names the key for an unknown model, a missing key, or a value of the wrong kind.
    """
    name = description.get("model")
    if name not in _MODELS:
        raise ValueError(f"camera model {name!r} is unknown; 'model' must be one of: {', '.join(_MODELS)}")
    cls, scalars, vectors, optional = _MODELS[name]
    needed = (*_COMMON, *scalars, *vectors)
    missing = [key for key in needed if key not in description]
    if missing:
        raise ValueError(
            f"a camera of model {name!r} needs {', '.join(needed)}; missing: {', '.join(map(repr, missing))}"
        )
    origin = _number(description, "pixel_origin", 0.0)
    values: dict[str, Any] = {key: _size(description, key) for key in ("width", "height")}
    values |= {key: _number(description, key) - origin for key in ("cx", "cy")}
    values |= {key: _number(description, key) for key in scalars}
    values |= {key: _vector(description, key, length) for key, length in vectors.items()}
    values |= {key: _number(description, key, default) for key, default in optional.items()}
    known = {"model", "pixel_origin", "photometry", *needed, *optional}
    photometry = description.get("photometry") or {}
    if not isinstance(photometry, Mapping):
        raise ValueError(f'\'photometry\' must be an object such as {{"response": "srgb"}}, got {photometry!r}')
    other = {key: value for key, value in description.items() if key not in known}
    return CameraFile(cls(**values), dict(photometry), other)


def camera_to_dict(camera: AbstractCamera | CameraFile) -> dict[str, Any]:
    """The description that `camera_from_dict` reads back; pixel origin 0 (centre of the first pixel)."""
    file = camera if isinstance(camera, CameraFile) else CameraFile(camera, {}, {})
    camera = file.camera
    name = next((name for name, entry in _MODELS.items() if entry[0] is type(camera)), None)
    if name is None:
        raise ValueError(f"no camera file model for {type(camera).__name__}; known: {', '.join(_MODELS)}")
    _, scalars, vectors, optional = _MODELS[name]
    description: dict[str, Any] = {"model": name, "width": camera.width, "height": camera.height}
    description |= {key: float(getattr(camera, key)) for key in ("cx", "cy", *scalars)}
    description |= {key: [float(x) for x in getattr(camera, key)] for key in vectors}
    description |= {key: float(getattr(camera, key)) for key in optional}
    description["pixel_origin"] = 0
    if file.photometry:
        description["photometry"] = file.photometry
    return description | file.other


def _number(description: Mapping[str, Any], key: str, default: float | None = None) -> float:
    value = description.get(key, default)
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise ValueError(f"camera key {key!r} must be a finite number, got {value!r}")
    if key in _POSITIVE and value <= 0:
        raise ValueError(f"camera key {key!r} must be positive, got {value!r}")
    return float(value)


def _size(description: Mapping[str, Any], key: str) -> int:
    value = _number(description, key)
    if value != int(value) or value < 1:
        raise ValueError(f"camera key {key!r} must be a whole number of pixels, at least 1, got {value!r}")
    return int(value)


def _vector(description: Mapping[str, Any], key: str, length: int) -> tuple[float, ...]:
    values = description[key]
    if not isinstance(values, list | tuple) or len(values) != length:
        raise ValueError(f"camera key {key!r} must be a list of {length} numbers, got {values!r}")
    return tuple(_number({key: value}, key) for value in values)
