"""Lenses that see the same field, for comparing them."""

import math

from jaxsfs import (
    AbstractCamera,
    Equidistant,
    Equisolid,
    KannalaBrandt,
    Perspective,
    Scaramuzza,
    Spherical,
    Stereographic,
)

K = (-0.1, 0.01, 0.0, 0.0)  # of the Kannala–Brandt lens


def lens_seeing(name: str, degrees: float, size: int, reach: float) -> AbstractCamera:
    """The lens `name` of `LENSES` in a square picture of `size` px, `degrees` off the axis at `reach` px."""
    centre = (size - 1) / 2
    return LENSES[name](reach, math.radians(degrees), {"cx": centre, "cy": centre, "width": size, "height": size})


def _perspective(reach: float, angle: float, place: dict) -> Perspective:
    f = reach / math.tan(angle)
    return Perspective(fx=f, fy=f, **place)


def _kannala_brandt(reach: float, angle: float, place: dict) -> KannalaBrandt:
    f = reach / (angle * (1 + K[0] * angle**2 + K[1] * angle**4))
    return KannalaBrandt(fx=f, fy=f, k=K, **place)


def _scaramuzza(reach: float, angle: float, place: dict) -> Scaramuzza:
    """z = a₀ + a₂ρ²; a₂ < 0 bends the rays outwards, as in real scopes."""
    edge = reach / math.tan(angle)
    a0 = 1.2 * edge
    return Scaramuzza(a=(a0, 0.0, (edge - a0) / reach**2, 0.0, 0.0), **place)


LENSES = {
    "spherical": lambda reach, angle, place: Spherical(f=reach / math.sin(angle), **place),
    "perspective": _perspective,
    "equidistant": lambda reach, angle, place: Equidistant(f=reach / angle, **place),
    "equisolid": lambda reach, angle, place: Equisolid(f=reach / (2 * math.sin(angle / 2)), **place),
    "stereographic": lambda reach, angle, place: Stereographic(f=reach / (2 * math.tan(angle / 2)), **place),
    "kannala-brandt": _kannala_brandt,
    "scaramuzza": _scaramuzza,
}
