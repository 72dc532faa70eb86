"""Sweeps over the static form |∇v|²_g + B v² = P.

Every pixel starts at its deadline and falls to the largest solution below it that its neighbours offer. In which order
pixels are asked does not change the answer, only the time: see `jaxsfs.updates`. Row by row is the order of Weber et
al. 2008.
"""

from functools import partial

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int, Int8

from jaxsfs.forms import Scalar
from jaxsfs.native import preferred
from jaxsfs.shading import AbstractShading, Balance
from jaxsfs.updates import HUGE, ROUNDS, BalanceOf, Frame, Updates, defect

Image = Float[Array, "height width"]
Mask = Bool[Array, "height width"]

_SETTLED = 1e-2  # mean relative change of v in a round after which the order of the pixels is known
_SHARE = 5e-3  # of what the first round of second order changed: no more than that need the last one change
_CLOSEST, _ROUGHEST = 1e-6, 1e-5  # limits of what that may come to; more would be called not settled


class Sweeps(eqx.Module):
    """Solution of the static form: w where a front came by or a deadline holds, and the work it took.

    `change`: mean relative change of v in the last round. `owner`: which sweep of a round set each pixel's value
    (−1: none did), counted as the order of updates counts them.
    """

    w: Image
    reached: Mask
    rounds: Int[Array, ""]
    change: Float[Array, ""]
    owner: Int8[Array, "height width"]


@partial(jax.jit, static_argnames=("order", "max_rounds", "tolerance", "updates"))
def sweep(
    shading: AbstractShading,
    inverse_metric: Float[Array, "height width 2 2"],
    inside: Mask,
    known: Image,
    *,
    order: int = 2,
    max_rounds: int = 40,
    tolerance: float | None = None,
    updates: Updates | None = None,
) -> Sweeps:
    """Solves for w on `inside`, by differences of first or second `order`; order 3: of second, then with their defect
    taken off (`jaxsfs.updates.defect`).

    `known`: w where it is given (Dirichlet), +inf elsewhere. Pixels outside `inside` are left out of every
    difference (state constraints). Stops when the mean relative change of v in a round is below `tolerance`: on a
    noisy image single pixels go on flickering for no gain. None: below 0.005 of what second order changed at first, a
    measure of the error that no further round takes away, but between 1e-6 and 1e-5. `updates`: the order in which
    pixels are updated, and by whom; None takes rows, by Numba where that is installed and JAX works on the CPU.
    """
    one_round = ROUNDS[updates or preferred()]
    given = inside & jnp.isfinite(known)
    p = power_for(shading, order)
    top = jnp.where(inside, shading.lift(jnp.where(given, known, shading.deadline()), p), HUGE)
    top = jnp.minimum(top, HUGE)
    v = jnp.where(jnp.isfinite(top), top, HUGE)
    g = inverse_metric
    frame = Frame(g[..., 0, 0], g[..., 0, 1], g[..., 1, 1], v, inside & ~given)
    frames = frame, frame.transposed()
    extent = (v.shape[0] + v.shape[1]) / jnp.sqrt(jnp.max(jnp.where(inside, frame.g11, 0)))

    # a quadratic equation does not change: it is computed and turned once
    unchanging = _turned(balance_for(shading, v, order)) if order >= 2 and shading.is_quadratic() else None

    def balance_of(v, axis):
        return (unchanging or _turned(balance_for(shading, v, order)))[axis]

    def change_of(new, v):
        return jnp.mean(jnp.abs(new - v) / jnp.maximum(jnp.abs(new), extent), where=inside)

    def proceed(state):
        _, _, rounds, change, settled_at, limit = state
        return (rounds < max_rounds) & ~((change < limit) & (rounds > settled_at) & (rounds >= min(order, 2)))

    def body(state):
        v, owner, rounds, _, settled_at, limit = state
        # one round of first order says where things come from; which pixel follows which may be mended while the
        # solution settles and once more: at a kink it would change for ever
        second = (order >= 2) & (rounds > 0)
        frozen = second & (rounds > settled_at + 1)
        new, owner = one_round(v, owner, balance_of, frames, second, frozen)
        change = change_of(new, v)
        settled_at = jnp.where(change < _SETTLED, jnp.minimum(settled_at, rounds), settled_at)
        if tolerance is None:
            limit = jnp.where(second & (rounds == 1), jnp.clip(_SHARE * change, _CLOSEST, _ROUGHEST), limit)
        return new, owner, rounds + 1, change, settled_at, limit

    settled = jnp.int32(-1 if order == 1 else max_rounds)
    unknown, limit = (jnp.asarray(x, v.dtype) for x in (jnp.inf, _CLOSEST if tolerance is None else tolerance))
    start = (v, jnp.full(v.shape, -1, jnp.int8), jnp.int32(0), unknown, settled, limit)
    v, owner, rounds, change, _, limit = jax.lax.while_loop(proceed, body, start)
    if order == 3:
        less_of = _without_defect(balance_of, v, frame)

        def correct(state):
            v, owner, rounds, _ = state
            new, owner = one_round(v, owner, less_of, frames, jnp.asarray(True), jnp.asarray(True))
            return new, owner, rounds + 1, change_of(new, v)

        def incorrect(state, begin=rounds):
            _, _, rounds, change = state
            return (rounds < max_rounds) & ((rounds == begin) | (change >= limit))

        v, owner, rounds, change = jax.lax.while_loop(incorrect, correct, (v, owner, rounds, change))
    reached = inside & (v < 0.5 * HUGE)
    return Sweeps(shading.lower(jnp.where(reached, v, 1), p), reached, rounds, change, owner)


def _without_defect(balance_of: BalanceOf, v: Image, frame: Frame) -> BalanceOf:
    """`balance_of` with the defect of `v` taken off its right-hand side."""
    excess = defect(v, frame, balance_of(v, 0))
    both = excess, excess.T

    def less_of(v, axis):
        balance = balance_of(v, axis)
        return Balance(balance.constant - both[axis], balance.linear, balance.square)

    return less_of


def _turned(balance: Balance) -> tuple[Balance, Balance]:
    """As it is, and with columns for rows."""
    return balance, balance.map_images(jnp.transpose)


def balance_for(shading: AbstractShading, v: Image, order: int) -> Balance:
    """The equation in v that the sweeps solve, at `v` where it depends on it."""
    if order >= 2 and shading.is_quadratic():
        return shading.quadratic_balance()
    return shading.balance(v, power_for(shading, order))


def power_for(shading: AbstractShading, order: int) -> Scalar:
    """The power p of `lift` that the sweeps solve in."""
    # Second order: the power that makes the equation quadratic. First order: p = −1, v = −1/r, in which surfaces
    # bend least and one-sided differences err least (a plane's 1/r is linear in the ray).
    return -1.0 if order == 1 and shading.is_quadratic() else shading.natural_power()
