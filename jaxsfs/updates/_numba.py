"""The order of `_rows`, each sweep a function that Numba compiled for the CPU (the extra `fast`)."""

from typing import Any

import jax.numpy as jnp

from jaxsfs.native import function
from jaxsfs.shading import Balance
from jaxsfs.updates._pixel import BalanceOf, Frame, Image, Owners


def compiled_rows(
    v: Image, owner: Owners, balance_of: BalanceOf, frames: tuple[Frame, Frame], second, frozen
) -> tuple[Image, Owners]:
    """One round: v and owners after four sweeps. Raises ModuleNotFoundError where Numba is not installed."""
    for columns, frame in enumerate(frames):
        v, owner = _both_sweeps(v, owner, frame, balance_of(v, columns), (columns, second, frozen))
    return v, owner


def _both_sweeps(v: Image, owner: Owners, frame: Frame, balance: Balance, flags) -> Any:
    """There and back over the rows or the columns; `frame` and `balance` have columns for rows for the latter, v and
    owners never. `flags`: whether over columns, second order, frozen owners."""
    numbers = (jnp.asarray(x, v.dtype) for x in (balance.constant, balance.linear, balance.square))
    flags = jnp.stack([jnp.asarray(x, jnp.int8) for x in flags])
    return function("sweeps", v.dtype, v, owner)(
        v, owner, frame.g11, frame.g12, frame.g22, frame.top, frame.free, *numbers, flags
    )
