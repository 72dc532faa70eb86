"""Roots of a monotone function, with derivatives that do not pass through the iteration."""

from collections.abc import Callable

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float


def monotone_root(
    function: Callable[[Float[Array, ""]], Float[Array, ""]],
    lower: Float[Array, ""],
    upper: Float[Array, ""],
    iterations: int = 24,
) -> Float[Array, ""]:
    """The x in [lower, upper] with function(x) = 0, `function` increasing there.

    Newton's method that falls back to bisection when a step leaves the bracket. The last step is taken outside
    `stop_gradient`: by the implicit function theorem one exact Newton step carries the exact first derivative
    with respect to everything that `function` closes over.
    """

    def step(_, state):
        x, low, high = state
        value, slope = jax.jvp(function, (x,), (jnp.ones_like(x),))
        low = jnp.where(value < 0, x, low)
        high = jnp.where(value < 0, high, x)
        newton = x - value / jnp.where(slope > 0, slope, 1)
        inside = (slope > 0) & (newton >= low) & (newton <= high)
        return jnp.where(inside, newton, 0.5 * (low + high)), low, high

    start = (0.5 * (lower + upper), lower, upper)
    x, _, _ = jax.lax.fori_loop(0, iterations, step, jax.tree.map(jax.lax.stop_gradient, start))
    x = jax.lax.stop_gradient(x)
    value, slope = jax.jvp(function, (x,), (jnp.ones_like(x),))
    polished = x - value / jnp.where(slope > 0, jax.lax.stop_gradient(slope), 1)
    return jnp.clip(polished, jax.lax.stop_gradient(lower), jax.lax.stop_gradient(upper))
