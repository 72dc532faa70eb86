"""Level-set propagation: φ_s = F |∇φ|_g with time s = w, one jitted `lax.scan` (Osher & Sethian 1988, eqs. 4 and 6).

φ > 0 behind the front. Time is s = ln t, t the range of the front (for a distant light s = z), so accuracy is even
over the range. A pixel that no front has reached at its deadline faces the light and becomes a source itself.

Only the zero level has a meaning, so the speed off the front is ours to choose. We take F at the time s − φ instead
of s: then φ = s − w(u, v) solves the equation everywhere, its slope is that of the surface itself, and it does not
drift away from that form. What has to be kept up (the re-initialisation of this method) is: behind the front
φ = s − w with the recorded w; ahead of it φ is never less than what a straight path from a neighbour gives.
"""

from functools import partial

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

from jaxsfs.shading import AbstractShading
from jaxsfs.upwind import Offset, selling_weights

Image = Float[Array, "height width"]
Mask = Bool[Array, "height width"]

_CFL = 0.9
_FAR = 100.0  # later than any arrival: what a pixel without data has
_RING = ((1, 0), (0, 1), (1, 1), (1, -1), (-1, 0), (0, -1), (-1, -1), (-1, 1))


class Arrival(eqx.Module):
    """When the front reached each pixel: w, where it did, and how many steps it took until the last one."""

    w: Image
    reached: Mask
    steps: Int[Array, ""]


@partial(jax.jit, static_argnames=("offsets", "order", "steps"))
def propagate(
    shading: AbstractShading,
    inverse_metric: Float[Array, "height width 2 2"],
    inside: Mask,
    known: Image,
    start: Float[Array, ""],
    end: Float[Array, ""],
    *,
    offsets: tuple[Offset, ...],
    order: int = 2,
    steps: int = 1000,
) -> Arrival:
    """Runs the front over `inside` from time `start` to `end` in at most `steps` steps of adaptive length.

    `known`: w of the initial curve and what lies behind it, +inf elsewhere. Order 1: Osher & Sethian's scheme with an
    Euler step; order 2: ENO2 differences with the two-stage SSP Runge–Kutta step. Pixels outside `inside` are left
    out of every difference (state constraints).
    """
    weights, carried = selling_weights(inverse_metric, offsets)
    inside = inside & carried
    stencil = _Stencil(weights, inside, offsets, order)
    crossing = jnp.sqrt(jnp.sum(weights, axis=0))
    one_pixel = _CFL / jnp.max(crossing) ** 2
    half_lengths = 0.5 * jnp.where(inside[None], _ring_lengths(inverse_metric), _FAR)
    due = jnp.where(inside, jnp.minimum(jnp.minimum(shading.deadline(), known), end + _FAR), end + _FAR)

    def step(state, n):
        # once no pixel waits, a step costs nothing
        busy = jnp.any(inside & (state[0] > state[1]))
        return jax.lax.cond(busy, advanced, lambda state, n: state, state, n), busy

    def advanced(state, n):
        w, s = state
        waiting = inside & (w > s)
        # 1/F with a pixel round it, once a step: whatever needs it reads the same array
        slowness = jnp.pad(1 / shading.speed(w), 1)
        here = _window(slowness, 1, (0, 0), w.shape)
        soonest = jnp.min(jnp.where(waiting, _next_event(here, crossing, w - s, one_pixel), jnp.inf))
        ds = jnp.maximum(jnp.minimum(soonest, end - s + one_pixel), _least_step(end - s, n, steps))
        # One expression is the CFL number and the speed cap: no pixel is crossed faster than the scheme carries.
        cap = _CFL / (ds * crossing)

        def delay(w, speed):
            """−∂(φ − s)/∂s: how fast the expected arrival w = s − φ is put off."""
            return 1 - jnp.minimum(speed, cap) * stencil.gradient(w)

        first = delay(w, 1 / here)
        new = w + ds * first
        if order == 2:
            ahead = jnp.minimum(new, due)
            new = w + 0.5 * ds * (first + delay(ahead, shading.speed(ahead)))
        # without a deadline a pixel has no expected arrival until a straight path gives it one
        expected = jnp.where(w < end + 0.5 * _FAR, jnp.minimum(new, due), w)
        new = _between(expected, w, due, slowness, inside, half_lengths)
        return jnp.where(waiting, new, w), s + ds

    (w, s), busy = jax.lax.scan(step, (due, start), jnp.arange(steps))
    return Arrival(w, inside & (w <= s), jnp.sum(busy))


