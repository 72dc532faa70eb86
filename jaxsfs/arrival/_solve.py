"""Arrival times of a front of given speed on a plane: |∇T| = 1/F (the paper's orthographic case, eqs. 1–4, with
F = c/√(1 − c²)).

The sweeps of `jaxsfs.sweeping` for a metric that is the same everywhere: of both diagonal neighbours only the earlier
one counts, and a triangle costs one square root. For a point source T = T₀ τ with T₀ = |x − x_s|/F(x_s), so that what
is solved for is smooth at the source (Fomel, Luo & Zhao 2009; Treister & Haber 2016).
"""

from functools import partial
from typing import Literal

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from jaxsfs._once import once
from jaxsfs.arrival import _numba, _rows
from jaxsfs.arrival._rows import BEYOND, HUGE, Factor, Image
from jaxsfs.forms import Scalar
from jaxsfs.native import preferred

Updates = Literal["rows", "numba"]
_BY = {"rows": _rows, "numba": _numba}
_TIE = 0.1  # parts of a pixel's slowness: offers that differ by less make several owners of one pixel
_SETTLED = 1e-2  # mean relative change of a round, after which second order begins


class ArrivalTimes(eqx.Module):
    """T (pixel spacing/speed), where the front came by, and the rounds of four sweeps that it took."""

    time: Image
    reached: Bool[Array, "height width"]
    rounds: Int[Array, ""]


def arrival_times(
    speed: Image,
    known: Float[Array, "rows columns"],
    *,
    spacing: Scalar = 1.0,
    order: int = 2,
    max_rounds: int = 40,
    tolerance: float = 1e-5,
    updates: Updates | None = None,
) -> ArrivalTimes:
    """T with |∇T| = 1/F and T = `known` where that is finite (+inf elsewhere): the first arrival (viscosity solution).

    `speed` F > 0 in length per time, in units of which a pixel is `spacing` wide; no front enters a pixel where F is
    not positive and finite. For second order `known` should be given on a band two pixels wide. Raises ValueError for
    shapes that differ, an order other than 1 and 2, or where nothing is known. `updates`: who computes the sweeps, XLA
    or functions that Numba compiled; None takes the faster one that is there.
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
        updates=updates,
    )


def arrival_from_point(
    speed: Image,
    source: tuple[int, int],
    *,
    spacing: Scalar = 1.0,
    order: int = 2,
    max_rounds: int = 40,
    tolerance: float = 1e-5,
    updates: Updates | None = None,
) -> ArrivalTimes:
    """T with |∇T| = 1/F and T = 0 at the pixel `source` (u, v), factored: T = T₀ τ, T₀ = |x − x_s|/F(x_s).

    `speed`, `spacing` and `updates` as in `arrival_times`. Raises ValueError for a source outside the image or without
    speed.
    """
    u, v = source
    height, width = speed.shape
    if not (0 <= u < width and 0 <= v < height):
        raise ValueError(f"the source ({u}, {v}) lies outside the image of {width} x {height} px")
    if not float(speed[v, u]) > 0:
        raise ValueError(f"the source ({u}, {v}) lies where the speed is {float(speed[v, u]):.3g}: expected above 0")
    position = jnp.asarray([v, u])
    spacing = jnp.asarray(spacing, speed.dtype)
    return _solve(
        speed,
        None,
        spacing,
        position,
        order=_checked(order),
        max_rounds=max_rounds,
        tolerance=tolerance,
        updates=updates,
    )


def _checked(order: int) -> int:
    if order not in (1, 2):
        raise ValueError(f"order must be 1 or 2, got {order!r}")
    return order


@partial(jax.jit, static_argnames=("order", "max_rounds", "tolerance", "updates"))
def _solve(speed, known, spacing, source, *, order: int, max_rounds: int, tolerance: float, updates: Updates | None):
    slowness = jnp.where((speed > 0) & jnp.isfinite(speed), spacing / speed, HUGE)
    base, factor = None, None
    if source is not None:
        base, factor = _factor_around(source, slowness)
        known = jnp.where(base == 0, base, jnp.inf)
        base = jnp.where(base == 0, 1, base)
    given = jnp.isfinite(known)
    slowness = jnp.where(given, HUGE, slowness)  # so slow that no update lowers a pixel of known time
    v = jnp.where(given, known, HUGE)
    if base is not None:
        v, slowness = jnp.where(given, jnp.ones_like(known), HUGE), slowness / base
    solver = _BY[updates or preferred()]
    limit = tolerance if order == 1 else _SETTLED
    v, rounds = _rounds(solver, v, None, slowness, factor, max_rounds, limit)
    if order == 2:
        v, more = _rounds(
            solver, v, _owners(solver, v, slowness, factor, rounds < 0), slowness, factor, max_rounds, tolerance
        )
        rounds += more
    reached = v < BEYOND
    time = v if base is None else jnp.where(given, 0, v * base)
    return ArrivalTimes(jnp.where(reached, time, jnp.inf), reached, rounds)


def _factor_around(source, slowness):
    """T₀ and its `Factor`."""
    pixels = jnp.indices(slowness.shape)
    v, u = (x.astype(slowness.dtype) - at.astype(slowness.dtype) for x, at in zip(pixels, source, strict=True))
    square = jnp.maximum(v * v + u * u, 0.25)
    return slowness[source[0], source[1]] * jnp.sqrt(v * v + u * u), Factor(v / square, u / square)


def _rounds(solver, start, owners, slowness, factor, max_rounds: int, tolerance: float):
    """v after rounds of four sweeps each, until the mean change of a round is small; and their number. Second order
    where `owners` are given."""
    frames = _frames(slowness, factor)
    owners = (None, None) if owners is None else (owners, owners.T)

    def one_round(state):
        old, rounds, _ = state
        new = old
        for axis in (0, 1):
            new = solver.both_sweeps(new, owners[axis], *frames[axis], axis)
        reached = new < BEYOND
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


def _owners(solver, v, slowness, factor, never):
    """Who offers each pixel almost the least in first order, as bits in the order of the sweeps; the first owner, who
    offers the least, also four bits higher."""
    frames = _frames(slowness, factor)
    offers = once([offer for axis in (0, 1) for offer in solver.both_offers(v, *frames[axis], axis)], never)
    least = jnp.minimum(jnp.minimum(offers[0], offers[1]), jnp.minimum(offers[2], offers[3]))
    owners = jnp.zeros(v.shape, jnp.uint8)
    for n, offer in enumerate(offers):
        owns = (offer <= least + _TIE * slowness) & (offer < BEYOND)
        owners |= jnp.where(owns, np.uint8(1 << n), np.uint8(0))
        owners |= jnp.where((offer == least) & owns & (owners < 16), np.uint8(16 << n), np.uint8(0))
    return owners
