"""Random photographs of targets with known truth, and how far each calibration is off: one function per table row.

Every draw: 640 × 480 px, f 250–420 px, principal point within 12 px of the middle, 5 to 8 rings (or a line grid),
1 % noise, blur of 0.8–2 px, up to three glares, full, round or octagonal field, fall-off cos^μ or exp(−μ(1 − cos α)).
"""

from collections.abc import Callable
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from data_synth.target_patterns import LineGrid, Rings
from data_synth.targets import Studio, photograph
from jaxsfs.calibration import Calibration, calibrate_circles, calibrate_grid, calibrate_white, tilted
from jaxsfs.camera import Equisolid, Spherical
from jaxsfs.photometry import CosineFalloff, ExponentialFalloff, GammaResponse, parse_falloff, parse_response

WIDTH, HEIGHT = SIZE = (640, 480)
_FAR = 1e6  # mm: rings that are not printed, so that one compiled renderer serves all sheets
_MOST_RINGS = 8
Draw = dict[str, Any]


def spherical(rng: np.random.Generator, k: float = 0.0) -> Spherical:
    f, (cx, cy) = rng.uniform(250, 420), _principal_point(rng)
    return Spherical(f=f, cx=cx, cy=cy, width=WIDTH, height=HEIGHT, k=k)


def equisolid(rng: np.random.Generator) -> Equisolid:
    f, (cx, cy) = rng.uniform(250, 330), _principal_point(rng)
    return Equisolid(f=f, cx=cx, cy=cy, width=WIDTH, height=HEIGHT)


def _principal_point(rng: np.random.Generator) -> tuple[float, float]:
    return (SIZE[0] - 1) / 2 + rng.uniform(-12, 12), (SIZE[1] - 1) / 2 + rng.uniform(-12, 12)


def studio(rng: np.random.Generator, **more) -> Studio:
    falloff = CosineFalloff(rng.uniform(0, 2)) if rng.random() < 0.5 else ExponentialFalloff(rng.uniform(0, 3))
    glares = tuple(
        (float(rng.uniform(120, 520)), float(rng.uniform(80, 400)), float(rng.uniform(6, 16)))
        for _ in range(rng.integers(0, 4))
    )
    field = {
        "blur": float(rng.uniform(0.8, 2.0)),
        "glares": glares,
        "field": str(rng.choice(["full", "round", "octagon"])),
        "field_radius": float(rng.uniform(0.95, 1.2)),
    }
    return Studio(falloff=falloff, **(field | more))


def sheet(rng: np.random.Generator) -> tuple[tuple[float, ...], Rings]:
    """The printed radii and the sheet."""
    radii = tuple(5.0 * (i + 1) for i in range(rng.integers(5, _MOST_RINGS + 1)))
    unprinted = tuple(_FAR * (i + 1) for i in range(_MOST_RINGS - len(radii)))
    return radii, Rings(radii + unprinted, float(rng.uniform(0.6, 1.0)), 1.0)


def height_for(rng: np.random.Generator, camera, outer: float) -> float:
    """The height in mm at which the outermost ring reaches 0.75–1.2 of half the picture's height."""
    radius = min(rng.uniform(0.75, 1.2) * SIZE[1] / 2, 0.92 * camera.f)
    ray = _ray(camera, jnp.array([camera.cx + radius, camera.cy]))
    return outer * float(ray[2] / ray[0])


@jax.jit  # else the search for the ray is compiled anew in every draw
def _ray(camera, pixel):
    return camera.ray(pixel)


def pose(rng: np.random.Generator, height: float, most_tilt: float, most_offset: float = 0.05):
    """Tilt and offset (a share of the height) up to the given ones, in any direction."""
    offset = most_offset * height * rng.uniform(-1, 1, 2) / np.sqrt(2)
    return tilted(most_tilt * np.sqrt(rng.random()), rng.uniform(0, 360), height, tuple(offset.tolist()))


def circles(
    rng: np.random.Generator, tilt: float, views: int = 1, offset: float = 0.05, known: bool = False, k=0.0
) -> Draw:
    """Concentric circles; `known`: the height is given, 1 % off at one standard deviation."""
    camera = spherical(rng, k)
    radii, pattern = sheet(rng)
    height = height_for(rng, camera, radii[-1])
    poses = [pose(rng, height * (rng.uniform(0.9, 1.2) if views > 1 else 1), tilt, offset) for _ in range(views)]
    look = studio(rng)
    images = [photograph(camera, pattern, one, look, int(rng.integers(1 << 31))) for one in poses]
    measured = height * float(np.exp(0.01 * rng.standard_normal())) if known else None
    found = calibrate_circles(images, radii, measured, 0.01, model="spherical-k" if k else "spherical")
    draw = errors(found, camera)
    if k:
        draw["k_error"] = float(found.fit.parameters[4]) - k
    if views == 1:
        draw["eq20_error"] = _eq20(found, radii, measured) / camera.f - 1
    return draw


