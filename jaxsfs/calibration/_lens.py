"""The lens models that a calibration can choose from, over one common parameter vector.

`lens`: (ln f, cx, cy, ln aspect, s₀, s₁, s₂, s₃). Every model has the same f near the axis (radius ≈ f α), so one's
fit is a start for the others.
"""

from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Array, Float, Int

from jaxsfs._arrays import AnyArray, module_of
from jaxsfs.calibration._profiles import AXIAL, HALF_SINE, HALF_TANGENT, SERIES, SINE, TANGENT, angle, radius
from jaxsfs.camera import (
    AbstractCentralCamera,
    Equidistant,
    Equisolid,
    KannalaBrandt,
    Perspective,
    Scaramuzza,
    Spherical,
    Stereographic,
)

LENS_SIZE = 8
ASPECT, SHAPE = 3, 4


class Lens(NamedTuple):
    """One row of the table: `build` is the index of the profile, `shapes` the number of free shape parameters,
    `formula` the radius as users read it, `like_sine` the shape parameters that resemble r = f sin α (a start)."""

    build: int
    shapes: int
    formula: str
    like_sine: tuple[float, ...] = ()


LENSES: dict[str, Lens] = {
    "spherical": Lens(SINE, 0, "r = f sin α"),
    "spherical-k": Lens(SINE, 1, "r = f (s + k s³), s = sin α", (0.0,)),
    "equisolid": Lens(HALF_SINE, 0, "r = 2 f sin(α/2)"),
    "equidistant": Lens(SERIES, 0, "r = f α"),
    "stereographic": Lens(HALF_TANGENT, 0, "r = 2 f tan(α/2)"),
    "perspective": Lens(TANGENT, 0, "r = f tan α"),
    "kannala-brandt-2": Lens(SERIES, 2, "r = f (α + k₁α³ + k₂α⁵)", (-1 / 6, 1 / 120)),
    "kannala-brandt": Lens(SERIES, 4, "r = f (α + k₁α³ + k₂α⁵ + k₃α⁷ + k₄α⁹)", (-1 / 6, 1 / 120, 0.0, 0.0)),
    "scaramuzza": Lens(AXIAL, 3, "ray (x', y', a₀ + a₂ρ² + a₃ρ³ + a₄ρ⁴)", (-0.5, 0.0, -0.125)),
}


def lens_named(name: str) -> Lens:
    """The row of the table. Raises ValueError that lists the names."""
    if name not in LENSES:
        raise ValueError(f"lens model {name!r} is unknown; write one of: {', '.join(LENSES)}")
    return LENSES[name]


def start_lens(f: float, cx: float, cy: float) -> np.ndarray:
    """The parameter vector with square pixels and no shape terms."""
    return np.array([np.log(f), cx, cy, 0.0, 0.0, 0.0, 0.0, 0.0])


def camera_of(name: str, lens: Float[np.ndarray, "8"], width: int, height: int) -> AbstractCentralCamera:
    """The camera of a fitted parameter vector, with plain numbers as parameters."""
    row = lens_named(name)
    f, aspect = float(np.exp(lens[0])), float(np.exp(lens[ASPECT]))
    place: dict[str, Any] = {"cx": float(lens[1]), "cy": float(lens[2]), "width": width, "height": height}
    shape = [float(s) if i < row.shapes else 0.0 for i, s in enumerate(lens[SHAPE:])]
    if name == "perspective":
        return Perspective(fx=f, fy=f * aspect, **place)
    if name.startswith("kannala-brandt"):
        return KannalaBrandt(fx=f, fy=f * aspect, k=(shape[0], shape[1], shape[2], shape[3]), **place)
    if name == "scaramuzza":
        # aₙ = sₙ₋₂ f^(1−n) keeps the shape parameters of order one; the stretch takes the aspect
        fy = f * aspect
        a = (fy, 0.0, shape[0] / fy, shape[1] / fy**2, shape[2] / fy**3)
        return Scaramuzza(a=a, c=1 / aspect, d=0.0, e=0.0, **place)
    if name.startswith("spherical"):
        return Spherical(f=f, aspect=aspect, k=shape[0], **place)
    single = {"equisolid": Equisolid, "equidistant": Equidistant, "stereographic": Stereographic}[name]
    return single(f=f, aspect=aspect, **place)


