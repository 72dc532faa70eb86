"""The angle α of a ray from the axis as a function of q = image radius/f, with its derivatives, for every lens model.

One small program serves them all and chooses by number:

    q = s(1 + k s²),  2 sin(α/2),  α + k₁α³ + k₂α⁵ + …,  2 tan(α/2)  or  tan α,    s = sin α,

solved for α, or α = atan2(q, 1 + a₂q² + a₃q³ + a₄q⁴). Written for numpy, on the host, and for JAX, inside the compiled
fits. (The cameras' own `ray` would have to be differentiated twice and compile ten times longer; a test holds the two
together.)
"""

from functools import partial
from types import ModuleType
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from jaxsfs._arrays import AnyArray, module_of
from jaxsfs.calibration._arrays import constant, repeated

SHAPES = 4
SINE, HALF_SINE, SERIES, HALF_TANGENT, TANGENT, AXIAL = range(6)
# largest α: for finite fields a little short of the end, where α'(q) → ∞ would make every distance in px vanish
_ENDS = (np.arcsin(0.998), 2 * np.arcsin(0.998), np.pi, 0.99 * np.pi, 0.495 * np.pi, np.pi)
_LEAST_SLOPE = 0.02  # dq/dα next to the end of a profile
_LAST_SLOPE = 0.06  # and beyond it
_BEYOND = 1e-6


class _Model(NamedTuple):
    """Array module, number and largest α of a model."""

    xp: ModuleType
    build: Any
    end: Any


def angle(
    build: int | Int[Array, ""], shape: Float[AnyArray, "4"], q: Float[AnyArray, " count"]
) -> tuple[Float[AnyArray, " count"], Float[AnyArray, " count"], Float[AnyArray, "4 count"]]:
    """α(q), ∂α/∂q and ∂α/∂shape of the model `build`."""
    xp = module_of(q)
    model = _Model(xp, build, xp.asarray(_ENDS)[build])
    if xp is np:
        return _axial(xp, shape, q) if build == AXIAL else _by_root(model, shape, q)
    implicit, explicit = _by_root(model, shape, q), _axial(xp, shape, q)
    alpha, slope, by_shape = (xp.where(build == AXIAL, b, a) for a, b in zip(implicit, explicit, strict=True))
    return alpha, slope, by_shape


def radius(
    build: int | Int[Array, ""], shape: Float[AnyArray, "4"], alpha: Float[AnyArray, " count"]
) -> tuple[Float[AnyArray, " count"], Float[AnyArray, " count"], Float[AnyArray, "4 count"]]:
    """The other way: q(α), ∂q/∂α and ∂q/∂shape, α in [0, π]."""
    xp = module_of(alpha)
    model = _Model(xp, build, xp.asarray(_ENDS)[build])
    if xp is np and build == AXIAL:
        return _axial_radius(xp, shape, alpha)
    inside = xp.minimum(alpha, model.end)
    value, slope = _profile(model, shape, inside)
    along = value + _LAST_SLOPE * (alpha - inside), xp.where(alpha > inside, _LAST_SLOPE, slope)
    profile = *along, _profile_by_shape(model, inside)
    if xp is np:
        return profile
    return tuple(xp.where(build == AXIAL, b, a) for a, b in zip(profile, _axial_radius(xp, shape, alpha), strict=True))


def _by_root(model: _Model, shape, q):
    """The root and ∂α/∂q = 1/profile', ∂α/∂s = −∂profile/∂s/profile'."""
    xp = model.xp
    alpha = _root(model, constant(shape), constant(q))
    value, slope = _profile(model, shape, alpha)
    # beyond its end the profile goes on straight and steeply: what lies there has no ray, and leads a fit back
    beyond = q > value + _BEYOND
    alpha = alpha + (q - value) / xp.where(beyond, _LAST_SLOPE, xp.maximum(slope, _LEAST_SLOPE))
    slope = xp.maximum(_profile(model, shape, xp.minimum(alpha, model.end))[1], _LEAST_SLOPE)
    slope = xp.where(beyond, _LAST_SLOPE, slope)
    return alpha, 1 / slope, -_profile_by_shape(model, alpha) / slope[None]


