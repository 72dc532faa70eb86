"""What the pixels before a pixel offer it.

The update at a pixel x with neighbours y₁ (straight) and y₂ (diagonal) takes one-sided differences
D_k = a_k (v − m_k) along both edges and solves Σ h^{kl} D_k D_l + B v² = P, h^{kl} the inverse metric in the basis
of the edges. First order: a = 1, m = v(y). Second order: a = 3/2, m = (4 v(y) − v(y'))/3 with y' one step further,
where v still falls there.
"""

from collections.abc import Callable

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int8

from jaxsfs.shading import Balance

Image = Float[Array, "height width"]
Owners = Int8[Array, "height width"]

# The equation's right-hand side at v; with columns for rows where the second argument is 1.
BalanceOf = Callable[[Image, int], Balance]

PAD = 2  # rows and columns beyond the image that second order reads
HUGE = 1e30  # v where there is no data: never upwind of anything


class Frame(eqx.Module):
    """What does not change from round to round: inverse metric, deadline of v, pixels to solve for."""

    g11: Image
    g12: Image
    g22: Image
    top: Image
    free: Bool[Array, "height width"]

    def transposed(self) -> "Frame":
        """With rows for columns."""
        return Frame(self.g22.T, self.g12.T, self.g11.T, self.top.T, self.free.T)


def taken(candidate, old, mine, free, top, frozen):
    """v after an offer: pixels take what is less (unless they are `frozen`) and follow the direction that owns them
    (`mine`) up as well as down, which second order needs."""
    better = (candidate < old) & ~frozen
    return jnp.where(free & (better | mine), jnp.minimum(candidate, top), old)


def offered(neighbour, g11, g12, g22, balance: Balance, second):
    """The smallest v that the row before offers, from the triangle that the front comes through and its two edges.

    `neighbour(back, shift)`: v of as many pixels `back` rows before and `shift` columns to the right; `g11`, `g12`,
    `g22`: inverse metric, 1 along the rows, 2 the way that they are asked; `second`: second-order differences.

    What `implicit._stencil` says edge by edge and triangle by triangle, in x = v − v(y) and D = a x − b, so that
    nothing is divided before the root is, and of both triangles only the one on the side from which the slope of the
    row before says that the front comes. Where v(y) is no data the root is NaN, which is less than nothing.
    """
    determinant = g11 * g22 - g12 * g12
    here, m1, left, right = neighbour(0, 0), neighbour(1, 0), neighbour(1, -1), neighbour(1, 1)
    room, pull = balance.left(m1), balance.slope(m1)
    # a front that travels straight on has g₁₁ ∂₁v + g₁₂ ∂₂v = 0; with less ∂₁v it comes from the right
    straight = -2 * g12 * jnp.sqrt(jnp.maximum(room, 0) / (g11 * determinant))
    from_right = right - left < straight
    side = jnp.where(from_right, 1, -1).astype(m1.dtype)
    m2 = jnp.where(from_right, right, left)
    a1, b1 = _difference(here, m1, neighbour(2, 0), second)
    a2, b2 = _difference(here, m2, jnp.where(from_right, neighbour(2, 2), neighbour(2, -2)), second)
    g12 = side * g12
    best = _lower_edge(jnp.full_like(m1, HUGE), m1, a1, b1, determinant, g11, balance)
    best = _lower_edge(best, m2, a2, b2, determinant, g11 + 2 * g12 + g22, balance)
    # in x = v − m₁: p = a₁ x − b₁ is v's rise from the row before, q = a x − b that towards the side
    a, b = a1 - a2, b1 - b2 - a2 * (m2 - m1)
    quad = a1 * (g22 * a1 + 2 * g12 * a) + g11 * a * a + balance.square
    half = b1 * (g22 * a1 + g12 * a) + b * (g12 * a1 + g11 * a) - pull
    rest = b1 * (g22 * b1 + 2 * g12 * b) + g11 * b * b - room
    x = (half + jnp.sqrt(half * half - quad * rest)) / quad
    p, q = a1 * x - b1, a * x - b
    aside = g12 * p + g11 * q  # of the front's course; it comes from between both neighbours
    between = (aside <= 0) & (g22 * p + g12 * q + aside >= 0) & (p >= 0) & (p >= q)
    return jnp.where(between & (m1 + x < best), m1 + x, best)


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
    quad, half = scaled * a + h * balance.square, scaled * b - h * balance.slope(m)
    rest = determinant * b * b - h * balance.left(m)
    v = m + (half + jnp.sqrt(half * half - quad * rest)) / quad
    return jnp.where((v >= m) & (v < best), v, best)
