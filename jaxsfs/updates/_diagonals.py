"""Anti-diagonal by anti-diagonal, from each corner in turn (Zhao 2005's four orders, Detrixhe et al. 2013's vectors).

Pixels of an anti-diagonal i + j = d read those of the anti-diagonals before, so one of them is a vector operation. The
picture is sheared, S[i + j, j] = v[i, j], so that anti-diagonals lie in rows.
"""

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxsfs.shading import Balance
from jaxsfs.updates._pixel import HUGE, PAD, BalanceOf, Frame, Image, Owners, offered, taken

_BEFORE = 2 * PAD  # anti-diagonals that second order reads


def diagonals(
    v: Image, owner: Owners, balance_of: BalanceOf, frames: tuple[Frame, Frame], second, frozen
) -> tuple[Image, Owners]:
    """One round: v and owners after a sweep from each of the four corners."""
    frame, _ = frames
    for down in (True, False):
        for right in (True, False):
            corner = jnp.int8(2 * down + right)
            turn = (slice(None, None, 1 if down else -1), slice(None, None, 1 if right else -1))
            balance = balance_of(v, 0).map_images(lambda x, turn=turn: x[turn])
            turned = jax.tree.map(lambda x, turn=turn: x[turn], frame)
            sign = 1 if down == right else -1
            new = _from_corner(v[turn], owner[turn] == corner, balance, turned, sign, second, frozen)[turn]
            v, owner = new, jnp.where(new < v, corner, owner)
    return v, owner


def _from_corner(v: Image, mine, balance: Balance, frame: Frame, sign: int, second, frozen) -> Image:
    """v after the sweep from the upper left corner, which owns the pixels `mine`."""
    height, width = v.shape
    sheared = jnp.pad(_sheared(v, HUGE), ((_BEFORE, 0), (PAD, PAD)), constant_values=HUGE)
    still = Frame(
        _sheared(frame.g11, 1),
        _sheared(sign * frame.g12, 0),
        _sheared(frame.g22, 1),
        _sheared(frame.top, HUGE),
        _sheared(frame.free, False),
    )
    images, numbers = eqx.partition(balance.map_images(lambda x: _sheared(x, 0)), lambda x: jnp.ndim(x) > 0)

    def line(values, here):
        d, f, b, mine = here
        b = eqx.combine(b, numbers)

        def neighbour(up, left):
            return jax.lax.dynamic_slice(values, (d + _BEFORE - up - left, PAD - left), (1, width))[0]

        from_above = offered(lambda back, shift: neighbour(back, -shift), f.g11, f.g12, f.g22, b, second)
        from_left = offered(lambda back, shift: neighbour(-shift, back), f.g22, f.g12, f.g11, b, second)
        new = taken(jnp.minimum(from_above, from_left), neighbour(0, 0), mine, f.free, f.top, frozen)
        return jax.lax.dynamic_update_slice(values, new[None], (d + _BEFORE, PAD)), None

    lines = (jnp.arange(height + width - 1), still, images, _sheared(mine, False))
    values, _ = jax.lax.scan(line, sheared, lines)
    return _unsheared(values[_BEFORE:, PAD:-PAD], height)


def _sheared(x, fill):
    """S[i + j, j] = x[i, j], `fill` beside the picture: columns one after the other, each with a gap as long as a row,
    read again with a gap less."""
    height, width = x.shape
    columns = jnp.pad(x.T, ((0, 0), (0, width)), constant_values=fill).reshape(-1)
    return columns[:-width].reshape(width, height + width - 1).T


def _unsheared(sheared, height: int):
    """The inverse."""
    width = sheared.shape[1]
    columns = jnp.pad(sheared.T.reshape(-1), (0, width)).reshape(width, height + width)
    return columns[:, :height].T
