"""The causal linear system x = b + C x, whose every pixel reads the pixels of its stencil, and its transpose.

C is triangular in the order of arrival, so Gauss–Seidel sweeps in the order of the solver's end after finitely many
rounds with the exact solution: as many as the directions along a path through the stencils change.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int8

from jaxsfs.implicit import _numba, _rows
from jaxsfs.implicit._stencil import Stencil, Upwind, upwind_values
from jaxsfs.native import preferred

Image = Float[Array, "height width"]

_BY = {"rows": _rows, "numba": _numba}
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
        both_pulls = _BY[preferred()].both_pulls

        def one_round(state):
            x, _, rounds = state
            new = x
            for axis, frame in enumerate(frames):
                new = both_pulls(new, b, frame.weights, frame.owner, axis)
            return new, _share(new - x, new), rounds + 1

        return _until_still(one_round, b)

    def solve_transposed(self, b: Image) -> Image:
        """x with x − Cᵀ x = b. What a pixel gets from those that read it waits until its own direction's sweep comes
        by, and is handed on upstream there, once: so this too ends with the exact solution."""
        frames = [_frame(self, axis) for axis in (0, 1)]
        both_pushes = _BY[preferred()].both_pushes

        def one_round(state):
            both, _, rounds = state
            for axis in (1, 0):
                both = both_pushes(*both, frames[axis].weights, frames[axis].owner, axis)
            return list(both), _share(jnp.where(self.stencil.active, both[1], 0), both[0]), rounds + 1

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
