"""Scenes by name, by seed, and as text: what `jaxsfs render SCENE` accepts."""

import dataclasses
import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from data_synth.occluding import BallInBowl, FoldedColon, PolypWall, Vase
from data_synth.scene import AbstractScene
from data_synth.smooth import Ball, HollowBall, Plane, Tube, WavyWall
from jaxsfs.camera import AbstractCamera, Orthographic, Spherical
from jaxsfs.forms import Scalar

_KINDS: dict[str, type[AbstractScene]] = {
    "plane": Plane,
    "ball": Ball,
    "hollow-ball": HollowBall,
    "wavy-wall": WavyWall,
    "tube": Tube,
    "ball-in-bowl": BallInBowl,
    "vase": Vase,
    "polyps": PolypWall,
    "colon": FoldedColon,
}

SCENES: dict[str, Callable[[], AbstractScene]] = {**_KINDS, "tilted-plane": lambda: Plane(1.2, 0.35, -0.2)}

# Seeds for choosing defaults and thresholds, and seeds for figures that are reported: never the same.
TUNING_SEEDS = range(0, 1000)
REPORT_SEEDS = range(1000, 2000)


def random_scene(seed: int) -> AbstractScene:
    """A scene of random kind and parameters, always the same for the same seed; for a central camera.

    Nearest surface points lie at a range of about 0.7–2 scene units.
    """
    if seed < 0:
        raise ValueError(f"a scene's seed is a whole number from 0 on, got {seed}")
    rng = np.random.default_rng(seed)
    draw = _DRAWS[rng.integers(len(_DRAWS))]

    def number(low: Scalar, high: Scalar) -> float:
        # rounded, so that a scene's description in decimal digits is the scene
        return round(float(rng.uniform(low, high)), 4)

    return draw(number, rng)


def scene_from_text(text: str) -> AbstractScene:
    """The scene that `text` names: one of SCENES with its default parameters, or `random:SEED`.

    Raises ValueError that lists the names.
    """
    name, _, rest = text.partition(":")
    if name == "random" and rest.isdecimal():
        return random_scene(int(rest))
    if text not in SCENES:
        raise ValueError(f"scene {text!r} is unknown; write one of: {', '.join(sorted(SCENES))}, random:SEED")
    return SCENES[text]()


def scene_to_dict(scene: AbstractScene) -> dict[str, Any]:
    """The description that `scene_from_dict` reads back: {"kind": …, "parameters": {…}}, ready for JSON."""
    kind = next((kind for kind, cls in _KINDS.items() if cls is type(scene)), None)
    if kind is None:
        raise ValueError(f"{type(scene).__name__} has no name in the catalogue; known: {', '.join(_KINDS)}")
    fields = dataclasses.fields(scene)  # type: ignore[arg-type]
    return {"kind": kind, "parameters": {field.name: _plain(getattr(scene, field.name)) for field in fields}}


def scene_from_dict(description: Mapping[str, Any]) -> AbstractScene:
    """The scene of a description: `kind` and `parameters` (those left out have their defaults); or, without a
    kind, the `name` that `scene_from_text` knows.

    Raises ValueError that names the key for an unknown kind or parameter, or a value that is no number.
    """
    if "kind" not in description:
        return scene_from_text(str(description.get("name")))
    kind, parameters = description["kind"], description.get("parameters") or {}
    if kind not in _KINDS:
        raise ValueError(f"scene kind {kind!r} is unknown; 'kind' must be one of: {', '.join(_KINDS)}")
    if not isinstance(parameters, Mapping):
        raise ValueError(f"'parameters' must be an object such as {{\"radius\": 1.5}}, got {parameters!r}")
    known = [field.name for field in dataclasses.fields(_KINDS[kind])]  # type: ignore[arg-type]
    unknown = [key for key in parameters if key not in known]
    if unknown:
        raise ValueError(f"a scene of kind {kind!r} has no {unknown[0]!r}; its parameters: {', '.join(known)}")
    return _KINDS[kind](**{key: _parameter(key, value) for key, value in parameters.items()})


