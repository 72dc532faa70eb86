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
import numpy as np
from jaxtyping import Array, Bool, Float, Int, UInt8

from jaxsfs.forms import Scalar
from jaxsfs.shading import AbstractShading, Balance

Image = Float[Array, "height width"]
Mask = Bool[Array, "height width"]

_PAD = 2  # rows and columns beyond the image that second order reads
_HUGE = 1e30  # v where there is no data: never upwind of anything
_SETTLED = 1e-2  # mean relative change of a first-order round after which second order begins
# Parts of the rise of v over a pixel: offers that differ by less make several owners of one pixel; a direction that
# owns nothing must offer so much less.
_TIE, _TAKE_OVER = 0.1, 0.25


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

    def balances(v):
        """The equation at `v`, for sweeps over rows and over columns."""
        balance = shading.quadratic_balance() if quadratic else shading.balance(v, p)
        return balance, jax.tree.map(jnp.transpose, balance)

    held = balances(v) if quadratic else None

    def one_round(v, owners, second):
        for axis in (0, 1):
            for backward in (False, True):
                vt, own = jax.tree.map(jnp.transpose, (v, owners)) if axis else (v, owners)
                balance, bit = (held or balances(v))[axis], np.uint8(1 << (2 * axis + backward))
                new = _directional_sweep(vt, own, balance, frames[axis], not backward, bit, second)
                if own is not None and not second:
                    own = _Owners(jnp.where(new < vt, bit << 4, own.bits), own.margin)
                v, owners = jax.tree.map(jnp.transpose, (new, own)) if axis else (new, own)
        return v, owners

    def until(limit, second, v, owners, before):
        def proceed(state):
            _, _, rounds, change = state
            return (rounds < max_rounds) & ~(change < limit)

        def body(state):
            v, owners, rounds, _ = state
            new, owners = one_round(v, owners, second)
            change = jnp.mean(jnp.abs(new - v) / jnp.maximum(jnp.abs(new), extent), where=inside)
            return new, owners, rounds + 1, change

        state = jax.lax.while_loop(proceed, body, (v, owners, before, jnp.asarray(jnp.inf, v.dtype)))
        return state[0], *state[2:]

    # a linearised equation offers too little at first: a pixel must follow whoever lowered it last up again
    last = None if quadratic else _Owners(jnp.zeros(v.shape, jnp.uint8), jnp.zeros_like(v))
    # second order starts once the first-order solution knows where everything comes from
    v, rounds, change = until(tolerance if order == 1 else _SETTLED, False, v, last, jnp.int32(0))
    if order == 2:
        v, rounds, change = until(tolerance, True, v, _owners(v, held or balances(v), frames), rounds)
    reached = inside & (v < 0.5 * _HUGE)
    return Sweeps(shading.lower(jnp.where(reached, v, 1), p), reached, rounds, change)


def power_for(shading: AbstractShading, order: int) -> Scalar:
    """The power p of `lift` that the sweeps solve in."""
    # Second order: the power that makes the equation quadratic. First order: p = −1, v = −1/r, in which surfaces
    # bend least and one-sided differences err least (a plane's 1/r is linear in the ray).
    return -1.0 if order == 1 and shading.is_quadratic() else shading.natural_power()


class _Owners(eqx.Module):
    """From which directions each pixel is reached, as bits in the order of the sweeps; the first owner, whose offer is
    least, also four bits higher. `margin`: how much less a direction that owns nothing must offer."""

    bits: UInt8[Array, "height width"]
    margin: Image


def _directional_sweep(v, owners: _Owners | None, balance: Balance, frame: _Frame, forward: bool, bit, second: bool):
    """One sweep down (`forward`) or up the rows.

    Without owners it only lowers. In second order values follow their upwind neighbours up as well as down: a pixel's
    first owner sets it anew in every round, its other owners lower it. If the least always won, values made of old and
    new neighbours would stay, and the rounds not come to an end.
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

        old = neighbour(0, 0)
        g11, g12, g22 = at(frame.g11), sign * at(frame.g12), at(frame.g22)
        candidate = _row_update(neighbour, g11, g12, g22, jax.tree.map(at, balance), second)
        better = candidate < old
        if owners is not None:
            bits = at(owners.bits)
            better &= ((bits & bit) != 0) | (candidate < old - at(owners.margin))
            better |= (bits & (bit << 4)) != 0
        new = jnp.where(at(frame.free) & better, jnp.minimum(candidate, at(frame.top)), old)
        return jax.lax.dynamic_update_slice(padded, new, (i + _PAD, _PAD))

    return jax.lax.fori_loop(0, height, row, padded)[_PAD:-_PAD, _PAD:-_PAD]


def _owners(v, balances, frames) -> _Owners:
    """Who owns each pixel, by the first-order offers at the first-order solution."""
    offers, rows = [], None
    for axis in (0, 1):
        frame, vt = frames[axis], v.T if axis else v
        padded = jnp.pad(vt, _PAD, constant_values=_HUGE)
        for sign in (1, -1):

            def neighbour(back, shift, padded=padded, shape=vt.shape, sign=sign):
                begin = _PAD - sign * back, _PAD + shift
                return jax.lax.slice(padded, begin, (begin[0] + shape[0], begin[1] + shape[1]))

            offer = _row_update(neighbour, frame.g11, sign * frame.g12, frame.g22, balances[axis], False)
            offers.append(offer.T if axis else offer)
            before = jnp.minimum(neighbour(1, 0), jnp.minimum(neighbour(1, -1), neighbour(1, 1)))
            before = before.T if axis else before
            rows = before if rows is None else jnp.minimum(rows, before)
    least = jnp.minimum(jnp.minimum(offers[0], offers[1]), jnp.minimum(offers[2], offers[3]))
    rise = jnp.maximum(least - rows, 0)
    bits = jnp.zeros(v.shape, jnp.uint8)
    for n, offer in enumerate(offers):
        owns = (offer <= least + _TIE * rise) & (offer < 0.5 * _HUGE)
        bits |= jnp.where(owns, np.uint8(1 << n), np.uint8(0))
        bits |= jnp.where(owns & (offer == least) & (bits < 16), np.uint8(16 << n), np.uint8(0))
    return _Owners(bits, _TAKE_OVER * rise)


def _row_update(neighbour, g11, g12, g22, balance: Balance, second: bool):
    """The smallest v that the row before offers, from two triangles and three edges.

    What `_from_edge` and `_from_triangle` say one by one, in x = v − v(y) and D = a x − b, so that nothing is divided
    before the root is: half the time of those. Where v(y) is no data the root is NaN, which is less than nothing.
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