def _eq20(found: Calibration, radii, height: float | None) -> float:
    """f̄ of eq. (20) with the given height, or where none is given with the fitted one."""
    view = found.views[0].figures
    rings, fitted = np.asarray(view["rings_mm"]), view["height_mm"]
    sine = rings / np.hypot(rings, height or fitted)
    return view["paper"]["eq20_f"] * float(np.mean(rings / np.hypot(rings, fitted) / sine))


def grid(rng: np.random.Generator) -> Draw:
    """A line grid, one view, tilt to 20°."""
    camera = spherical(rng)
    pitch = 4.0
    height = height_for(rng, camera, pitch * rng.uniform(4, 8))
    one = pose(rng, height, 20.0, 0.2)
    pattern = LineGrid(pitch, float(rng.uniform(0.4, 0.7)))
    return errors(calibrate_grid([photograph(camera, pattern, one, studio(rng), int(rng.integers(1 << 31)))]), camera)


def named(rng: np.random.Generator) -> Draw:
    """An equisolid lens, one view of circles, tilt to 8°, target out to 50° or more: is it called so?"""
    camera = equisolid(rng)
    radii, pattern = sheet(rng)
    height = radii[-1] / float(np.tan(np.radians(rng.uniform(50, 62))))
    one = pose(rng, height, 8.0)
    look = studio(rng)
    found = calibrate_circles([photograph(camera, pattern, one, look, int(rng.integers(1 << 31)))], radii, model="auto")
    return errors(found, camera) | {"named": found.fit.name}


def errors(found: Calibration, camera) -> Draw:
    """Errors and quoted 1σ of f (relative) and of the principal point (px)."""
    lens, sd = found.fit.parameters, [found.sd(i) for i in range(3)]
    return {
        "f_error": found.fit.f / camera.f - 1,
        "cx_error": float(lens[1]) - camera.cx,
        "cy_error": float(lens[2]) - camera.cy,
        "f_sd": sd[0],
        "cx_sd": sd[1],
        "cy_sd": sd[2],
        "rms_px": found.fit.rms,
        "alpha_max_deg": found.alpha_max_deg,
        "model": found.fit.name,
        "warnings": len(found.warnings),
    }


def white(rng: np.random.Generator, views: int) -> Draw:
    """White paper under the rings, camera and poses known; two views of which one is tilted by 10–20°, or one
    square-on."""
    camera = spherical(rng)
    radii, pattern = sheet(rng)
    height = height_for(rng, camera, radii[-1])
    tilt = tilted(rng.uniform(10, 20), rng.uniform(0, 360), height * rng.uniform(0.9, 1.2))
    poses = [tilted(0.0, 0.0, height), tilt][:views]
    gamma = rng.uniform(1.6, 2.6)
    look = studio(rng, response=GammaResponse(gamma), exposure=0.9)
    gain = 0.75 * height**2 * float(look.response.decode(jnp.asarray(0.9)))
    images = [photograph(camera, pattern, one, look, int(rng.integers(1 << 31)), gain) for one in poses]
    found = calibrate_white(images, camera, poses)
    cosine = jnp.cos(jnp.radians(jnp.linspace(0.0, 60.0, 61)))
    fitted, truth = parse_falloff(found.falloff)(cosine), look.falloff(cosine)
    draw = {"alpha_max_deg": found.alpha_deg[-1], "separated": found.separated, "warnings": 0}
    if views == 2:
        draw["gamma_error"] = (found.gamma or np.nan) / gamma - 1
        draw["gamma_sd"] = (found.gamma_sd or np.nan) / gamma
        draw["falloff_error"] = float(jnp.max(jnp.abs(fitted / truth - 1)))
        return draw
    seen = np.asarray(cosine) > np.cos(np.radians(found.alpha_deg[-1]))
    square = gain / height**2 * cosine**3
    stored = parse_response(found.response).encode((found.gain_albedo or np.nan) / height**2 * cosine**3 * fitted)
    return draw | {"product_error": float(np.max(np.abs(stored / look.response.encode(square * truth) - 1)[seen]))}


ROWS: dict[str, Callable[[np.random.Generator], Draw]] = {
    "circles-known": lambda rng: circles(rng, 1.0, known=True),
    "circles-square": lambda rng: circles(rng, 1.0),
    "circles-one": lambda rng: circles(rng, 8.0),
    "circles-three": lambda rng: circles(rng, 20.0, views=3, offset=0.2),
    "circles-three-k": lambda rng: circles(rng, 20.0, views=3, offset=0.2, k=0.035),
    "grid": grid,
    "equisolid": named,
    "white-two": lambda rng: white(rng, 2),
    "white-one": lambda rng: white(rng, 1),
}
