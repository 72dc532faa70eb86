"""Raster sweeps over the static form |∇v|²_g + B v² = P (Weber et al. 2008 for the order of updates).

Every pixel starts at its deadline and falls to the largest solution below it. A sweep goes row by row; each pixel
reads the row before it, so a row is one vector operation. Four sweeps (down, up, right, left) make a round.

The update at a pixel x with neighbours y₁ (straight) and y₂ (diagonal) takes one-sided differences
D_k = a_k (v − m_k) along both edges and solves Σ h^{kl} D_k D_l + B v² = P, h^{kl} the inverse metric in the basis
of the edges. First order: a = 1, m = v(y). Second order: a = 3/2, m = (4 v(y) − v(y'))/3 with y' one step further,
where v still falls there.
"""

from functools import partial

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

from jaxsfs.forms import Scalar
from jaxsfs.shading import AbstractShading, Balance

Image = Float[Array, "height width"]
Mask = Bool[Array, "height width"]

_PAD = 2  # rows and columns beyond the image that second order reads
_HUGE = 1e30  # v where there is no data: never upwind of anything
_SETTLED = 1e-2  # mean relative change of v in a round after which the order of the pixels is known


class Sweeps(eqx.Module):
    """Solution of the static form: w where a front came by or a deadline holds, and the work it took.

    `change`: mean relative change of v in the last round.
    """

    w: Image
    reached: Mask
    rounds: Int[Array, ""]
    change: Float[Array, ""]


class _Frame(eqx.Module):
    """The image as one pair of opposite sweeps sees it: as it is, or transposed."""

    g11: Image  # across the sweep
    g12: Image
    g22: Image  # along the sweep
    top: Image  # deadline of v
    free: Mask

    def transposed(self) -> "_Frame":
        return _Frame(self.g22.T, self.g12.T, self.g11.T, self.top.T, self.free.T)


@partial(jax.jit, static_argnames=("order", "max_rounds", "tolerance"))
def sweep(
    shading: AbstractShading,
    inverse_metric: Float[Array, "height width 2 2"],
    inside: Mask,
    known: Image,
    *,
    order: int = 2,
    max_rounds: int = 40,
    tolerance: float = 1e-6,
) -> Sweeps:
    """Solves for w on `inside`.

    `known`: w where it is given (Dirichlet), +inf elsewhere. Pixels outside `inside` are left out of every
    difference (state constraints). Stops when the mean relative
    change of v in a round is below `tolerance`: on a noisy image single pixels go on flickering for no gain.
    """
    given = inside & jnp.isfinite(known)
    p = power_for(shading, order)
    quadratic = order == 2 and shading.is_quadratic()
    top = jnp.where(inside, shading.lift(jnp.where(given, known, shading.deadline()), p), _HUGE)
    top = jnp.minimum(top, _HUGE)
    v = jnp.where(jnp.isfinite(top), top, _HUGE)
    g = inverse_metric
    frame = _Frame(g[..., 0, 0], g[..., 0, 1], g[..., 1, 1], v, inside & ~given)
    frames = (frame, frame.transposed())
    extent = (v.shape[0] + v.shape[1]) / jnp.sqrt(jnp.max(jnp.where(inside, frame.g11, 0)))

    def one_round(v, owner, second, frozen):
        for axis in (0, 1):
            f = frames[axis]
            vt, ot = (x if axis == 0 else x.T for x in (v, owner))
            for forward in (True, False):
                # a quadratic equation does not change: XLA computes it once
                balance = shading.quadratic_balance() if quadratic else shading.balance(vt if axis == 0 else vt.T, p)
                bt = balance if axis == 0 else jax.tree.map(jnp.transpose, balance)
                vt, ot = _directional_sweep(
                    vt, ot, bt, f, jnp.asarray(forward), jnp.int8(2 * axis + forward), second, frozen
                )
            v, owner = (vt, ot) if axis == 0 else (vt.T, ot.T)
        return v, owner

    def proceed(state):
        _, _, rounds, change, settled_at = state
        return (rounds < max_rounds) & ~((change < tolerance) & (rounds > settled_at) & (rounds >= order))

    def body(state):
        v, owner, rounds, _, settled_at = state
        # one round of first order says where things come from; which pixel follows which may be mended while the
        # solution settles and once more: at a kink it would change for ever
        second = (order == 2) & (rounds > 0)
        new, owner = one_round(v, owner, second, second & (rounds > settled_at + 1))
        change = jnp.mean(jnp.abs(new - v) / jnp.maximum(jnp.abs(new), extent), where=inside)
        return new, owner, rounds + 1, change, jnp.where(change < _SETTLED, jnp.minimum(settled_at, rounds), settled_at)

    settled = jnp.int32(-1 if order == 1 else max_rounds)
    start = (v, jnp.full(v.shape, -1, jnp.int8), jnp.int32(0), jnp.asarray(jnp.inf, v.dtype), settled)
    v, _, rounds, change, _ = jax.lax.while_loop(proceed, body, start)
    reached = inside & (v < 0.5 * _HUGE)
    return Sweeps(shading.lower(jnp.where(reached, v, 1), p), reached, rounds, change)


