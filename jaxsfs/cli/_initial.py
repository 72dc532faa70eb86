"""`--initial` and `--heights`: what is known of the surface to begin with."""

import csv
import io
import math
from pathlib import Path

import jax.numpy as jnp

from jaxsfs.cli._settings import numbers
from jaxsfs.files import InputError, read_mask
from jaxsfs.files._atomic import read_bytes
from jaxsfs.initial import AbstractInitial, Curve, Deadline, SingularPoint, SummitHeights, Threshold

_FORMS = "deadline, singular-point, singular-point:U,V, singular-point:U,V,RANGE, threshold:E, curve:MASK.png,RANGE"


def parse_initial(text: str, size: tuple[int, int]) -> AbstractInitial:
    """The initial condition that `text` names, for an image of `size` (width, height).

    Raises InputError that lists the forms, or says what a pixel, a number or a mask should have been.
    """
    name, _, rest = text.strip().partition(":")
    if text.strip() == "deadline":
        return Deadline()
    if text.strip() == "singular-point":
        return SingularPoint(None, None)
    if name == "singular-point" and rest:
        form = "U,V,RANGE" if rest.count(",") == 2 else "U,V"
        u, v, *distance = _numbers("--initial singular-point", rest, form)
        if distance:
            _positive("the range of --initial singular-point", distance[0])
        return SingularPoint(_pixel("--initial singular-point", u, v, size), *(distance or [None]))
    if name == "threshold" and rest:
        (level,) = _numbers("--initial threshold", rest, "E")
        return Threshold(_positive("the irradiance of --initial threshold", level))
    if name == "curve" and "," in rest:
        path, _, distance = rest.rpartition(",")
        (known,) = _numbers("--initial curve", distance, "RANGE")
        mask = read_mask(path)
        check_mask_size(path, mask.shape, size)
        return Curve(jnp.asarray(mask), _positive("the range of --initial curve", known))
    raise InputError(f"--initial {text!r} is unknown; write one of: {_FORMS}")


def read_heights(path: Path, size: tuple[int, int]) -> SummitHeights:
    """Heights at singular points from a CSV file with the header u,v,z (z: distance along the optical axis).

    Raises InputError that names the line that is wrong.
    """
    return SummitHeights(jnp.asarray([(*pixel, z) for *pixel, z in _points(path, "z", size)], float))


def read_known_ranges(path: Path, size: tuple[int, int]) -> list[tuple[int, int, float]]:
    """Known ranges from a CSV file with the header u,v,range. Raises InputError that names the line that is wrong."""
    points = _points(path, "range", size)
    for number, (_, _, distance) in enumerate(points, start=2):
        _positive(f"the range in line {number} of {path}", distance)
    return points


def _points(path: Path, third: str, size: tuple[int, int]) -> list[tuple[int, int, float]]:
    """Lines u,v,`third` of a CSV file with that header."""
    header = f"u,v,{third}"
    try:
        text = read_bytes(path).decode("utf-8-sig")
    except UnicodeDecodeError:
        raise InputError(f"{path} is not a text file; expected CSV with the header {header}") from None
    rows = [[cell.strip() for cell in row] for row in csv.reader(io.StringIO(text)) if row]
    if not rows or [cell.lower() for cell in rows[0]] != header.split(","):
        found = ",".join(rows[0]) if rows else "nothing"
        raise InputError(f"{path} must begin with the header {header}, got {found!r}")
    if len(rows) == 1:
        raise InputError(f"{path} has no line below its header; expected one line {header} per point")
    points = []
    for number, row in enumerate(rows[1:], start=2):
        u, v, value = _numbers(f"line {number} of {path}", ",".join(row), header.upper())
        points.append((*_pixel(f"line {number} of {path}", u, v, size), value))
    return points


def parse_known_range(text: str, size: tuple[int, int]) -> tuple[tuple[int, int], float]:
    """((u, v), range) of `--known-range U,V,R`."""
    u, v, distance = _numbers("--known-range", text, "U,V,R")
    return _pixel("--known-range", u, v, size), _positive("the range of --known-range", distance)


def check_mask_size(path: str | Path, shape: tuple[int, ...], size: tuple[int, int]) -> None:
    """Raises InputError that names both sizes where a mask is not of the photograph's."""
    if shape != (size[1], size[0]):
        raise InputError(
            f"the mask {path} is {shape[1]} x {shape[0]} px and the photograph {size[0]} x {size[1]} px; "
            "give a mask of the photograph's size"
        )


def _numbers(what: str, text: str, form: str) -> list[float]:
    values = numbers(what, text, form)
    if not all(math.isfinite(value) for value in values):
        raise InputError(f"{what} needs finite numbers in the form {form}, got {text!r}")
    return values


def _pixel(what: str, u: float, v: float, size: tuple[int, int]) -> tuple[int, int]:
    width, height = size
    inside = 0 <= u <= width - 1 and 0 <= v <= height - 1
    if not inside or u != int(u) or v != int(v):
        raise InputError(
            f"{what} needs a pixel (whole numbers, U from 0 to {width - 1}, V from 0 to {height - 1}), got {u:g},{v:g}"
        )
    return int(u), int(v)


def _positive(what: str, value: float) -> float:
    if not value > 0:
        raise InputError(f"{what} must be above 0, got {value:g}")
    return value
