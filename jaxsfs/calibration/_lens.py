"""The lens models that a calibration can choose from, over one common parameter vector.

`lens`: (ln f, cx, cy, ln aspect, s₀, s₁, s₂, s₃). Every model has the same f near the axis (radius ≈ f α), so one's
fit is a start for the others. The fits need only α(q), q = radius/f, and its slope; written out here for all models
side by side (the cameras' own `ray` would be differentiated twice and compile ten times longer; a test holds the two
together). One compiled program serves all models: the model is an index into `lax.switch`.
"""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

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
_EDGE = 0.998  # beyond this share of a finite field α(q) is continued by its tangent: a slope leads the fit back


class Lens(NamedTuple):
    """One row of the table: `build` is the index of the profile, `shapes` the number of free shape parameters,
    `formula` the radius as users read it, `like_sine` the shape parameters that resemble r = f sin α (a start)."""

    build: int
    shapes: int
    formula: str
    like_sine: tuple[float, ...] = ()


LENSES: dict[str, Lens] = {
    "spherical": Lens(0, 0, "r = f sin α"),
    "spherical-k": Lens(1, 1, "r = f (s + k s³), s = sin α", (0.0,)),
    "equisolid": Lens(2, 0, "r = 2 f sin(α/2)"),
    "equidistant": Lens(3, 0, "r = f α"),
    "stereographic": Lens(4, 0, "r = 2 f tan(α/2)"),
    "perspective": Lens(5, 0, "r = f tan α"),
    "kannala-brandt-2": Lens(6, 2, "r = f (α + k₁α³ + k₂α⁵)", (-1 / 6, 1 / 120)),
    "kannala-brandt": Lens(6, 4, "r = f (α + k₁α³ + k₂α⁵ + k₃α⁷ + k₄α⁹)", (-1 / 6, 1 / 120, 0.0, 0.0)),
    "scaramuzza": Lens(7, 3, "ray (x', y', a₀ + a₂ρ² + a₃ρ³ + a₄ρ⁴)", (-0.5, 0.0, -0.125)),
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


def ray_and_slope(
    build: Int[Array, ""], lens: Float[Array, "8"], pixel: Float[Array, "2"]
) -> tuple[Float[Array, "3"], Float[Array, "3 2"]]:
    """The unit ray d of `pixel` and ∂d/∂pixel: radially α'(q), tangentially sin α/q."""
    focal = jnp.exp(lens[0]) * jnp.stack([jnp.ones_like(lens[0]), jnp.exp(lens[ASPECT])])
    q = (pixel - lens[1:3]) / focal
    radius = jnp.sqrt(jnp.sum(q * q) + 1e-20)
    towards = q / radius
    alpha, slope = jax.lax.switch(build, _ANGLES, lens[SHAPE:], radius)
    sine, cosine = jnp.sin(alpha), jnp.cos(alpha)
    along = slope * jnp.append(cosine * towards, -sine)
    across = sine / radius * jnp.stack([-towards[1], towards[0], jnp.zeros_like(sine)])
    jacobian = jnp.outer(along, towards) + jnp.outer(across, jnp.stack([-towards[1], towards[0]]))
    return jnp.append(sine * towards, cosine), jacobian / focal[None, :]


def rays_and_slopes(
    build: Int[Array, ""], lens: Float[Array, "8"], pixels: Float[Array, "count 2"]
) -> tuple[Float[Array, "count 3"], Float[Array, "count 3 2"]]:
    """`ray_and_slope` of many pixels."""
    return jax.vmap(lambda pixel: ray_and_slope(build, lens, pixel))(pixels)


def _explicit(angle, reach: float = np.inf):
    """α(q) and α'(q) of a closed form, continued by its tangent beyond `_EDGE`·`reach`."""

    def evaluate(shape, radius):
        inside = jnp.minimum(radius, _EDGE * reach)
        value, slope = jax.jvp(lambda q: angle(shape, q), (inside,), (jnp.ones_like(inside),))
        return value + slope * (radius - inside), slope

    return evaluate


def _implicit(profile, end: float):
    """α(q) as the root of profile(α) = q: bisection, then Newton; the last step carries the derivatives.

    Where the profile turns back before `end`, α stays at the turning point, continued with a steep slope.
    """

    def value_and_slope(shape, alpha):
        return jax.jvp(lambda a: profile(shape, a), (alpha,), (jnp.ones_like(alpha),))

    def evaluate(shape, radius):
        held, target = jax.lax.stop_gradient(shape), jax.lax.stop_gradient(radius)

        def halve(_, bracket):
            low, high = bracket
            middle = 0.5 * (low + high)
            value, slope = value_and_slope(held, middle)
            below = (value < target) & (slope > 0)
            return jnp.where(below, middle, low), jnp.where(below, high, middle)

        def newton(_, alpha):
            value, slope = value_and_slope(held, alpha)
            return jnp.clip(alpha + jnp.clip((target - value) / jnp.maximum(slope, 0.02), -0.05, 0.05), 0.0, end)

        bracket = jax.lax.fori_loop(0, 8, halve, (jnp.zeros_like(radius), jnp.full_like(radius, end)))
        alpha = jax.lax.stop_gradient(jax.lax.fori_loop(0, 6, newton, 0.5 * (bracket[0] + bracket[1])))
        value, slope = value_and_slope(shape, alpha)
        slope = jnp.maximum(slope, 0.02)
        return alpha + (radius - value) / slope, 1 / slope

    return evaluate


def _sine_cubic(shape, alpha):
    sine = jnp.sin(alpha)
    return sine * (1 + shape[0] * sine**2)


def _series(shape, alpha):
    square = alpha**2
    return alpha * (1 + square * (shape[0] + square * (shape[1] + square * (shape[2] + square * shape[3]))))


def _axial(shape, q):
    return jnp.arctan2(q, 1 + q**2 * (shape[0] + q * (shape[1] + q * shape[2])))


_ANGLES = (
    _explicit(lambda shape, q: jnp.arcsin(q), 1.0),
    _implicit(_sine_cubic, np.pi / 2),
    _explicit(lambda shape, q: 2 * jnp.arcsin(q / 2), 2.0),
    _explicit(lambda shape, q: q),
    _explicit(lambda shape, q: 2 * jnp.arctan(q / 2)),
    _explicit(lambda shape, q: jnp.arctan(q)),
    _implicit(_series, np.pi),
    _explicit(_axial),
)