def default_camera(
    scene: AbstractScene, width: int = 640, height: int = 480, half_field_deg: Scalar = 50
) -> AbstractCamera:
    """The camera that looks at `scene` unless one is given: spherical, with `half_field_deg` at the middle of the
    short side, f = (short/2)/sin(half field); for the vase the survey's orthographic one, the short side 1 unit.

    Raises ValueError for a half field outside (0°, 90°).
    """
    short = min(width, height)
    cx, cy = (width - 1) / 2, (height - 1) / 2
    if isinstance(scene, Vase):
        return Orthographic(scale=float(short), cx=cx, cy=cy, width=width, height=height)
    if not 0 < half_field_deg < 90:
        raise ValueError(f"half_field_deg must lie between 0 and 90 degrees, got {half_field_deg}")
    f = short / 2 / math.sin(math.radians(half_field_deg))
    return Spherical(f=f, cx=cx, cy=cy, width=width, height=height)


def _plain(value: Any) -> Any:
    return [_plain(part) for part in value] if isinstance(value, tuple) else float(value)


def _parameter(key: str, value: Any) -> Any:
    if key == "polyps":
        if not isinstance(value, list) or not all(isinstance(one, list) and len(one) == 4 for one in value):
            raise ValueError(f"scene parameter 'polyps' must be a list of [x, y, lift, radius], got {value!r}")
        return tuple(tuple(_parameter("polyps' numbers", part) for part in one) for one in value)
    if isinstance(value, bool) or not isinstance(value, int | float) or not math.isfinite(value):
        raise ValueError(f"scene parameter {key!r} must be a finite number, got {value!r}")
    return float(value)


def _polyps(number, rng) -> PolypWall:
    polyps = []
    for sector in range(int(rng.integers(1, 4))):
        # one polyp per third of the turn keeps them apart
        angle, away, radius = number(0, 2) + 2.09 * sector, number(0.3, 0.7), number(0.12, 0.28)
        lift = round(radius * number(0.3, 0.9), 4)
        polyps.append((round(away * math.cos(angle), 4), round(away * math.sin(angle), 4), lift, radius))
    return PolypWall(tuple(polyps), number(1.3, 1.8), number(-0.25, 0.25), number(-0.25, 0.25), number(0.06, 0.15))


def _hollow_ball(number, rng) -> HollowBall:
    radius = number(1.8, 2.6)
    return HollowBall(radius, number(-0.25, 0.25), number(-0.25, 0.25), round(-radius * number(0.3, 0.55), 4))


def _ball(number, rng) -> Ball:
    distance, nearest = number(6, 12), number(0.8, 1.2)
    return Ball(round(distance - nearest, 4), number(-0.2, 0.2), number(-0.2, 0.2), distance)


_DRAWS = (
    lambda number, rng: Plane(number(0.8, 1.8), number(-0.4, 0.4), number(-0.4, 0.4)),
    _ball,
    _hollow_ball,
    lambda number, rng: WavyWall(number(1.0, 1.8), number(0.015, 0.04), number(7, 13), number(1.0, 1.6)),
    lambda number, rng: Tube(number(0.8, 1.3), number(-0.3, 0.3), number(-0.3, 0.3), number(3, 7)),
    lambda number, rng: BallInBowl(
        number(0.25, 0.5), number(-0.5, 0.5), number(-0.5, 0.5), number(1.2, 1.7), number(2.0, 2.5), number(-0.3, 0.6)
    ),
    _polyps,
    _polyps,
    lambda number, rng: FoldedColon(
        number(0.8, 1.2),
        number(0.15, 0.35),
        number(0.9, 1.5),
        number(1.0, 1.6),
        number(2.0, 4.0),
        number(-0.3, 0.3),
        number(-0.5, 0.5),
        number(-0.2, 0.2),
        number(-0.2, 0.2),
        number(4.5, 7.0),
    ),
)
