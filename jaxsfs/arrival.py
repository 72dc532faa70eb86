"""Arrival times of a front of given speed on a plane: |∇T| = 1/F (the paper's orthographic case, eqs. 1–4, with
F = c/√(1 − c²)).

The sweeps of `jaxsfs.sweeping` for a metric that is the same everywhere: of both diagonal neighbours only the earlier
one counts, and a triangle costs one square root. For a point source T = T₀ τ with T₀ = |x − x_s|/F(x_s), so that what
is solved for is smooth at the source (Fomel, Luo & Zhao 2009; Treister & Haber 2016).
"""

from functools import partial

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from jaxsfs.forms import Scalar

Image = Float[Array, "height width"]

_PAD = 2  # rows and columns beyond the image that second order reads
_HUGE = 1e30
_BEYOND = 0.5 * _HUGE
_ROOT2 = float(np.sqrt(2))
# Parts of a pixel's slowness: offers that differ by less make several owners of one pixel; who owns nothing must offer
# so much less.
_TIE, _TAKE_OVER = 0.1, 0.25
_SETTLED = 1e-2  # mean relative change of a round, after which second order begins


class ArrivalTimes(eqx.Module):
    """T (pixel spacing/speed), where the front came by, and the rounds of four sweeps that it took."""

    time: Image
    reached: Bool[Array, "height width"]
    rounds: Int[Array, ""]


class _Factor(eqx.Module):
    """∇T₀/T₀ across and along the rows, per pixel; T = T₀ τ."""

    across: Image
    along: Image

    def transposed(self) -> "_Factor":
        return _Factor(self.along.T, self.across.T)


def arrival_times(
    speed: Image,
    known: Float[Array, "rows columns"],
    *,
    spacing: Scalar = 1.0,
    order: int = 2,
    max_rounds: int = 40,
    tolerance: float = 1e-5,
) -> ArrivalTimes:
    """T with |∇T| = 1/F and T = `known` where that is finite (+inf elsewhere): the first arrival (viscosity solution).

    `speed` F > 0 in length per time, in units of which a pixel is `spacing` wide; no front enters a pixel where F is
    not positive and finite. For second order `known` should be given on a band two pixels wide. Raises ValueError for
    shapes that differ, an order other than 1 and 2, or where nothing is known.
    """
    if speed.shape != known.shape:
        raise ValueError(f"speed has shape {speed.shape}, known times {known.shape}: expected the same")
    if not bool(jnp.any(jnp.isfinite(known))):
        raise ValueError("no arrival time is known: give T on the initial curve, +inf elsewhere")
    return _solve(
        speed,
        known,
        jnp.asarray(spacing, speed.dtype),
        None,
        order=_checked(order),
        max_rounds=max_rounds,
        tolerance=tolerance,
    )


def arrival_from_point(
    speed: Image,
    source: tuple[int, int],
    *,
    spacing: Scalar = 1.0,
    order: int = 2,
    max_rounds: int = 40,
    tolerance: float = 1e-5,
) -> ArrivalTimes:
    """T with |∇T| = 1/F and T = 0 at the pixel `source` (u, v), factored: T = T₀ τ, T₀ = |x − x_s|/F(x_s).

    `speed` and `spacing` as in `arrival_times`. Raises ValueError for a source outside the image or without speed.
    """
    u, v = source
    height, width = speed.shape
    if not (0 <= u < width and 0 <= v < height):
        raise ValueError(f"the source ({u}, {v}) lies outside the image of {width} x {height} px")
    if not float(speed[v, u]) > 0:
        raise ValueError(f"the source ({u}, {v}) lies where the speed is {float(speed[v, u]):.3g}: expected above 0")
    position = jnp.asarray([v, u])
    spacing = jnp.asarray(spacing, speed.dtype)
    return _solve(speed, None, spacing, position, order=_checked(order), max_rounds=max_rounds, tolerance=tolerance)


def _checked(order: int) -> int:
    if order not in (1, 2):
        raise ValueError(f"order must be 1 or 2, got {order!r}")
    return order


@partial(jax.jit, static_argnames=("order", "max_rounds", "tolerance"))
def _solve(speed, known, spacing, source, *, order: int, max_rounds: int, tolerance: float) -> ArrivalTimes:
    slowness = jnp.where((speed > 0) & jnp.isfinite(speed), spacing / speed, _HUGE)
    base, factor = None, None
    if source is not None:
        base, factor = _factor_around(source, slowness)
        known = jnp.where(base == 0, base, jnp.inf)
        base = jnp.where(base == 0, 1, base)
    given = jnp.isfinite(known)
    slowness = jnp.where(given, _HUGE, slowness)  # so slow that no update lowers a pixel of known time
    v = jnp.where(given, known, _HUGE)
    if base is not None:
        v, slowness = jnp.where(given, jnp.ones_like(known), _HUGE), slowness / base
    limit = tolerance if order == 1 else _SETTLED
    v, rounds = _rounds(v, None, slowness, factor, max_rounds, limit)
    if order == 2:
        v, more = _rounds(v, _owners(v, slowness, factor), slowness, factor, max_rounds, tolerance)
        rounds += more
    reached = v < _BEYOND
    time = v if base is None else jnp.where(given, 0, v * base)
    return ArrivalTimes(jnp.where(reached, time, jnp.inf), reached, rounds)


