"""Sphere tracing: the first surface point on a ray, for scenes that only know how far away they are at least."""

from collections.abc import Callable

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from data_synth.scene import Vector

# A ray that dips into the surface for less than this length may pass: a sphere of radius R is missed by at most
# FINEST²/(8 R), some 1e-8 scene units, at its limb.
FINEST = 3e-4
_MOST_STEPS = 4000
_REFINEMENTS = 24


def trace(
    clearance: Callable[[Vector], Float[Array, ""]], origin: Vector, direction: Vector, reach: float
) -> Float[Array, ""]:
    """Length along `direction` to the first point with clearance ≤ 0; inf if there is none within `reach`.

    `clearance` must have |∇clearance| ≤ 1, so that a step of its value never crosses the surface; `origin` lies in
    free space. The result is refined to the dtype's precision, and its derivative is that of the implicit equation.
    Source: Hart 1996.
    """

    def along(t):
        return clearance(origin + t * direction)

    def marching(state):
        t, _, value, steps = state
        return (value > 0) & (t < reach) & (steps < _MOST_STEPS)

    def march(state):
        t, _, value, steps = state
        ahead = t + jnp.maximum(value, FINEST)
        return ahead, t, along(ahead), steps + 1

    def refine(_, state):
        t, low, high = state
        value, slope = jax.jvp(along, (t,), (jnp.ones_like(t),))
        low, high = jnp.where(value > 0, t, low), jnp.where(value > 0, high, t)
        newton = t - value / jnp.where(slope < 0, slope, 1)
        inside = (slope < 0) & (newton >= low) & (newton <= high)
        return jnp.where(inside, newton, 0.5 * (low + high)), low, high

    start = jnp.zeros_like(origin[0])
    end, before, value, _ = jax.lax.while_loop(marching, march, jax.lax.stop_gradient((start, start, along(start), 0)))
    hit = value <= 0
    t, _, _ = jax.lax.fori_loop(0, _REFINEMENTS, refine, jax.lax.stop_gradient((end, before, end)))
    # one Newton step outside the loop carries the derivative (implicit function theorem)
    t = jax.lax.stop_gradient(t)
    value, slope = jax.jvp(along, (t,), (jnp.ones_like(t),))
    steep = slope < -1e-6
    t = t - jnp.where(steep, value / jax.lax.stop_gradient(jnp.where(steep, slope, 1)), 0)
    return jnp.where(hit, t, jnp.inf)