def _root(model: _Model, shape, q):
    """Bisection, then Newton's method; `end` where the profile does not reach q."""
    xp = model.xp

    def halve(bracket):
        low, high = bracket
        middle = 0.5 * (low + high)
        value, slope = _profile(model, shape, middle)
        below = (value < q) & (slope > 0)
        return xp.where(below, middle, low), xp.where(below, high, middle)

    def newton(alpha):
        value, slope = _profile(model, shape, alpha)
        return xp.clip(alpha + xp.clip((q - value) / xp.maximum(slope, _LEAST_SLOPE), -0.05, 0.05), 0.0, model.end)

    low, high = repeated(xp, 8, halve, (xp.zeros_like(q), xp.zeros_like(q) + model.end))
    return repeated(xp, 6, newton, 0.5 * (low + high))


def _profile(model: _Model, shape, alpha):
    """q(α) and its slope."""
    if model.xp is np:
        return _PROFILES[int(model.build)](np, shape, alpha)
    return _chosen(model.build, shape, alpha)


@jax.jit  # asked for in several places: traced once, it is written out once
def _chosen(build: Int[Array, ""], shape: Float[Array, "4"], alpha: Float[Array, " count"]):
    """The profile of that number alone, which is not known before it runs."""
    return jax.lax.switch(build, [partial(profile, jnp) for profile in _PROFILES], shape, alpha)


def _sine(xp: ModuleType, shape, alpha):
    sine, cosine = _sine_and_cosine(xp, alpha)
    return sine * (1 + shape[0] * sine**2), cosine * (1 + 3 * shape[0] * sine**2)


def _half_sine(xp: ModuleType, shape, alpha):
    return 2 * xp.sin(alpha / 2), xp.maximum(xp.cos(alpha / 2), 1e-3)


def _series(xp: ModuleType, shape, alpha):
    square = alpha**2
    terms = shape[0] + square * (shape[1] + square * (shape[2] + square * shape[3]))
    slopes = 3 * shape[0] + square * (5 * shape[1] + square * (7 * shape[2] + square * 9 * shape[3]))
    return alpha * (1 + square * terms), 1 + square * slopes


def _half_tangent(xp: ModuleType, shape, alpha):
    beside = xp.maximum(xp.cos(alpha / 2), 1e-3)
    return 2 * xp.sin(alpha / 2) / beside, 1 / beside**2


def _tangent(xp: ModuleType, shape, alpha):
    sine, cosine = _sine_and_cosine(xp, alpha)
    across = xp.where(xp.abs(cosine) < 1e-3, 1e-3, cosine)
    return sine / across, 1 / across**2


def _sine_and_cosine(xp: ModuleType, alpha):
    """From those of α/2: compiled with the other profiles, they cost nothing."""
    half = xp.sin(alpha / 2)
    return 2 * half * xp.cos(alpha / 2), 1 - 2 * half**2


_PROFILES = (_sine, _half_sine, _series, _half_tangent, _tangent)  # in the order of their numbers


def _profile_by_shape(model: _Model, alpha):
    xp, square, cube = model.xp, alpha**2, alpha**3
    series = xp.where(model.build == SERIES, cube, 0.0)
    first = xp.where(model.build == SINE, xp.sin(alpha) ** 3, series)
    more = series * square
    return xp.stack([first, more, more * square, more * square**2])


def _axial_radius(xp: ModuleType, shape, alpha):
    """Newton's method from the sine; the last step carries the derivatives."""
    held, goal = constant(shape), constant(alpha)

    def newton(q):
        angle_of, slope, _ = _axial(xp, held, q)
        return xp.maximum(q + xp.clip((goal - angle_of) / xp.maximum(slope, _LEAST_SLOPE), -0.3, 0.3), 0.0)

    q = repeated(xp, 12, newton, xp.sin(xp.minimum(goal, np.pi / 2)))
    _, slope, by_shape = _axial(xp, shape, q)
    slope = xp.maximum(slope, _LEAST_SLOPE)
    return q, 1 / slope, -by_shape / slope[None]


def _axial(xp: ModuleType, shape, q):
    along = 1 + q**2 * (shape[0] + q * (shape[1] + q * shape[2]))
    fall = q * (2 * shape[0] + q * (3 * shape[1] + q * 4 * shape[2]))
    norm = q**2 + along**2
    by_shape = -(q / norm)[None] * xp.stack([q**2, q**3, q**4, xp.zeros_like(q)])
    return xp.arctan2(q, along), (along - q * fall) / norm, by_shape
