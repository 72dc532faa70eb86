"""Sweeps of the causal linear system in JAX: a row is one vector operation."""

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from jaxsfs.updates import PAD

Image = Float[Array, "height width"]


def both_pulls(x, b, weights, owner, axis: int):
    """x after x = b + C x down and up the rows (`axis` 0) or columns; `weights` and `owner` have columns for rows for
    the latter, x and b never."""
    xt, bt = (x.T, b.T) if axis else (x, b)
    new = _both_ways(lambda forward, x: _pull(x, bt, weights, owner, forward), xt)
    return new.T if axis else new


def both_pushes(total, waiting, weights, owner, axis: int):
    """What was handed on, and what still waits, after Cᵀ up and down the rows or columns."""
    turned = [total.T, waiting.T] if axis else [total, waiting]
    both = _both_ways(lambda forward, both: _push(both[0], both[1], weights, owner, ~forward), turned)
    return [x.T for x in both] if axis else both


def _both_ways(sweep, state):
    """`sweep` down and up the rows, as a loop: half the program to compile."""
    return jax.lax.fori_loop(0, 2, lambda n, state: sweep(n == 0, state), state)


_READS = ((1, 0), (1, -1), (1, 1), (2, 0), (2, -2), (2, 2))  # (rows back, columns) of the six weights


def _pull(x: Image, b: Image, weights, owner, forward: Bool[Array, ""]) -> Image:
    """One sweep of x = b + C x, down (`forward`) or up the rows."""
    height, width = x.shape

    def row(n, padded):
        i = jnp.where(forward, n, height - 1 - n)

        def read(back, shift):
            start = i + PAD - jnp.where(forward, back, -back)
            return jax.lax.dynamic_slice(padded, (start, PAD + shift), (1, width))

        local = jax.lax.dynamic_slice(weights, (0, i, 0), (6, 1, width))
        mine = jax.lax.dynamic_slice(owner, (i, 0), (1, width)) == forward.astype(jnp.int8)
        value = jax.lax.dynamic_slice(b, (i, 0), (1, width))
        for k, (back, shift) in enumerate(_READS):
            value = value + local[k] * read(back, shift)
        new = jnp.where(mine, value, read(0, 0))
        return jax.lax.dynamic_update_slice(padded, new, (i + PAD, PAD))

    return jax.lax.fori_loop(0, height, row, jnp.pad(x, PAD))[PAD:-PAD, PAD:-PAD]


def _push(total: Image, waiting: Image, weights, owner, forward: Bool[Array, ""]) -> list[Image]:
    """One sweep of Cᵀ against the order of `_pull`: what was handed on so far, and what still waits."""
    height, width = waiting.shape
    mine = owner == forward.astype(jnp.int8)
    weights = jnp.pad(jnp.where(mine, weights, 0), ((0, 0), (PAD, PAD), (PAD, PAD)))

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
