"""OpenCV's camera files: YAML or XML of cv2.FileStorage, as its calibration samples write them."""

from typing import Any

import cv2
import numpy as np

from jaxsfs.convert._read import Read, from_matrix, image_size, key_like, numbers_in, standard, unused_keys
from jaxsfs.convert._standard import FISHEYE, PINHOLE, RADTAN, Standard
from jaxsfs.convert._yaml import parse_yaml

_MATRIX = ("camera_matrix", "cameraMatrix", "K", "M1", "intrinsic_matrix")
_DISTORTION = ("distortion_coefficients", "dist_coeffs", "distCoeffs", "D", "D1", "distortion")
_WIDTH, _HEIGHT = ("image_width", "width"), ("image_height", "height")
_FISHEYE = ("fisheye_model",)


def write_opencv(lens: Standard, comment: str) -> str:
    """camera_matrix and distortion_coefficients (k1 … k4 with fisheye_model 1, else five zeros), pixel origin 0."""
    storage = cv2.FileStorage("camera.yaml", cv2.FileStorage_WRITE | cv2.FileStorage_MEMORY)
    for line in comment.splitlines():
        storage.writeComment(line)
    storage.write("image_width", lens.width)
    storage.write("image_height", lens.height)
    storage.write("fisheye_model", int(lens.kind == FISHEYE))
    storage.write("camera_matrix", np.array([[lens.fx, 0, lens.cx], [0, lens.fy, lens.cy], [0, 0, 1]], float))
    distortion = lens.coefficients if lens.kind == FISHEYE else (0.0,) * 5
    storage.write("distortion_coefficients", np.array(distortion, float)[:, None])
    return storage.releaseAndGetString()


def read_opencv(text: str, fisheye: bool | None = None) -> Read:
    """The camera of a YAML or XML file. Four coefficients may be a fisheye's or k1 k2 p1 p2: `fisheye` or the key
    fisheye_model says which; without either ValueError asks."""
    record = _record(text)
    names = [key_like(record, *group) for group in (_MATRIX, _DISTORTION, _WIDTH, _HEIGHT, _FISHEYE)]
    matrix, distortion, width, height, model = names
    if matrix is None:
        raise ValueError(f"expected a camera matrix named {' or '.join(_MATRIX)}; keys found: {', '.join(record)}")
    coefficients = [] if distortion is None else np.ravel(record[distortion]).tolist()
    if fisheye is None and model is not None:
        fisheye = bool(record[model])
    if fisheye is None and len(coefficients) == 4 and any(coefficients):
        raise ValueError(
            "the four distortion coefficients may be k1 k2 p1 p2 or a fisheye's k1 k2 k3 k4, and the file does not say "
            "which: give --from opencv-fisheye or --from opencv-radtan"
        )
    kind = FISHEYE if fisheye else RADTAN if coefficients else PINHOLE
    size = image_size(record.get(width or ""), record.get(height or ""))
    return Read(standard(kind, size, from_matrix(record[matrix]), coefficients), unused_keys(record, names))


def _record(text: str) -> dict[str, Any]:
    """Keys and values. Files of programs that print arrays into plain YAML are read as well."""
    if not text.lstrip().startswith(("%YAML", "<?xml")):
        record = parse_yaml(text)
        arrays = {*_MATRIX, *_DISTORTION}
        return {k: numbers_in(v) if isinstance(v, str) and k in arrays else v for k, v in record.items()}
    try:
        storage = cv2.FileStorage(text, cv2.FileStorage_READ | cv2.FileStorage_MEMORY)
        root = storage.root()
        record = {key: _value(root.getNode(key)) for key in root.keys()}  # noqa: SIM118 -- a FileNode, no dict
    except (cv2.error, SystemError) as error:
        raise ValueError(f"OpenCV cannot read this file: {' '.join(str(error).split())}") from None
    return record


def _value(node: Any) -> Any:
    """A number, text or float matrix; None for what no camera needs (lists, matrices of vectors)."""
    if node.isInt() or node.isReal():
        return node.real()
    if node.isString():
        return node.string()
    if node.isMap() and node.getNode("dt").string() in ("d", "f"):
        return node.mat()
    return None
