"""The sweeps of `_rows` as a function that Numba compiled for the CPU (the extra `fast`)."""

import jax
import jax.numpy as jnp

from jaxsfs.native import target_for


def both_sweeps(v, owner, slowness, factor, axis: int):
    """As `_rows.both_sweeps`. Raises ModuleNotFoundError where Numba is not installed."""
    flags = jnp.asarray([axis, owner is not None, factor is not None], jnp.int8)
    owner = jnp.zeros(slowness.shape, jnp.uint8) if owner is None else owner
    call = jax.ffi.ffi_call(target_for("arrivals", v.dtype), _like(v), vmap_method="sequential")
    return call(v, slowness, owner, *_numbers(factor, v.dtype), flags)


def both_offers(v, slowness, factor, axis: int):
    """As `_rows.both_offers`."""
    flags = jnp.asarray([axis, factor is not None], jnp.int8)
    call = jax.ffi.ffi_call(target_for("offers", v.dtype), (_like(v), _like(v)), vmap_method="sequential")
    return call(v, slowness, *_numbers(factor, v.dtype), flags)


def _like(v):
    return jax.ShapeDtypeStruct(v.shape, v.dtype)


def _numbers(factor, dtype):
    """The factor across and along the rows, 0 where there is none."""
    nothing = jnp.zeros((), dtype)
    return (nothing, nothing) if factor is None else (factor.across, factor.along)