def _difference(here, near, far, second: bool):
    """(a, b) of the difference a (v − near) − b: `_one_sided` for rows whose order is known when compiled."""
    if not second:
        return 1.0, 0.0
    fall, before = here - near, near - far
    ratio = before / fall
    share = jnp.where(fall > 0, 0.5 * jnp.clip(jnp.minimum(4 * ratio - 1, (4 - ratio) / 2), 0, 1), 0)
    return 1 + share, share * before


def _lower_edge(best, m, a, b, determinant, h, balance: Balance):
    """`best`, or v with (determinant/h) D² + square·v² + linear·v = constant, D = a (v − m) − b, where that is less."""
    scaled = determinant * a
    quad, half = scaled * a + h * balance.square, scaled * b - h * (balance.square * m + 0.5 * balance.linear)
    rest = determinant * b * b - h * (balance.constant - m * (balance.square * m + balance.linear))
    v = m + (half + jnp.sqrt(half * half - quad * rest)) / quad
    return jnp.where((v >= m) & (v < best), v, best)


def _one_sided(neighbour, shift, second):
    """(a, m, v(y)) of the difference a (v − m) towards the neighbour y."""
    here, near, far = neighbour(0, 0), neighbour(1, shift), neighbour(2, 2 * shift)
    fall, before = here - near, near - far
    ratio = before / jnp.where(fall > 0, fall, 1)
    share = jnp.clip(jnp.minimum(4 * ratio - 1, (4 - ratio) / 2), 0, 1)
    share = jnp.where(second & (far < 0.5 * _HUGE) & (fall > 0), share, 0)
    a = 1 + 0.5 * share
    return a, near + 0.5 * share * before / a, near


def _from_edge(difference, q, balance):
    """q a² (v − m)² + b v² = p: the front comes along the edge."""
    a, m, near = difference
    m = jnp.where(near < 0.5 * _HUGE, m, 0)
    x = _larger_root(q * a * a, 0.0, 0.0, m, balance)
    return jnp.where((near < 0.5 * _HUGE) & (x >= 0), m + x, _HUGE)


def _from_triangle(straight, diagonal, h11, h12, h22, balance):
    """h^{kl} D_k D_l + b v² = p, D_k = a_k (v − m_k); only if the front comes between the two edges."""
    (a1, m1, near1), (a2, m2, near2) = straight, diagonal
    known = (near1 < 0.5 * _HUGE) & (near2 < 0.5 * _HUGE)
    m1, m2 = jnp.where(known, m1, 0), jnp.where(known, m2, 0)
    c11, c12, c22 = h11 * a1 * a1, h12 * a1 * a2, h22 * a2 * a2
    gap = m2 - m1
    x = _larger_root(c11 + 2 * c12 + c22, (c12 + c22) * gap, c22 * gap * gap, m1, balance)
    d1, d2 = a1 * x, a2 * (x - gap)
    between = (h11 * d1 + h12 * d2 >= 0) & (h12 * d1 + h22 * d2 >= 0) & (d1 >= 0) & (d2 >= 0)
    return jnp.where(known & between, m1 + x, _HUGE)


def _larger_root(quad, half, rest, m, balance: Balance):
    """x with quad·x² − 2·half·x + rest + square·(m + x)² + linear·(m + x) = constant; NaN where there is none."""
    quad = quad + balance.square
    half = half - balance.square * m - 0.5 * balance.linear
    rest = rest + balance.square * m * m + balance.linear * m - balance.constant
    return (half + jnp.sqrt(half * half - quad * rest)) / quad
