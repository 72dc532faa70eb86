"""All pixels at once, from the values before: as many operations in a row as a front has pixels to cross, each over the
whole picture. For machines that do a picture as fast as a row."""

import jax
import jax.numpy as jnp

from jaxsfs.updates._pixel import HUGE, PAD, BalanceOf, Frame, Image, Owners, offered, taken


def jacobi(
    v: Image, owner: Owners, balance_of: BalanceOf, frames: tuple[Frame, Frame], second, frozen
) -> tuple[Image, Owners]:
    """One round: v and owners after as many steps as the picture's longer side has pixels."""

    def step(_, state):
        return _step(state[0], state[1], balance_of, frames[0], second, frozen)

    return jax.lax.fori_loop(0, max(v.shape), step, (v, owner))


def _step(v: Image, owner: Owners, balance_of, frame: Frame, second, frozen) -> tuple[Image, Owners]:
    height, width = v.shape
    balance = balance_of(v, 0)
    padded = jnp.pad(v, PAD, constant_values=HUGE)

    def at(down: int, right: int) -> Image:
        return padded[PAD + down : PAD + down + height, PAD + right : PAD + right + width]

    new = v
    for direction, (sign, along) in enumerate(((-1, "rows"), (1, "rows"), (-1, "columns"), (1, "columns"))):
        g12 = sign * frame.g12
        if along == "rows":
            candidate = offered(
                lambda back, shift, s=sign: at(-s * back, shift), frame.g11, g12, frame.g22, balance, second
            )
        else:
            candidate = offered(
                lambda back, shift, s=sign: at(shift, -s * back), frame.g22, g12, frame.g11, balance, second
            )
        before = new
        new = taken(candidate, before, owner == direction, frame.free, frame.top, frozen)
        owner = jnp.where(new < before, jnp.int8(direction), owner)
    return new, owner
