"""Kalibr's camera chains and ROS's camera_info: plain YAML."""

from collections.abc import Mapping
from typing import Any

import yaml

from jaxsfs.convert._read import Read, from_matrix, image_size, standard, unused_keys
from jaxsfs.convert._standard import FISHEYE, PINHOLE, RADTAN, Standard

_KALIBR = {"none": PINHOLE, "equidistant": FISHEYE, "radtan": RADTAN}
_ROS = {"plumb_bob": RADTAN, "rational_polynomial": RADTAN, "equidistant": FISHEYE, "fisheye": FISHEYE}


def parse_yaml(text: str) -> dict[str, Any]:
    """The mapping that a YAML file holds."""
    try:
        record = yaml.safe_load(text)
    except yaml.YAMLError as error:
        raise ValueError(f"not readable as YAML: {' '.join(str(error).split())}") from None
    if not isinstance(record, dict):
        raise ValueError(f"expected YAML of the form 'key: value', got {type(record).__name__}")
    return {str(key): value for key, value in record.items()}


def write_kalibr(lens: Standard, comment: str) -> str:
    """A chain of one camera: pinhole with distortion none or equidistant, pixel origin 0."""
    camera = {
        "camera_model": "pinhole",
        "intrinsics": [lens.fx, lens.fy, lens.cx, lens.cy],
        "distortion_model": "equidistant" if lens.kind == FISHEYE else "none",
        "distortion_coeffs": list(lens.coefficients),
        "resolution": [lens.width, lens.height],
        "cam_overlaps": [],
        "rostopic": "/camera/image_raw",
    }
    return _dump({"cam0": camera}, comment)


def read_kalibr(text: str) -> Read:
    """The first camera of a chain; further ones are named as unused."""
    record = parse_yaml(text)
    first = next((key for key in sorted(record) if key.startswith("cam") and isinstance(record[key], dict)), None)
    if first is None:
        raise ValueError(f"expected a Kalibr camera chain with cam0; keys found: {', '.join(record)}")
    camera = record[first]
    model, distortion = camera.get("camera_model"), camera.get("distortion_model", "none")
    if model != "pinhole" or distortion not in _KALIBR:
        raise ValueError(
            f"{first} is of camera_model {model!r} with distortion_model {distortion!r}; known: pinhole with "
            f"{', '.join(_KALIBR)}"
        )
    resolution = _numbers(camera, "resolution", 2) if "resolution" in camera else [None, None]
    coefficients = camera.get("distortion_coeffs") or []
    lens = standard(_KALIBR[distortion], image_size(*resolution), _numbers(camera, "intrinsics", 4), coefficients)
    used = ("camera_model", "distortion_model", "distortion_coeffs", "resolution", "intrinsics")
    inner = [f"{first}.{key}" for key in unused_keys(camera, (*used, "cam_overlaps", "rostopic"))]
    return Read(lens, (*unused_keys(record, (first,)), *inner))


def write_ros(lens: Standard, comment: str) -> str:
    """camera_info as camera_calibration_parsers reads it: plumb_bob or equidistant, pixel origin 0."""
    distortion = lens.coefficients if lens.kind == FISHEYE else (0.0,) * 5
    matrix = [lens.fx, 0.0, lens.cx, 0.0, lens.fy, lens.cy, 0.0, 0.0, 1.0]
    record = {
        "image_width": lens.width,
        "image_height": lens.height,
        "camera_name": "camera",
        "camera_matrix": _matrix(3, 3, matrix),
        "distortion_model": "equidistant" if lens.kind == FISHEYE else "plumb_bob",
        "distortion_coefficients": _matrix(1, len(distortion), list(distortion)),
        "rectification_matrix": _matrix(3, 3, [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0]),
        "projection_matrix": _matrix(3, 4, [*matrix[:3], 0.0, *matrix[3:6], 0.0, *matrix[6:], 0.0]),
    }
    return _dump(record, comment)


def read_ros(text: str) -> Read:
    """The raw camera: matrix and distortion. Rectification and projection belong to stereo and rectified images."""
    record = parse_yaml(text)
    model = record.get("distortion_model", "plumb_bob")
    if model not in _ROS:
        raise ValueError(f"distortion_model {model!r} is unknown; known: {', '.join(_ROS)}")
    coefficients = _data(record, "distortion_coefficients") if "distortion_coefficients" in record else []
    size = image_size(record.get("image_width"), record.get("image_height"))
    lens = standard(_ROS[model], size, from_matrix(_data(record, "camera_matrix")), coefficients)
    used = ("image_width", "image_height", "camera_matrix", "distortion_model", "distortion_coefficients")
    return Read(lens, unused_keys(record, (*used, "camera_name")))


def _matrix(rows: int, cols: int, data: list[float]) -> dict[str, Any]:
    return {"rows": rows, "cols": cols, "data": data}


def _data(record: Mapping[str, Any], key: str) -> list[float]:
    entry = record.get(key)
    if not isinstance(entry, dict) or not isinstance(entry.get("data"), list):
        raise ValueError(f"expected {key} with rows, cols and data: [...], got {entry!r}")
    return _numbers(entry, "data", None)


def _numbers(record: Mapping[str, Any], key: str, count: int | None) -> list[float]:
    values = record.get(key)
    if not isinstance(values, list) or (count is not None and len(values) != count):
        raise ValueError(f"expected {key} with {count} numbers, got {values!r}")
    if not all(isinstance(value, int | float) for value in values):
        raise ValueError(f"expected numbers in {key}, got {values!r}")
    return [float(value) for value in values]


def _dump(record: Mapping[str, Any], comment: str) -> str:
    head = "".join(f"# {line}\n" for line in comment.splitlines())
    return head + yaml.safe_dump(dict(record), sort_keys=False, default_flow_style=None, width=1000)
