"""The sweeps of `_rows` as functions that Numba compiled for the CPU (the extra `fast`).

In first order blocks of pixels round which nothing changed are left out; `Changed` says where something did, by rows
and by columns.
"""

import jax
import jax.numpy as jnp
from jaxtyping import Array, UInt8

from jaxsfs.arrival._rows import Frames, Image, Owners
from jaxsfs.native import BLOCK, function

Changed = tuple[UInt8[Array, "across along"], UInt8[Array, "along across"]]


def everywhere(v: Image) -> Changed:
    """Before anything is known."""
    rows, columns = (-(-extent // BLOCK) for extent in v.shape)
    return jnp.ones((rows, columns), jnp.uint8), jnp.ones((columns, rows), jnp.uint8)


def one_round(
    v: Image, changed: Changed, owners: Owners | None, frames: Frames, frozen
) -> tuple[Image, Changed, Array]:
    """As `_rows.one_round`. Raises ModuleNotFoundError where Numba is not installed."""
    flags = jnp.stack([jnp.asarray(x, jnp.int8) for x in (owners is not None, frames[0].factor is not None, frozen)])
    nobody = jnp.zeros((), jnp.uint8)
    halves = []
    for frame, own, blocks in zip(frames, owners or (nobody, nobody), changed, strict=True):
        halves += [*_numbers(frame, v.dtype), own, blocks]
    number = jax.ShapeDtypeStruct((), v.dtype)
    v, by_rows, by_columns, change = function("rounds", v.dtype, v, *changed, number)(v, flags, *halves)
    return v, (by_rows, by_columns), change


def owners_of(v: Image, frames: Frames, never) -> Owners:
    """As `_rows.owners_of`."""
    flags = jnp.asarray([frames[0].factor is not None], jnp.int8)
    images = [jax.ShapeDtypeStruct(shape, jnp.uint8) for shape in (v.shape, v.shape[::-1])]
    fields = [x for frame in frames for x in _numbers(frame, v.dtype)]
    return tuple(function("owners", v.dtype, *images)(v, flags, *fields))


def _numbers(frame, dtype):
    """Slowness, and the factor across and along the rows, 0 where there is none."""
    nothing = jnp.zeros((), dtype)
    return frame.slowness, *((nothing, nothing) if frame.factor is None else (frame.factor.across, frame.factor.along))
