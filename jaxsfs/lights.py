"""Lights beside the lens: where they are, how they shine, and the irradiance that a surface point gets from them.

Real scopes have two to four light guides a few millimetres from the lens. With their positions in millimetres the
equation has a length in it: range and albedo must be in that unit too.
"""

import math
from collections.abc import Mapping
from typing import Any

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxsfs.forms import Scalar, power, require
from jaxsfs.photometry import (
    AbstractFalloff,
    CosineExponentialFalloff,
    CosineFalloff,
    ExponentialFalloff,
    NoFalloff,
    parse_falloff,
)
from jaxsfs.reflectance import AbstractReflectance, Lambertian, Power

Triple = tuple[Scalar, Scalar, Scalar]

_LAMBERTIAN = Lambertian()
_KEYS = ("position", "power", "direction", "spread")
_EXAMPLE = (
    '{"unit": "mm", "lights": [{"position": [3.5, 0, 0], "power": 1, "direction": [0, 0, 1], "spread": "cos:1"}]}'
)


class Light(eqx.Module):
    """A small light at `position` (mm, camera frame: x right, y down, z forward) of relative `power`.

    `spread` is S(cos ψ), ψ the angle from `direction` (any length above 0): the share of the light on the axis that
    goes that way. `NoFalloff()` shines everywhere alike.
    """

    position: Triple
    power: Scalar = 1.0
    direction: Triple = (0.0, 0.0, 1.0)
    spread: AbstractFalloff = NoFalloff()

    def __check_init__(self):
        for part in (*self.position, *self.direction):
            require(part, math.isfinite, "a light's position and direction must be finite numbers")
        require(self.power, lambda p: 0 < p < math.inf, "a light's power must be positive and finite")
        if all(isinstance(part, int | float) and part == 0 for part in self.direction):
            raise ValueError("a light's direction must not be (0, 0, 0); (0, 0, 1) is the viewing direction")


class Lights(eqx.Module):
    """All lights of a scope. Only the ratios of their powers count: together they are as strong as the single light
    at the lens that the albedo (gain·ρ) belongs to, so far away the two models agree."""

    lights: tuple[Light, ...]

    def __check_init__(self):
        if not self.lights:
            raise ValueError("a scope needs at least one light")


def reflected(
    reflectance: AbstractReflectance, towards_light: Float[Array, "*shape"], towards_eye: Float[Array, "*shape"]
) -> Float[Array, "*shape"]:
    """G for a light that is not at the eye: cos^((a+1)/2) θ_i · cos^((a−1)/2) θ_e, Minnaert's law.

    The reciprocal law that becomes cos^a θ where light and eye coincide (Minnaert 1941); a = 1, cos θ_i, for a
    Lambertian surface. `towards_light`, `towards_eye`: cosines of the angles θ_i, θ_e between the normal and the
    directions of light and eye; 0 where one of them is not positive. Raises ValueError for other reflectances.
    """
    check_two_angles(reflectance)
    if isinstance(reflectance, Lambertian):
        return jnp.where(towards_eye > 0, jnp.maximum(towards_light, 0), 0)
    a = reflectance.exponent()
    return power(towards_light, 0.5 * (a + 1)) * power(towards_eye, 0.5 * (a - 1))


def check_two_angles(reflectance: AbstractReflectance) -> None:
    """Raises ValueError for a reflectance that is only known where light and eye coincide."""
    if not isinstance(reflectance, Lambertian | Power):
        raise ValueError(
            f"{type(reflectance).__name__} reflectance is only known for a light at the lens; with lights beside it "
            "use lambertian or power:A"
        )


def shade_lights(
    points: Float[Array, "*shape 3"],
    normals: Float[Array, "*shape 3"],
    lights: Lights,
    *,
    reflectance: AbstractReflectance = _LAMBERTIAN,
    albedo: Scalar | Float[Array, "*shape"] = 1.0,
) -> Float[Array, "*shape"]:
    """Irradiance of surface points under `lights`: E = ρ Σ p_i S_i(cos ψ_i) G(θ_i, θ_e)/|l_i − x|², Σ p_i = 1.

    `points` x in the unit of the lights' positions (mm), `normals` unit and towards the camera, both in the camera
    frame. Shadows that a surface throws on itself from afar are not modelled; points that face away from a light get
    nothing from it. One light at (0, 0, 0) without spread gives ρ G(cos θ)/r² (eq. 5).
    """
    eye = -jnp.sum(normals * points, axis=-1) / _length(points)
    total = sum(light.power for light in lights.lights)
    irradiance = jnp.zeros_like(eye)
    for light in lights.lights:
        beam = points - _vector(light.position, points)
        distance = _length(beam)
        axis = _vector(light.direction, points)
        turned = jnp.sum(beam * axis, axis=-1) / (distance * _length(axis))
        facing = -jnp.sum(normals * beam, axis=-1) / distance
        share = light.power / total
        irradiance = irradiance + share * light.spread(turned) * reflected(reflectance, facing, eye) / distance**2
    return albedo * irradiance