def _next_event(slowness, crossing, wait, one_pixel):
    """The time in which an active pixel is crossed for the most part; of one that the front is far from, until a
    source of its own has grown by one pixel."""
    # next to its singular point a front is infinitely fast; one pixel away it has F = 1 px
    rate = jnp.minimum(1 / slowness, crossing) * crossing
    return jnp.where(wait * rate < 2, _CFL / jnp.maximum(rate, 1e-6), wait + one_pixel)


def _least_step(left, n, steps):
    """A step is never so short that the remaining ones could not reach the end."""
    share = jnp.maximum(n.astype(left.dtype) / steps, 0.1) / (steps - n).astype(left.dtype)
    return jnp.where(n == steps - 1, 1, share) * left


def _between(new, w, due, slowness, inside, half_lengths):
    """`new` within what causality allows: not before the earliest of the eight neighbours (unless the pixel is a
    source itself), and no later than along a straight path from any of them. `slowness`: 1/F with a pixel round it."""
    times = _padded(w, inside, 1)
    here = _window(slowness, 1, (0, 0), w.shape)
    earliest, latest = due, new
    for n, offset in enumerate(_RING):
        time = _window(times, 1, offset, w.shape)
        path = half_lengths[n % 4] * (here + _window(slowness, 1, offset, w.shape))
        earliest = jnp.minimum(earliest, time)
        latest = jnp.minimum(latest, time + path)
    return jnp.maximum(latest, earliest)


def _ring_lengths(g):
    """Length of the first four offsets of `_RING` in the metric g_ij, from its inverse."""
    determinant = g[..., 0, 0] * g[..., 1, 1] - g[..., 0, 1] ** 2
    squares = [g[..., 1, 1] * du**2 - 2 * g[..., 0, 1] * du * dv + g[..., 0, 0] * dv**2 for du, dv in _RING[:4]]
    return jnp.sqrt(jnp.stack(squares) / determinant[None])


class _Stencil(eqx.Module):
    """Offsets with their weights, and the pixels that have data."""

    weights: Float[Array, "offsets height width"]
    inside: Mask
    offsets: tuple[Offset, ...] = eqx.field(static=True)
    order: int = eqx.field(static=True)

    def gradient(self, w: Image) -> Image:
        """√(Σ_k λ_k max(0, D₊, D₋)²), D± the one-sided differences of φ = s − w towards larger φ: monotone in φ."""
        reach = max(max(abs(du), abs(dv)) for du, dv in self.offsets) * self.order
        field = _padded(w, self.inside, reach)
        total = jnp.zeros_like(w)
        for (du, dv), weight in zip(self.offsets, self.weights, strict=True):
            ahead = _one_sided(field, reach, (du, dv), w.shape, self.order)
            behind = _one_sided(field, reach, (-du, -dv), w.shape, self.order)
            total += weight * jnp.maximum(jnp.maximum(ahead, behind), 0) ** 2
        return jnp.sqrt(total)


def _one_sided(field, reach, offset, shape, order):
    """w(x) − w(x + e), or its ENO2 form with the smaller of two second differences."""
    du, dv = offset
    here, there = _window(field, reach, (0, 0), shape), _window(field, reach, offset, shape)
    first = here - there
    if order == 1:
        return first
    beyond, back = _window(field, reach, (2 * du, 2 * dv), shape), _window(field, reach, (-du, -dv), shape)
    at_here, at_there = first + here - back, there - beyond - first
    smaller = jnp.where(jnp.abs(at_here) < jnp.abs(at_there), at_here, at_there)
    smooth = (beyond < 0.5 * _FAR) & (back < 0.5 * _FAR) & (at_here * at_there > 0)
    return first - 0.5 * jnp.where(smooth, smaller, 0)


def _padded(w, inside, reach):
    """w with `reach` pixels round it; a pixel without data comes later than any front, so it never is upwind."""
    return jnp.pad(jnp.where(inside, w, 2 * _FAR), reach, constant_values=2 * _FAR)


def _window(field, reach, offset, shape):
    """field(x + offset) on the image, from a field padded by `reach`."""
    du, dv = offset
    return jax.lax.slice(field, (reach + dv, reach + du), (reach + dv + shape[0], reach + du + shape[1]))
