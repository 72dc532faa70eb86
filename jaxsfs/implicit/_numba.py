"""Sweeps of the causal linear system as functions that Numba compiled for the CPU (the extra `fast`)."""

import jax.numpy as jnp

from jaxsfs.native import function


def both_pulls(x, b, weights, owner, axis: int):
    """x after x = b + C x down and up the rows (`axis` 0) or columns; `weights` and `owner` have columns for rows for
    the latter, x and b never."""
    return function("pulls", x.dtype, x)(x, b, *_of_frame(weights, owner), jnp.asarray([axis], jnp.int8))[0]


def both_pushes(total, waiting, weights, owner, axis: int):
    """What was handed on, and what still waits, after Cᵀ up and down the rows or columns."""
    return function("pushes", total.dtype, total, waiting)(
        total, waiting, *_of_frame(weights, owner), jnp.asarray([axis], jnp.int8)
    )


def _of_frame(weights, owner):
    """The six images of weights one below the other, and the owners."""
    return weights.reshape(-1, weights.shape[-1]), owner
