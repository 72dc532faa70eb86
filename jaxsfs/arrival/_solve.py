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

from jaxsfs.arrival import _numba, _rows
from jaxsfs.arrival._rows import BEYOND, HUGE, Factor, Frame, Image
from jaxsfs.forms import Scalar
from jaxsfs.native import preferred

Updates = Literal["rows", "numba"]
_BY = {"rows": _rows, "numba": _numba}
_SETTLED = 1e-2  # mean relative change of a round, after which second order begins
_SHARE = 0.1  # of what the first round of second order changed: no more than that need the last one change
_CLOSEST, _ROUGHEST = 1e-5, 1e-4  # limits of what that may come to


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
    tolerance: float | None = None,
    updates: Updates | None = None,
) -> ArrivalTimes:
    """T with |∇T| = 1/F and T = `known` where that is finite (+inf elsewhere): the first arrival (viscosity solution).

    `speed` F > 0 in length per time, in units of which a pixel is `spacing` wide; no front enters a pixel where F is
    not positive and finite. For second order `known` should be given on a band two pixels wide. Raises ValueError for
    shapes that differ, an order other than 1 and 2, or where nothing is known. `updates`: who computes the sweeps, XLA
    or functions that Numba compiled; None takes the faster one that is there. `tolerance`: mean relative change of a
    round after which it is enough; None: 1e-5, or in second order a tenth of what the first round of it changed if that
    is more, up to 1e-4 (the scheme's own error is larger).
    """
    if speed.shape != known.shape:
        raise ValueError(f"speed has shape {speed.shape}, known times {known.shape}: expected the same")
    if not np.isfinite(np.asarray(known)).any():
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
    tolerance: float | None = None,
    updates: Updates | None = None,
) -> ArrivalTimes:
    """T with |∇T| = 1/F and T = 0 at the pixel `source` (u, v), factored: T = T₀ τ, T₀ = |x − x_s|/F(x_s).

    `speed`, `spacing`, `tolerance` and `updates`: as in `arrival_times`. Raises ValueError for a source outside the
    image or without speed.
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
def _solve(
    speed, known, spacing, source, *, order: int, max_rounds: int, tolerance: float | None, updates: Updates | None
):
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
    closest = _CLOSEST if tolerance is None else tolerance
    limit = closest if order == 1 else _SETTLED
    frames = Frame(slowness, factor), Frame(slowness, factor).transposed()
    v, rounds = _rounds(solver, v, None, frames, max_rounds, limit)
    if order == 2:
        v, more = _rounds(solver, v, solver.owners_of(v, frames, rounds < 0), frames, max_rounds, tolerance)
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


def _rounds(solver, start, owners, frames, max_rounds: int, tolerance: float | None):
    """v after rounds of four sweeps each, until the mean relative change of a round is below `tolerance` (None: a share
    of what the first one changed); and their number. Second order where `owners` are given."""

    def body(state):
        v, changed, rounds, _, limit = state
        # values find out in a first round whom they follow better
        v, changed, change = solver.one_round(v, changed, owners, frames, (owners is not None) & (rounds > 0))
        if tolerance is None:
            limit = jnp.where(rounds == 0, jnp.clip(_SHARE * change, _CLOSEST, _ROUGHEST), limit)
        return v, changed, rounds + 1, change, limit

    def proceed(state):
        _, _, rounds, change, limit = state
        return (rounds < max_rounds) & (change > limit)

    unknown, limit = (jnp.asarray(x, start.dtype) for x in (jnp.inf, tolerance or 0))
    start = start, solver.everywhere(start), jnp.int32(0), unknown, limit
    v, _, rounds, _, _ = jax.lax.while_loop(proceed, body, start)
    return v, rounds