def power_for(shading: AbstractShading, order: int) -> Scalar:
    """The power p of `lift` that the sweeps solve in."""
    # Second order: the power that makes the equation quadratic. First order: p = −1, v = −1/r, in which surfaces
    # bend least and one-sided differences err least (a plane's 1/r is linear in the ray).
    return -1.0 if order == 1 and shading.is_quadratic() else shading.natural_power()


def _directional_sweep(v, owner, balance: Balance, frame: _Frame, forward, direction, second, frozen):
    """One sweep down (`forward`) or up the rows. `direction` owns the pixels whose value it set: they follow
    their upwind neighbours up as well as down, which second order needs."""
    height, width = v.shape
    padded = jnp.pad(v, _PAD, constant_values=_HUGE)

    def row(n, padded):
        i = jnp.where(forward, n, height - 1 - n)

        def neighbour(back, shift):
            return jax.lax.dynamic_slice(
                padded, (i + _PAD - jnp.where(forward, back, -back), _PAD + shift), (1, width)
            )[0]

        def at(x):
            return jax.lax.dynamic_slice(x, (i, 0), (1, width))[0]

        old = neighbour(0, 0)
        g11, g12, g22 = at(frame.g11), jnp.where(forward, 1, -1).astype(v.dtype) * at(frame.g12), at(frame.g22)
        candidate = _row_update(neighbour, g11, g12, g22, jax.tree.map(at, balance), second)
        mine = at(owner) == direction
        better = (candidate < old) & ~frozen
        new = jnp.where(at(frame.free) & (better | mine), jnp.minimum(candidate, at(frame.top)), old)
        return jax.lax.dynamic_update_slice(padded, new[None], (i + _PAD, _PAD))

    new = jax.lax.fori_loop(0, height, row, padded)[_PAD:-_PAD, _PAD:-_PAD]
    return new, jnp.where(new < v, direction, owner)


def _row_update(neighbour, g11, g12, g22, balance: Balance, second):
    """The smallest v that the row before offers, from two triangles and three edges.

    What `implicit._stencil` says edge by edge and triangle by triangle, in x = v − v(y) and D = a x − b, so that
    nothing is divided before the root is: half the time. Where v(y) is no data the root is NaN, which is less than
    nothing.
    """
    determinant = g11 * g22 - g12 * g12
    here, m1 = neighbour(0, 0), neighbour(1, 0)
    a1, b1 = _difference(here, m1, neighbour(2, 0), second)
    room = balance.constant - m1 * (balance.square * m1 + balance.linear)
    pull = balance.square * m1 + 0.5 * balance.linear
    best = _lower_edge(jnp.full_like(m1, _HUGE), m1, a1, b1, determinant, g11, balance)
    for side in (-1, 1):
        m2 = neighbour(1, side)
        a2, b2 = _difference(here, m2, neighbour(2, 2 * side), second)
        # g in the basis e₁ = (0, −1), e₂ = (side, −1)
        h12 = -side * g12 - g11
        h11 = g22 + 2 * side * g12 + g11
        best = _lower_edge(best, m2, a2, b2, determinant, h11, balance)
        c2 = b2 + a2 * (m2 - m1)  # D₂ = a₂ x − c₂, D₁ = a₁ x − b₁; u x − w: their products with h
        u1, w1 = h11 * a1 + h12 * a2, h11 * b1 + h12 * c2
        u2, w2 = h12 * a1 + g11 * a2, h12 * b1 + g11 * c2
        quad, half = u1 * a1 + u2 * a2 + balance.square, w1 * a1 + w2 * a2 - pull
        x = (half + jnp.sqrt(half * half - quad * (w1 * b1 + w2 * c2 - room))) / quad
        between = (u1 * x >= w1) & (u2 * x >= w2) & (a1 * x >= b1) & (a2 * x >= c2)
        best = jnp.where(between & (m1 + x < best), m1 + x, best)
    return best


def _difference(here, near, far, second):
    """(a, b) of the difference a (v − near) − b towards a neighbour: a parabola through it and the one beyond, less of
    it where their values bend."""
    fall, before = here - near, near - far
    ratio = before / fall
    share = jnp.where(second & (fall > 0), 0.5 * jnp.clip(jnp.minimum(4 * ratio - 1, (4 - ratio) / 2), 0, 1), 0)
    return 1 + share, share * before


def _lower_edge(best, m, a, b, determinant, h, balance: Balance):
    """`best`, or v with (determinant/h) D² + square·v² + linear·v = constant, D = a (v − m) − b, where that is less."""
    scaled = determinant * a
    quad, half = scaled * a + h * balance.square, scaled * b - h * (balance.square * m + 0.5 * balance.linear)
    rest = determinant * b * b - h * (balance.constant - m * (balance.square * m + balance.linear))
    v = m + (half + jnp.sqrt(half * half - quad * rest)) / quad
    return jnp.where((v >= m) & (v < best), v, best)
