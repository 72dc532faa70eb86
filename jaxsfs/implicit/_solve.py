"""The static solution with derivatives in both modes."""

from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from jaxsfs._once import once
from jaxsfs.implicit._causal import Causal
from jaxsfs.implicit._stencil import Differences, Stencil, differences, find_stencil, misfit, misfit_slopes
from jaxsfs.shading import AbstractShading
from jaxsfs.sweeping import Sweeps, power_for, sweep
from jaxsfs.updates import HUGE

Image = Float[Array, "height width"]
Mask = Bool[Array, "height width"]


class _Settings(NamedTuple):
    order: int
    max_rounds: int
    tolerance: float | None


@partial(jax.jit, static_argnames=("order", "max_rounds", "tolerance"))
def solve(
    shading: AbstractShading,
    inverse_metric: Float[Array, "height width 2 2"],
    inside: Mask,
    known: Image,
    *,
    order: int = 2,
    max_rounds: int = 40,
    tolerance: float | None = None,
) -> Sweeps:
    """`sweep`, with derivatives of w by `shading`, `inverse_metric` and `known` in forward and reverse mode.

    They are those of the discrete equations that hold at the solution (implicit function theorem), with each pixel's
    stencil as it is; for order 3 those of the equations of second order, at its solution. Pixels outside `inside` and
    those no front reached have derivative 0.
    """
    return Sweeps(*_solution(shading, inverse_metric, inside, known, _Settings(order, max_rounds, tolerance)))


@partial(jax.custom_jvp, nondiff_argnums=(4,))
def _solution(shading: AbstractShading, metric, inside: Mask, known: Image, settings: _Settings):
    """w, reached, rounds, change and owners of `sweep`."""
    found = sweep(shading, metric, inside, known, **settings._asdict())
    return found.w, found.reached, found.rounds, found.change, found.owner


@_solution.defjvp
def _solution_jvp(settings: _Settings, primals, tangents):
    shading, metric, inside, known = primals
    shading_dot, metric_dot, _, known_dot = tangents
    found = w, reached, rounds, change, owner = _solution(shading, metric, inside, known, settings)
    order = min(settings.order, 2)
    given = inside & jnp.isfinite(known)
    p = power_for(shading, order)
    # values that stand in where there is no equation: finite in every derivative
    v = shading.lift(jnp.where(reached, w, 0), p)
    metric = jnp.where(reached[..., None, None], metric, jnp.eye(2, dtype=metric.dtype)[None, None])
    metric_dot = jnp.where(reached[..., None, None], metric_dot, 0)
    top = jnp.where(given, known, shading.deadline())
    due = w >= top - 8 * jnp.finfo(w.dtype).eps * jnp.maximum(1, jnp.abs(w))
    data = jnp.where(reached, v, HUGE)
    computed = partial(once, never=rounds < 0)
    free = reached & ~given & ~due
    held, (stencil, upwind) = computed((v, find_stencil(data, owner, shading, metric, free, order, rounds < 0)))
    d = computed(differences(held, upwind, stencil, order))
    causal, slope = computed(_linearised(held, d, stencil, shading, metric, order))

    def by_parameters(shading, metric, known):
        p = jnp.asarray(power_for(shading, order), w.dtype)
        unsolved = misfit(held, d, stencil, shading, metric, order) / -slope
        bound = jnp.where(given, known, shading.deadline())
        fixed = shading.lift(jnp.where(reached & ~stencil.active, bound, 0), p)
        return jnp.where(stencil.active, unsolved, jnp.where(reached, fixed, 0)), p

    known = jnp.where(given, known, 0)
    known_dot = jnp.where(given, known_dot, 0)
    (_, p), (b, p_dot) = jax.jvp(by_parameters, (shading, metric, known), (shading_dot, metric_dot, known_dot))
    v_dot = jax.lax.custom_linear_solve(
        causal.apply,
        b,
        solve=lambda _, side: causal.solve(side),
        transpose_solve=lambda _, side: causal.solve_transposed(side),
    )
    _, w_dot = jax.jvp(shading.lower, (v, p), (v_dot, p_dot))
    no_reached, no_rounds, no_owner = (np.zeros(x.shape, jax.dtypes.float0) for x in (reached, rounds, owner))
    return found, (jnp.where(reached, w_dot, 0), no_reached, no_rounds, jnp.zeros_like(change), no_owner)


def _linearised(
    v: Image, d: Differences, stencil: Stencil, shading: AbstractShading, metric, order: int
) -> tuple[Causal, Image]:
    """C and ∂F/∂v."""
    slope, by_upwind = misfit_slopes(v, d, stencil, shading, metric, order)
    slope = jnp.where(stencil.active, slope, 1)
    return Causal(stencil, jax.tree.map(lambda x: jnp.where(stencil.active, -x / slope, 0), by_upwind)), slope
