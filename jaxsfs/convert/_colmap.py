"""COLMAP's cameras.txt and nerfstudio's transforms.json, which names its lenses alike; pixel origin ½."""

import json
from collections.abc import Mapping, Sequence
from typing import Any

from jaxsfs.convert._read import Read, image_size, standard, unused_keys
from jaxsfs.convert._standard import FISHEYE, PINHOLE, RADTAN, Standard

_HALF = 0.5  # the corner of the first pixel is (0, 0), its centre (½, ½)
# model → distortion, names of the parameters in COLMAP's order
_MODELS: dict[str, tuple[str, str]] = {
    "SIMPLE_PINHOLE": (PINHOLE, "f cx cy"),
    "PINHOLE": (PINHOLE, "fx fy cx cy"),
    "SIMPLE_RADIAL": (RADTAN, "f cx cy k1"),
    "RADIAL": (RADTAN, "f cx cy k1 k2"),
    "OPENCV": (RADTAN, "fx fy cx cy k1 k2 p1 p2"),
    "FULL_OPENCV": (RADTAN, "fx fy cx cy k1 k2 p1 p2 k3 k4 k5 k6"),
    "SIMPLE_RADIAL_FISHEYE": (FISHEYE, "f cx cy k1"),
    "RADIAL_FISHEYE": (FISHEYE, "f cx cy k1 k2"),
    "OPENCV_FISHEYE": (FISHEYE, "fx fy cx cy k1 k2 k3 k4"),
}
_COEFFICIENTS = {
    PINHOLE: (),
    FISHEYE: ("k1", "k2", "k3", "k4"),
    RADTAN: ("k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"),
}
_NERFSTUDIO = {"fl_x": "fx", "fl_y": "fy", "w": "width", "h": "height"}


def write_colmap(lens: Standard, comment: str) -> str:
    """One line: CAMERA_ID MODEL WIDTH HEIGHT PARAMS, of model PINHOLE or OPENCV_FISHEYE."""
    model = "OPENCV_FISHEYE" if lens.kind == FISHEYE else "PINHOLE"
    numbers = (lens.fx, lens.fy, lens.cx + _HALF, lens.cy + _HALF, *lens.coefficients)
    head = "".join(f"# {line}\n" for line in comment.splitlines())
    head += "# CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]\n"
    return head + f"1 {model} {lens.width} {lens.height} {' '.join(map(repr, numbers))}\n"


def read_colmap(text: str) -> Read:
    """The first camera of the list; further ones are named as unused."""
    lines = [line.split() for line in text.splitlines() if line.strip() and not line.lstrip().startswith("#")]
    if not lines or len(lines[0]) < 5:
        raise ValueError("expected a line CAMERA_ID MODEL WIDTH HEIGHT PARAMS as in COLMAP's cameras.txt")
    _, model, width, height, *words = lines[0]
    names = _names(model)
    if len(words) != len(names):
        raise ValueError(f"{model} has the parameters {', '.join(names)}, got {len(words)} numbers: {' '.join(words)}")
    try:
        values = dict(zip(names, map(float, words), strict=True))
    except ValueError:
        raise ValueError(f"expected numbers after {model} {width} {height}, got {' '.join(words)}") from None
    return Read(_lens(model, image_size(width, height), values), tuple(f"camera {line[0]}" for line in lines[1:]))


def write_nerfstudio(lens: Standard, comment: str) -> str:
    """The camera's keys of a transforms.json without frames; the comment is a key that nerfstudio passes over."""
    record: dict[str, Any] = {"comment": comment.splitlines()}
    record["camera_model"] = "OPENCV_FISHEYE" if lens.kind == FISHEYE else "PINHOLE"
    record |= {"fl_x": lens.fx, "fl_y": lens.fy, "cx": lens.cx + _HALF, "cy": lens.cy + _HALF}
    record |= {"w": lens.width, "h": lens.height}
    record |= {f"k{i}": value for i, value in enumerate(lens.coefficients, start=1)}
    return json.dumps(record | {"frames": []}, indent=2) + "\n"


def read_nerfstudio(text: str) -> Read:
    """The camera that all frames share; coefficients that are not there are 0."""
    try:
        record = json.loads(text)
    except json.JSONDecodeError as error:
        raise ValueError(f"not JSON: {error.msg} in line {error.lineno}, column {error.colno}") from None
    if not isinstance(record, dict):
        raise ValueError(f"expected a JSON object {{…}}, got {type(record).__name__}")
    model = str(record.get("camera_model"))
    wanted = _names(model)
    values = {_NERFSTUDIO.get(key, key): value for key, value in record.items()}
    values.setdefault("f", values.get("fx"))
    missing = [name for name in wanted if name[0] in "fc" and not isinstance(values.get(name), int | float)]
    if missing:
        raise ValueError(f"a nerfstudio camera of model {model} needs numbers for {', '.join(missing)}")
    shift = {name: float(values.get(name, 0.0)) for name in {*wanted, *_COEFFICIENTS[_MODELS[model][0]]}}
    used = [key for key in record if _NERFSTUDIO.get(key, key) in {*shift, "fx", "fy", "width", "height"}]
    lens = _lens(model, image_size(values.get("width"), values.get("height")), shift)
    return Read(lens, unused_keys(record, (*used, "camera_model", "comment", "frames")))


def _names(model: str) -> Sequence[str]:
    if model not in _MODELS:
        raise ValueError(f"camera model {model!r} is unknown; known: {', '.join(_MODELS)}")
    return _MODELS[model][1].split()


def _lens(model: str, size: tuple[int, int], values: Mapping[str, float]) -> Standard:
    kind = _MODELS[model][0]
    fx, fy = values.get("fx", values.get("f", 0.0)), values.get("fy", values.get("f", 0.0))
    coefficients = [values.get(name, 0.0) for name in _COEFFICIENTS[kind]]
    return standard(kind, size, (fx, fy, values["cx"] - _HALF, values["cy"] - _HALF), coefficients)
