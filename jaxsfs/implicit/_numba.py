"""Sweeps of the causal linear system as functions that Numba compiled for the CPU (the extra `fast`)."""

import jax
import jax.numpy as jnp

from jaxsfs.native import target_for


def both_pulls(x, b, weights, owner, axis: int):
    """x after x = b + C x down and up the rows (`axis` 0) or columns; `weights` and `owner` have columns for rows for
    the latter, x and b never."""
    call = jax.ffi.ffi_call(target_for("pulls", x.dtype), _like(x), vmap_method="sequential")
    return call(x, b, *_of_frame(weights, owner), jnp.asarray([axis], jnp.int8))


def both_pushes(total, waiting, weights, owner, axis: int):
    """What was handed on, and what still waits, after Cᵀ up and down the rows or columns."""
    call = jax.ffi.ffi_call(target_for("pushes", total.dtype), (_like(total),) * 2, vmap_method="sequential")
    return call(total, waiting, *_of_frame(weights, owner), jnp.asarray([axis], jnp.int8))


def _like(x):
    return jax.ShapeDtypeStruct(x.shape, x.dtype)


def _of_frame(weights, owner):
    """The six images of weights one below the other, and the owners."""
    return weights.reshape(-1, weights.shape[-1]), owner
