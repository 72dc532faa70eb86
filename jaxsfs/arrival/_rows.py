"""Sweeps for arrival times in JAX: each pixel reads the row before it, so a row is one vector operation."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, UInt8

from jaxsfs._once import once

Image = Float[Array, "height width"]

PAD = 2  # rows and columns beyond the image that second order reads
HUGE = 1e30
BEYOND = 0.5 * HUGE
_ROOT2 = float(np.sqrt(2))
_TIE = 0.1  # parts of a pixel's slowness: offers that differ by less make several owners of one pixel
_TAKE_OVER = 0.25  # parts of a pixel's slowness: by so much less who owns nothing must offer


class Factor(eqx.Module):
    """∇T₀/T₀ across and along the rows, per pixel; T = T₀ τ."""

    across: Image
    along: Image

    def transposed(self) -> "Factor":
        return Factor(self.along.T, self.across.T)


class Frame(eqx.Module):
    """The fields as sweeps over rows, or turned as those over columns, see them."""

    slowness: Image
    factor: Factor | None

    def transposed(self) -> "Frame":
        return Frame(self.slowness.T, None if self.factor is None else self.factor.transposed())


Frames = tuple[Frame, Frame]
Owners = tuple[UInt8[Array, "rows columns"], UInt8[Array, "columns rows"]]


def everywhere(v: Image) -> None:
    """Where the last round changed something: of no use here, a row is computed as a whole."""


def one_round(
    v: Image, changed: None, owners: Owners | None, frames: Frames, frozen
) -> tuple[Image, None, Float[Array, ""]]:
    """v after four sweeps (down, up, right, left), where it changed, and the mean change in units of the largest value.

    `frames` and `owners` (see `owners_of`) as they are and with columns for rows. Second order where there are owners,
    who stay as they are when `frozen`.
    """
    new, slack = v, jnp.where(frozen, HUGE, _TAKE_OVER).astype(v.dtype)
    for axis, frame in enumerate(frames):
        owner = None if owners is None else owners[axis]
        for backward in (False, True):
            new = _directional_sweep(new, owner, frame, not backward, np.uint8(1 << (2 * axis + backward)), slack)
        new = new.T
    reached = new < BEYOND
    size = jnp.maximum(jnp.max(jnp.where(reached, jnp.abs(new), 0)), 1e-30)
    return new, None, jnp.mean(jnp.minimum(jnp.abs(new - v), size)) / size


def owners_of(v: Image, frames: Frames, never) -> Owners:
    """Who offers each pixel almost the least in first order, as bits in the order of the sweeps; the first owner, who
    offers the least, also four bits higher. `never`: see `once`."""
    offers = once([*_both_offers(v, frames[0]), *(offer.T for offer in _both_offers(v.T, frames[1]))], never)
    least = jnp.minimum(jnp.minimum(offers[0], offers[1]), jnp.minimum(offers[2], offers[3]))
    owners = jnp.zeros(v.shape, jnp.uint8)
    for n, offer in enumerate(offers):
        owns = (offer <= least + _TIE * frames[0].slowness) & (offer < BEYOND)
        owners |= jnp.where(owns, np.uint8(1 << n), np.uint8(0))
        owners |= jnp.where((offer == least) & owns & (owners < 16), np.uint8(16 << n), np.uint8(0))
    return owners, owners.T


def _both_offers(v: Image, frame: Frame) -> list[Image]:
    """What first order offers each pixel from the row before and the row after it, v as it is."""
    padded = jnp.pad(v, PAD, constant_values=HUGE)
    offers = []
    for sign in (1, -1):

        def neighbour(back, shift, sign=sign):
            begin = PAD - sign * back, PAD + shift
            return jax.lax.slice(padded, begin, (begin[0] + v.shape[0], begin[1] + v.shape[1]))

        local = None if frame.factor is None else (sign * frame.factor.across, frame.factor.along)
        offers.append(_row_update(neighbour, frame.slowness, local, False))
    return offers


def _directional_sweep(v, owner, frame: Frame, forward: bool, bit, slack):
    """One sweep down (`forward`) or up the rows.

    In second order values go up as well as down: a pixel's first owner sets it anew in every round, its others lower
    it, and those who own nothing do so only by much. If the least always won, a value made of old and new ones would
    stay.
    """
    height, width = v.shape
    padded = jnp.pad(v, PAD, constant_values=HUGE)
    sign = 1 if forward else -1

    def row(n, padded):
        i = n if forward else height - 1 - n

        def neighbour(back, shift):
            return jax.lax.dynamic_slice(padded, (i + PAD - sign * back, PAD + shift), (1, width))

        def at(x):
            return jax.lax.dynamic_slice(x, (i, 0), (1, width))

        factor = frame.factor
        local = None if factor is None else (sign * at(factor.across), at(factor.along))
        old = neighbour(0, 0)
        new = _row_update(neighbour, at(frame.slowness), local, owner is not None)
        better = new < old
        if owner is not None:
            mask = at(owner)
            better &= ((mask & bit) != 0) | (new < old - slack * at(frame.slowness))
            better |= (mask & (bit << 4)) != 0
        new = jnp.where(better, new, old)
        return jax.lax.dynamic_update_slice(padded, new, (i + PAD, PAD))

    return jax.lax.fori_loop(0, height, row, padded)[PAD:-PAD, PAD:-PAD]


def _row_update(neighbour, slowness, local, second: bool):
    """The smallest value that the row before offers: D₀² + (D₀ − D₁)² = slowness², D₀ and D₁ the differences towards
    the straight and the earlier diagonal neighbour, or one of them alone where the front comes along an edge.

    `local`: what a factor T₀ adds to them per τ, (e·∇T₀)/T₀; `slowness` is then divided by T₀.
    """
    here, straight, left, right = neighbour(0, 0), neighbour(1, 0), neighbour(1, -1), neighbour(1, 1)
    slope = right - left if local is None else right - left + 2 * local[1] * straight
    from_left = slope > 0
    diagonal = jnp.where(from_left, left, right)
    gap = diagonal - straight
    (a0, b0), (a1, b1) = (1.0, 0.0), (1.0, 0.0)
    if second:
        beyond, aside = neighbour(2, 0), jnp.where(from_left, neighbour(2, -2), neighbour(2, 2))
        difference = _limited if local is None else _smooth
        a0, b0 = difference(here, straight, beyond)
        a1, b1 = difference(here, diagonal, aside)
    if local is not None:
        across, along = local
        turn = across + jnp.where(from_left, along, -along)
        a0, b0, a1, b1 = a0 + across, b0 - across * straight, a1 + turn, b1 - turn * diagonal
    x, between = _from_triangle(a0, b0, a1, b1 + a1 * gap, slowness)
    edge = jnp.minimum(straight + (slowness + b0) / a0, diagonal + (_ROOT2 * slowness + b1) / a1)
    return jnp.where(between, straight + x, edge)


def _from_triangle(p0, c0, p1, c1, slowness):
    """x with D₀² + (D₀ − D₁)² = slowness², D = p x − c, and whether the front comes between both neighbours."""
    e, k = p0 - p1, c1 - c0
    quad, half = p0 * p0 + e * e, p0 * c0 - e * k
    x = (half + jnp.sqrt(half * half - quad * (c0 * c0 + k * k - slowness * slowness))) / quad
    turn, d0 = e * x + k, p0 * x - c0
    return x, (turn <= 0) & (turn + d0 >= 0)


def _limited(here, near, far):
    """(a, b) of the one-sided difference a (v − near) − b: a parabola through both neighbours, less of it where their
    values bend."""
    fall, before = here - near, near - far
    ratio = before / fall
    share = jnp.where(fall > 0, jnp.clip(jnp.minimum(4 * ratio - 1, 2 - 0.5 * ratio), 0, 1), 0)
    return 1 + 0.5 * share, 0.5 * share * before


def _smooth(here, near, far):
    """The same without a limit, for τ."""
    share = jnp.where(far < BEYOND, 0.5, 0.0).astype(near.dtype)
    return 1 + share, jnp.where(far < BEYOND, 0.5 * (near - far), 0)