class Rays(NamedTuple):
    """Unit rays d of pixels, ∂d/∂pixel and ∂d/∂lens."""

    ray: Float[AnyArray, "count 3"]
    slope: Float[AnyArray, "count 3 2"]
    by_lens: Float[AnyArray, "count 3 8"]


def rays(build: int | Int[Array, ""], lens: Float[AnyArray, "8"], pixels: Float[AnyArray, "count 2"]) -> Rays:
    """Rays of `pixels` by profile number `build`, in numpy for numpy arrays."""
    xp = module_of(pixels)
    fx, fy = xp.exp(lens[0]), xp.exp(lens[0] + lens[ASPECT])
    u, v = pixels[:, 0] - lens[1], pixels[:, 1] - lens[2]
    x, y = u / fx, v / fy
    q = xp.sqrt(x * x + y * y + 1e-20)
    x, y = x / q, y / q
    alpha, slope, by_shape = angle(build, lens[SHAPE:], q)
    sine, cosine = xp.sin(alpha), xp.cos(alpha)
    outward = xp.stack([cosine * x, cosine * y, -sine], axis=1)  # ∂d/∂α
    across, mixed = sine / q, (slope * cosine - sine / q) * x * y
    # radially α'(q), tangentially sin α/q
    by_u = xp.stack([slope * cosine * x * x + across * y * y, mixed, -slope * sine * x], axis=1) / fx
    by_v = xp.stack([mixed, slope * cosine * y * y + across * x * x, -slope * sine * y], axis=1) / fy
    by_aspect = -by_v * v[:, None]
    columns = [by_aspect - by_u * u[:, None], -by_u, -by_v, by_aspect]
    columns += [outward * by_shape[i][:, None] for i in range(LENS_SIZE - SHAPE)]
    slopes, by_lens = xp.stack([by_u, by_v], axis=2), xp.stack(columns, axis=2)
    return Rays(xp.stack([sine * x, sine * y, cosine], axis=1), slopes, by_lens)


class Images(NamedTuple):
    """Pixels at which points are seen, ∂pixel/∂point and ∂pixel/∂lens."""

    pixel: Float[AnyArray, "count 2"]
    by_point: Float[AnyArray, "count 2 3"]
    by_lens: Float[AnyArray, "count 2 8"]


def images(build: int | Int[Array, ""], lens: Float[AnyArray, "8"], points: Float[AnyArray, "count 3"]) -> Images:
    """Images of `points` of the camera frame by profile number `build`, in numpy for numpy arrays."""
    xp = module_of(points)
    focal = xp.exp(xp.stack([lens[0], lens[0] + lens[ASPECT]]))[None]
    off, z = points[:, :2], points[:, 2]
    across = xp.sqrt(xp.sum(off**2, axis=1) + 1e-18)
    x, y = off[:, 0] / across, off[:, 1] / across
    towards, sideways = xp.stack([x, y], axis=1), xp.stack([-y, x], axis=1)
    q, slope, by_shape = radius(build, lens[SHAPE:], xp.arctan2(across, z))
    by_angle = xp.stack([z * x, z * y, -across], axis=1) / (across**2 + z**2)[:, None]  # ∂α/∂point
    by_turn = xp.stack([-y, x, xp.zeros_like(x)], axis=1) / across[:, None]  # of the azimuth
    by_point = (slope[:, None] * towards)[..., None] * by_angle[:, None]
    by_point = by_point + (q[:, None] * sideways)[..., None] * by_turn[:, None]
    place = focal * q[:, None] * towards
    one, zero = xp.ones_like(q), xp.zeros_like(q)
    columns = [place, xp.stack([one, zero], axis=1), xp.stack([zero, one], axis=1)]
    columns += [xp.stack([zero, place[:, 1]], axis=1)]
    columns += [focal * towards * by_shape[i][:, None] for i in range(LENS_SIZE - SHAPE)]
    return Images(lens[None, 1:3] + place, focal[..., None] * by_point, xp.stack(columns, axis=2))