def _factor_around(source, slowness):
    """T₀ and its `_Factor`."""
    pixels = jnp.indices(slowness.shape)
    v, u = (x.astype(slowness.dtype) - at.astype(slowness.dtype) for x, at in zip(pixels, source, strict=True))
    square = jnp.maximum(v * v + u * u, 0.25)
    return slowness[source[0], source[1]] * jnp.sqrt(v * v + u * u), _Factor(v / square, u / square)


def _rounds(start, owners, slowness, factor, max_rounds: int, tolerance: float):
    """v after rounds of four sweeps each, until the mean change of a round is small; and their number. Second order
    where `owners` are given."""
    frames = _frames(slowness, factor)
    owners = (None, None) if owners is None else (owners, owners.T)

    def one_round(state):
        old, rounds, _ = state
        new = old
        for axis in (0, 1):
            for backward in (False, True):
                bit = np.uint8(1 << (2 * axis + backward))
                turned = _directional_sweep(new.T if axis else new, owners[axis], *frames[axis], not backward, bit)
                new = turned.T if axis else turned
        reached = new < _BEYOND
        size = jnp.maximum(jnp.max(jnp.where(reached, jnp.abs(new), 0)), 1e-30)
        change = jnp.mean(jnp.minimum(jnp.abs(new - old), size)) / size
        return new, rounds + 1, change

    def proceed(state):
        _, rounds, change = state
        return (rounds < max_rounds) & (change > tolerance)

    start = start, jnp.int32(0), jnp.asarray(jnp.inf, slowness.dtype)
    v, rounds, _ = jax.lax.while_loop(proceed, one_round, start)
    return v, rounds


def _frames(slowness, factor):
    """The fields as sweeps over rows and over columns see them."""
    return (slowness, factor), (slowness.T, None if factor is None else factor.transposed())


def _directional_sweep(v, owner, slowness, factor, forward: bool, bit):
    """One sweep down (`forward`) or up the rows.

    In second order values go up as well as down: a pixel's first owner sets it anew in every round, its others lower
    it, and those who own nothing do so only by much. If the least always won, a value made of old and new ones would
    stay.
    """
    height, width = v.shape
    padded = jnp.pad(v, _PAD, constant_values=_HUGE)
    sign = 1 if forward else -1

    def row(n, padded):
        i = n if forward else height - 1 - n

        def neighbour(back, shift):
            return jax.lax.dynamic_slice(padded, (i + _PAD - sign * back, _PAD + shift), (1, width))

        def at(x):
            return jax.lax.dynamic_slice(x, (i, 0), (1, width))

        local = None if factor is None else (sign * at(factor.across), at(factor.along))
        old = neighbour(0, 0)
        new = _row_update(neighbour, at(slowness), local, owner is not None)
        better = new < old
        if owner is not None:
            mask = at(owner)
            better &= ((mask & bit) != 0) | (new < old - _TAKE_OVER * at(slowness))
            better |= (mask & (bit << 4)) != 0
        new = jnp.where(better, new, old)
        return jax.lax.dynamic_update_slice(padded, new, (i + _PAD, _PAD))

    return jax.lax.fori_loop(0, height, row, padded)[_PAD:-_PAD, _PAD:-_PAD]


def _owners(v, slowness, factor):
    """Who offers each pixel almost the least in first order, as bits in the order of the sweeps; the first owner, who
    offers the least, also four bits higher."""
    offers = []
    for axis in (0, 1):
        vt, (st, ft) = (v.T if axis else v), _frames(slowness, factor)[axis]
        padded = jnp.pad(vt, _PAD, constant_values=_HUGE)
        for sign in (1, -1):

            def neighbour(back, shift, padded=padded, shape=vt.shape, sign=sign):
                begin = _PAD - sign * back, _PAD + shift
                return jax.lax.slice(padded, begin, (begin[0] + shape[0], begin[1] + shape[1]))

            local = None if ft is None else (sign * ft.across, ft.along)
            offer = _row_update(neighbour, st, local, False)
            offers.append(offer if axis == 0 else offer.T)
    least = jnp.minimum(jnp.minimum(offers[0], offers[1]), jnp.minimum(offers[2], offers[3]))
    owners = jnp.zeros(v.shape, jnp.uint8)
    for n, offer in enumerate(offers):
        owns = (offer <= least + _TIE * slowness) & (offer < _BEYOND)
        owners |= jnp.where(owns, np.uint8(1 << n), np.uint8(0))
        owners |= jnp.where((offer == least) & owns & (owners < 16), np.uint8(16 << n), np.uint8(0))
    return owners


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
    share = jnp.where(far < _BEYOND, 0.5, 0.0).astype(near.dtype)
    return 1 + share, jnp.where(far < _BEYOND, 0.5 * (near - far), 0)
