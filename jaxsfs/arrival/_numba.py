"""The sweeps of `_rows` as a function that Numba compiled for the CPU (the extra `fast`)."""

import jax.numpy as jnp

from jaxsfs.native import function


def both_sweeps(v, owner, slowness, factor, axis: int):
    """As `_rows.both_sweeps`. Raises ModuleNotFoundError where Numba is not installed."""
    flags = jnp.asarray([axis, owner is not None, factor is not None], jnp.int8)
    owner = jnp.zeros(slowness.shape, jnp.uint8) if owner is None else owner
    return function("arrivals", v)(v, slowness, owner, *_numbers(factor, v.dtype), flags)[0]


def both_offers(v, slowness, factor, axis: int):
    """As `_rows.both_offers`."""
    flags = jnp.asarray([axis, factor is not None], jnp.int8)
    return function("offers", v, v)(v, slowness, *_numbers(factor, v.dtype), flags)


def _numbers(factor, dtype):
    """The factor across and along the rows, 0 where there is none."""
    nothing = jnp.zeros((), dtype)
    return (nothing, nothing) if factor is None else (factor.across, factor.along)
