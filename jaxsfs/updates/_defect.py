"""The defect of a solution: what differences of fourth order leave of the equation where it is smooth.

With the defect τ taken off the equation's right-hand side, the same sweeps of second order end with an error of third
order: theirs of τ's small change. Source: Stetter 1978, defect correction.
"""

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from jaxsfs.shading import Balance
from jaxsfs.updates._pixel import HUGE, Frame, Image

_REACH = 2  # pixels to either side that a difference of fourth order reads
_LIMIT = 0.5  # as far as slopes from both sides may differ in second order, in parts of how they do in first


def defect(v: Image, frame: Frame, balance: Balance) -> Image:
    """τ = |∇v|²_g + square·v² + linear·v − constant, 0 next to the border, at kinks and where v is given."""
    across, smooth_across = _slope(v, 1)
    down, smooth_down = _slope(v, 0)
    steepness = frame.g11 * across**2 + 2 * frame.g12 * across * down + frame.g22 * down**2
    return jnp.where(smooth_across & smooth_down & frame.free, steepness - balance.left(v), 0)


def _slope(v: Image, axis: int) -> tuple[Float[Array, "height width"], Bool[Array, "height width"]]:
    """∂v along an axis, (8 (v₁ − v₋₁) − (v₂ − v₋₂))/12, and where both sides agree about it."""
    margin = [(0, 0), (0, 0)]
    margin[axis] = (_REACH, _REACH)
    padded, extent = jnp.pad(v, margin, constant_values=HUGE), v.shape[axis]
    a, b, here, d, e = (jax.lax.slice_in_dim(padded, k, k + extent, axis=axis) for k in range(2 * _REACH + 1))
    known = jnp.maximum(jnp.maximum(a, b), jnp.maximum(d, e)) < 0.5 * HUGE
    # at a kink the two sides' slopes differ, however the differences are taken; on a smooth surface less and less
    second = (3 * here - 4 * b + a) + (3 * here - 4 * d + e)
    first = (here - b) + (here - d)
    smooth = jnp.abs(second) <= 2 * _LIMIT * jnp.abs(first)
    return (8 * (d - b) - (e - a)) / 12, known & smooth
