"""Row by row: down, up, right, left. Each pixel reads the row before it, so a row is one vector operation."""

import jax
import jax.numpy as jnp

from jaxsfs.shading import Balance
from jaxsfs.updates._pixel import HUGE, PAD, BalanceOf, Frame, Image, Owners, offered, taken


def rows(
    v: Image, owner: Owners, balance_of: BalanceOf, frames: tuple[Frame, Frame], second, frozen
) -> tuple[Image, Owners]:
    """One round: v and owners after four sweeps."""
    for axis in (0, 1):
        vt, ot = (x if axis == 0 else x.T for x in (v, owner))
        for forward in (True, False):
            balance = balance_of(vt if axis == 0 else vt.T, axis)
            direction = jnp.int8(2 * axis + forward)
            vt, ot = _directional_sweep(vt, ot, balance, frames[axis], jnp.asarray(forward), direction, second, frozen)
        v, owner = (vt, ot) if axis == 0 else (vt.T, ot.T)
    return v, owner


def _directional_sweep(v, owner, balance: Balance, frame: Frame, forward, direction, second, frozen):
    """One sweep down (`forward`) or up the rows; `direction` owns the pixels whose value it set."""
    height, width = v.shape
    padded = jnp.pad(v, PAD, constant_values=HUGE)

    def row(n, padded):
        i = jnp.where(forward, n, height - 1 - n)

        def neighbour(back, shift):
            return jax.lax.dynamic_slice(padded, (i + PAD - jnp.where(forward, back, -back), PAD + shift), (1, width))[
                0
            ]

        def at(x):
            return jax.lax.dynamic_slice(x, (i, 0), (1, width))[0]

        old = neighbour(0, 0)
        g11, g12, g22 = at(frame.g11), jnp.where(forward, 1, -1).astype(v.dtype) * at(frame.g12), at(frame.g22)
        candidate = offered(neighbour, g11, g12, g22, balance.map_images(at), second)
        new = taken(candidate, old, at(owner) == direction, at(frame.free), at(frame.top), frozen)
        return jax.lax.dynamic_update_slice(padded, new[None], (i + PAD, PAD))

    new = jax.lax.fori_loop(0, height, row, padded)[PAD:-PAD, PAD:-PAD]
    return new, jnp.where(new < v, direction, owner)