def lights_from_dict(description: Mapping[str, Any]) -> Lights:
    """The lights of a description: {"unit": "mm", "lights": [{"position": [x, y, z], "power": 1, "direction":
    [0, 0, 1], "spread": "cos:1"}, …]}; power, direction and spread (a `parse_falloff` text) may be left out.

    Raises ValueError that names the light and the key that is wrong.
    """
    unit, entries = description.get("unit"), description.get("lights")
    if unit != "mm":
        raise ValueError(f"the lights' 'unit' must be \"mm\", got {unit!r}; write {_EXAMPLE}")
    if not isinstance(entries, list) or not entries:
        raise ValueError(f"'lights' must be a list of at least one light, got {entries!r}; write {_EXAMPLE}")
    return Lights(tuple(_light(entry, f"lights[{index}]") for index, entry in enumerate(entries)))


def lights_to_dict(lights: Lights) -> dict[str, Any]:
    """The description that `lights_from_dict` reads back."""
    return {
        "unit": "mm",
        "lights": [
            {
                "position": [float(x) for x in light.position],
                "power": float(light.power),
                "direction": [float(x) for x in light.direction],
                "spread": _spread_text(light.spread),
            }
            for light in lights.lights
        ],
    }


def _light(entry: Any, where: str) -> Light:
    if not isinstance(entry, Mapping):
        raise ValueError(f"{where} must be an object with a 'position', got {entry!r}; write {_EXAMPLE}")
    unknown = [key for key in entry if key not in _KEYS]
    if unknown:
        raise ValueError(f"{where} has no {unknown[0]!r}; its keys: {', '.join(_KEYS)}")
    if "position" not in entry:
        raise ValueError(f"{where} lacks its 'position' [x, y, z] in mm (x right, y down, z forward)")
    spread = entry.get("spread", "none")
    if not isinstance(spread, str):
        raise ValueError(f"{where}: 'spread' must be a text such as \"cos:1\", got {spread!r}")
    try:
        return Light(
            _triple(entry["position"], "position"),
            _number(entry.get("power", 1.0), "power"),
            _triple(entry.get("direction", [0, 0, 1]), "direction"),
            parse_falloff(spread),
        )
    except ValueError as error:
        raise ValueError(f"{where}: {error}") from None


def _triple(value: Any, key: str) -> tuple[float, float, float]:
    if not isinstance(value, list | tuple) or len(value) != 3:
        raise ValueError(f"{key!r} must be a list of three numbers, got {value!r}")
    x, y, z = (_number(part, key) for part in value)
    return x, y, z


def _number(value: Any, key: str) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise ValueError(f"{key!r} must hold finite numbers, got {value!r}")
    return float(value)


def _spread_text(spread: AbstractFalloff) -> str:
    if isinstance(spread, CosineFalloff):
        return f"cos:{float(spread.mu)!r}"
    if isinstance(spread, ExponentialFalloff):
        return f"exp:{float(spread.mu)!r}"
    if isinstance(spread, NoFalloff):
        return "none"
    if isinstance(spread, CosineExponentialFalloff):
        return f"cosexp:{float(spread.a)!r},{float(spread.b)!r}"
    raise ValueError(
        f"a light's spread of type {type(spread).__name__} cannot be written; use none, cos:MU, exp:MU or cosexp:A,B"
    )


def _vector(parts: Triple, like: Float[Array, "*shape 3"]) -> Float[Array, "*shape 3"]:
    return jnp.broadcast_to(jnp.stack([jnp.asarray(part, like.dtype) for part in parts]), like.shape)


def _length(vector: Float[Array, "*shape 3"]) -> Float[Array, "*shape"]:
    return jnp.sqrt(jnp.sum(vector**2, axis=-1))
