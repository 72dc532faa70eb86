"""The causal linear system x = b + C x, whose every pixel reads the pixels of its stencil, and its transpose.

C is triangular in the order of arrival, so Gauss–Seidel sweeps in the order of the solver's end after finitely many
rounds with the exact solution: as many as the directions along a path through the stencils change.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int8

from jaxsfs.implicit._stencil import Stencil, Upwind, upwind_values
from jaxsfs.updates import PAD

Image = Float[Array, "height width"]

_MOST_ROUNDS = 200  # a bound for the loop; smooth images take 3 to 6, noisy ones up to 20


class Causal(eqx.Module):
    """C: `weights` of the four pixels that each pixel's `stencil` reads."""

    stencil: Stencil
    weights: Upwind

    def apply(self, x: Image) -> Image:
        """x − C x."""
        read = upwind_values(x, self.stencil, 0.0)
        return x - sum(jax.tree.leaves(jax.tree.map(jnp.multiply, self.weights, read)))

    def solve(self, b: Image) -> Image:
        """x with x − C x = b."""
        frames = [_frame(self, axis) for axis in (0, 1)]

        def one_round(state):
            x, _, rounds = state
            new = _both_ways(lambda forward, x: _pull(x, b, frames[0], forward), x)
            new = _both_ways(lambda forward, x: _pull(x, b.T, frames[1], forward), new.T).T
            return new, _share(new - x, new), rounds + 1

        return _until_still(one_round, b)

    def solve_transposed(self, b: Image) -> Image:
        """x with x − Cᵀ x = b. What a pixel gets from those that read it waits until its own direction's sweep comes
        by, and is handed on upstream there, once: so this too ends with the exact solution."""
        frames = [_frame(self, axis) for axis in (0, 1)]

        def one_round(state):
            both, _, rounds = state
            turned = _both_ways(lambda forward, both: _push(both[0], both[1], frames[1], ~forward), [x.T for x in both])
            both = _both_ways(lambda forward, both: _push(both[0], both[1], frames[0], ~forward), [x.T for x in turned])
            return both, _share(jnp.where(self.stencil.active, both[1], 0), both[0]), rounds + 1

        total, waiting = _until_still(one_round, [jnp.zeros_like(b), b])
        return total + waiting


class _Frame(eqx.Module):
    """C as a pair of opposite sweeps sees it: weights along the straight and both diagonal edges, by reach.

    `owner`: 1 for the pixels of the sweep down the rows, 0 for those of the sweep up, else neither.
    """

    owner: Int8[Array, "height width"]
    weights: Float[Array, "six height width"]  # straight, to the left, to the right; then the same two pixels away


def _frame(causal: Causal, axis: int) -> _Frame:
    stencil, w = causal.stencil, causal.weights
    left = stencil.side < 0
    images = []
    for straight, diagonal in ((w.straight_near, w.diagonal_near), (w.straight_far, w.diagonal_far)):
        images += [straight, jnp.where(left, diagonal, 0), jnp.where(left, 0, diagonal)]
    owner = stencil.direction - jnp.int8(2 * axis)
    return _Frame(owner, jnp.stack(images)) if axis == 0 else _Frame(owner.T, jnp.stack([x.T for x in images]))


def _both_ways(sweep, state):
    """`sweep` down and up the rows, as a loop: half the program to compile."""
    return jax.lax.fori_loop(0, 2, lambda n, state: sweep(n == 0, state), state)


_READS = ((1, 0), (1, -1), (1, 1), (2, 0), (2, -2), (2, 2))  # (rows back, columns) of `_Frame.weights`


def _pull(x: Image, b: Image, frame: _Frame, forward: Bool[Array, ""]) -> Image:
    """One sweep of x = b + C x, down (`forward`) or up the rows."""
    height, width = x.shape

    def row(n, padded):
        i = jnp.where(forward, n, height - 1 - n)

        def read(back, shift):
            start = i + PAD - jnp.where(forward, back, -back)
            return jax.lax.dynamic_slice(padded, (start, PAD + shift), (1, width))

        weights = jax.lax.dynamic_slice(frame.weights, (0, i, 0), (6, 1, width))
        mine = jax.lax.dynamic_slice(frame.owner, (i, 0), (1, width)) == forward.astype(jnp.int8)
        value = jax.lax.dynamic_slice(b, (i, 0), (1, width))
        for k, (back, shift) in enumerate(_READS):
            value = value + weights[k] * read(back, shift)
        new = jnp.where(mine, value, read(0, 0))
        return jax.lax.dynamic_update_slice(padded, new, (i + PAD, PAD))

    return jax.lax.fori_loop(0, height, row, jnp.pad(x, PAD))[PAD:-PAD, PAD:-PAD]


def _push(total: Image, waiting: Image, frame: _Frame, forward: Bool[Array, ""]) -> list[Image]:
    """One sweep of Cᵀ against the order of `_pull`: what was handed on so far, and what still waits."""
    height, width = waiting.shape
    mine = frame.owner == forward.astype(jnp.int8)
    weights = jnp.pad(jnp.where(mine, frame.weights, 0), ((0, 0), (PAD, PAD), (PAD, PAD)))

    def row(n, padded):
        i = jnp.where(forward, height - 1 - n, n)
        value = jax.lax.dynamic_slice(padded, (i + PAD, PAD), (1, width))
        for k, (back, shift) in enumerate(_READS):
            # the pixel that reads this one lies opposite; its weight is 0 unless it is of this sweep
            at = (i + PAD + jnp.where(forward, back, -back), PAD - shift)
            weight = jax.lax.dynamic_slice(weights, (k, *at), (1, 1, width))[0]
            value = value + weight * jax.lax.dynamic_slice(padded, at, (1, width))
        return jax.lax.dynamic_update_slice(padded, value, (i + PAD, PAD))

    value = jax.lax.fori_loop(0, height, row, jnp.pad(waiting, PAD))[PAD:-PAD, PAD:-PAD]
    return [total + jnp.where(mine, value, 0), jnp.where(mine, 0, value)]


def _share(change: Image, whole: Image) -> Float[Array, ""]:
    """Largest change relative to the largest value."""
    tiny = jnp.finfo(whole.dtype).tiny
    return jnp.max(jnp.abs(change)) / jnp.maximum(jnp.max(jnp.abs(whole)), tiny)


def _until_still(one_round, start):
    """Rounds until nothing changes any more, but for rounding."""
    dtype = jax.tree.leaves(start)[0].dtype

    def proceed(state):
        _, change, rounds = state
        return (change > 10 * jnp.finfo(dtype).eps) & (rounds < _MOST_ROUNDS)

    return jax.lax.while_loop(proceed, one_round, (start, jnp.asarray(jnp.inf, dtype), jnp.int32(0)))[0]
