"""What a format's reader returns, and the checks that readers share."""

import re
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from jaxsfs.convert._radtan import LENGTHS
from jaxsfs.convert._standard import FISHEYE, PINHOLE, RADTAN, Standard

Focal = tuple[float, float, float, float]  # fx, fy, cx, cy


class Read(NamedTuple):
    """A camera as read, and what the source says that it has no place for."""

    standard: Standard
    unused: tuple[str, ...] = ()


def standard(kind: str, size: tuple[int, int], intrinsics: Sequence[float], coefficients: Iterable[float]) -> Standard:
    """Checked for its numbers: 4 of a fisheye, and of radtan as many as OpenCV knows; none or zeros are a pinhole."""
    values = tuple(float(value) for value in coefficients)
    if kind != FISHEYE and not any(values):
        kind, values = PINHOLE, ()
    wanted = {FISHEYE: (4,), RADTAN: LENGTHS, PINHOLE: (0,)}[kind]
    if len(values) not in wanted:
        listed = " or ".join(map(str, wanted))
        raise ValueError(f"{kind} distortion has {listed} coefficients, got {len(values)}: {list(values)}")
    numbers = (*(float(value) for value in intrinsics), *values)
    if len(intrinsics) != 4 or not np.all(np.isfinite(numbers)):
        raise ValueError(f"expected finite fx, fy, cx, cy and coefficients, got {list(intrinsics)} and {list(values)}")
    fx, fy, cx, cy = numbers[:4]
    return Standard(kind, *size, fx, fy, cx, cy, values)


def from_matrix(matrix: Any) -> Focal:
    """fx, fy, cx, cy of a 3 × 3 camera matrix (nested or flat). Raises ValueError for a skewed one."""
    flat = np.asarray(matrix, float).ravel()
    if flat.size != 9:
        raise ValueError(f"a camera matrix has 9 numbers, got {flat.size}")
    if flat[1] != 0 or not np.array_equal(flat[[3, 6, 7, 8]], [0, 0, 0, 1]):
        raise ValueError(f"expected the camera matrix [fx 0 cx; 0 fy cy; 0 0 1], got {flat.tolist()}")
    return float(flat[0]), float(flat[4]), float(flat[2]), float(flat[5])


def image_size(width: Any, height: Any) -> tuple[int, int]:
    """Width and height in px; (0, 0) where the source says neither."""
    if width is None and height is None:
        return 0, 0
    try:
        size = float(str(width)), float(str(height))
        if min(size) < 1 or size != (int(size[0]), int(size[1])):
            raise ValueError
    except (TypeError, ValueError, OverflowError):
        raise ValueError(
            f"image width and height must be whole numbers of pixels, got {width!r} and {height!r}"
        ) from None
    return int(size[0]), int(size[1])


def key_like(keys: Iterable[str], *names: str) -> str | None:
    """The first of `keys` that is one of `names`, whatever its case; programs differ in that."""
    wanted = {name.lower() for name in names}
    return next((key for key in keys if key.lower() in wanted), None)


def unused_keys(record: Mapping[str, Any], used: Iterable[str | None]) -> tuple[str, ...]:
    """The keys of `record` that nobody read, in their order."""
    taken = set(used)
    return tuple(key for key in record if key not in taken)


def numbers_in(text: str) -> list[float]:
    """The numbers of a printed array such as "[[ 438. 0.]\\n [0. 1.]]"."""
    return [float(word) for word in re.findall(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?", text)]
