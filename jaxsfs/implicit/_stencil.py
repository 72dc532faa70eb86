"""Which pixels each value of a static solution came from, and the equation that it obeys there."""

import functools
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int8

from jaxsfs._once import once
from jaxsfs.shading import AbstractShading, Balance
from jaxsfs.sweeping import balance_for
from jaxsfs.updates import HUGE, PAD

Image = Float[Array, "height width"]
Mask = Bool[Array, "height width"]

# (rows, columns) to the row that a sweep reads, by the sweep's direction (see `sweeping.sweep`)
STEPS = ((1, 0), (-1, 0), (0, 1), (0, -1))
NO_DIRECTION = -1


class Stencil(eqx.Module):
    """`direction` of the sweep that set a pixel (−1: its value is given), `side` (−1, 1) of the diagonal neighbour, and
    which of the two edges are `straight` and `diagonal` used: both make a triangle."""

    direction: Int8[Array, "height width"]
    side: Int8[Array, "height width"]
    straight: Mask
    diagonal: Mask

    @property
    def active(self) -> Mask:
        """Pixels whose value came from others."""
        return self.direction != NO_DIRECTION


class Upwind(eqx.Module):
    """Values one (`near`) and two (`far`) pixels along the straight and the diagonal edge of each pixel's stencil."""

    straight_near: Image
    straight_far: Image
    diagonal_near: Image
    diagonal_far: Image


class _Neighbours(NamedTuple):
    """Values one and two pixels upstream of each pixel: straight, to the left and to the right."""

    straight: tuple[Image, Image]
    left: tuple[Image, Image]
    right: tuple[Image, Image]


def find_stencil(
    v: Image, owner: Int8[Array, "height width"], shading: AbstractShading, metric, free: Mask, order: int, never
) -> tuple[Stencil, Upwind]:
    """The stencil whose update in the sweep `owner` gives each value of `v`, and what it reads; none where not `free`.
    `never`: see `once`."""
    neighbours = once(_neighbours(v, owner, HUGE), never)
    offers = once(_offers(v, neighbours, metric, balance_for(shading, v, order), owner, order == 2), never)
    gaps = [jnp.abs(offer - v) for offer in offers]
    gap = functools.reduce(jnp.minimum, gaps)
    kind = jnp.zeros(v.shape, jnp.int8)
    for k in reversed(range(len(gaps))):
        kind = jnp.where(gaps[k] == gap, jnp.int8(k), kind)
    gap, kind = once((gap, kind), never)
    found = free & (gap < 0.1 * HUGE) & (owner != NO_DIRECTION)
    side, straight, diagonal = (_listed(column, kind) for column in zip(*_KINDS, strict=True))
    direction = jnp.where(found, owner, jnp.int8(NO_DIRECTION))
    stencil = Stencil(direction, side.astype(jnp.int8), found & straight, found & diagonal)
    return stencil, _chosen(neighbours, stencil, HUGE)


def _listed(column: tuple, kind: Int8[Array, "height width"]) -> Array:
    """column[kind], without a gather."""
    listed = jnp.full(kind.shape, column[0])
    for k, value in enumerate(column):
        listed = listed if value == column[0] else jnp.where(kind == k, value, listed)
    return listed


# side, whether the straight edge is used, whether the diagonal one is
_KINDS = ((-1, True, False), (-1, False, True), (-1, True, True), (1, False, True), (1, True, True))


def _offers(v, neighbours: _Neighbours, metric, balance, direction, second: bool) -> list[Image]:
    """What the sweep in each pixel's `direction` offers it, for each of `_KINDS`."""
    g11, g12, g22 = _frame(metric, direction)
    determinant = g11 * g22 - g12 * g12
    straight = _one_sided(v, *neighbours.straight, second)
    offers = [_from_edge(straight, determinant / g11, balance)]
    for side, values in ((-1, neighbours.left), (1, neighbours.right)):
        diagonal = _one_sided(v, *values, second)
        h11, h12 = _oblique(g11, g12, g22, side)
        offers.append(_from_edge(diagonal, determinant / h11, balance))
        offers.append(_from_triangle(straight, diagonal, h11, h12, g11, balance))
    return offers


def upwind_values(v: Image, stencil: Stencil, fill: float) -> Upwind:
    """The values that each pixel's stencil reads; `fill` beyond the image and where there is no stencil."""
    return _chosen(_neighbours(v, stencil.direction, fill), stencil, fill)


def _chosen(neighbours: _Neighbours, stencil: Stencil, fill: float) -> Upwind:
    """Of both diagonals the one on the stencil's side."""
    left, active = stencil.side < 0, stencil.active
    diagonal = [jnp.where(left, *pair) for pair in zip(neighbours.left, neighbours.right, strict=True)]
    return Upwind(*(jnp.where(active, x, fill) for x in (*neighbours.straight, *diagonal)))


def _neighbours(v: Image, direction: Int8[Array, "height width"], fill: float) -> _Neighbours:
    """As each pixel's sweep sees them; `fill` beyond the image."""
    padded = jnp.pad(v, PAD, constant_values=fill)

    def selected(back: int, shift: int) -> Image:
        below, above, right, left = (_at(padded, _offset(n, back, shift), v.shape) for n in range(len(STEPS)))
        return jnp.where(direction < 2, jnp.where(direction == 1, above, below), jnp.where(direction == 3, left, right))

    return _Neighbours(*((selected(1, side), selected(2, 2 * side)) for side in (0, -1, 1)))


class Differences(NamedTuple):
    """D₁, D₂ along the straight and the diagonal edge, each with its derivatives by v, the near and the far value."""

    straight: tuple[Image, Image, Image, Image]
    diagonal: tuple[Image, Image, Image, Image]


def differences(v: Image, upwind: Upwind, stencil: Stencil, order: int) -> Differences:
    """The one-sided differences a (v − m) of each pixel's stencil; 0 along an edge that is not used."""

    def along(near, far, used):
        def difference(v, near, far):
            return _difference(v, near, far, used, order == 2)

        one, none = jnp.ones_like(v), jnp.zeros_like(v)
        by = [jax.jvp(difference, (v, near, far), tuple(one if k == n else none for k in range(3))) for n in range(3)]
        return by[0][0], *(tangent for _, tangent in by)

    return Differences(
        along(upwind.straight_near, upwind.straight_far, stencil.straight),
        along(upwind.diagonal_near, upwind.diagonal_far, stencil.diagonal),
    )


def misfit(v: Image, d: Differences, stencil: Stencil, shading: AbstractShading, metric, order: int) -> Image:
    """F = Σ h^{kl} D_k D_l + square·v² + linear·v − constant over each pixel's stencil, 0 at the solution."""
    (h11, h12, h22), d1, d2 = _weights(metric, stencil), d.straight[0], d.diagonal[0]
    steepness = h11 * (d1 * d1) + h12 * (2 * d1 * d2) + h22 * (d2 * d2)
    return steepness - balance_for(shading, v, order).left(v)


def misfit_slopes(
    v: Image, d: Differences, stencil: Stencil, shading: AbstractShading, metric, order: int
) -> tuple[Image, Upwind]:
    """∂F/∂v and ∂F by the values that the stencil reads."""
    (h11, h12, h22), d1, d2 = _weights(metric, stencil), d.straight[0], d.diagonal[0]
    first, second = 2 * (h11 * d1 + h12 * d2), 2 * (h12 * d1 + h22 * d2)
    _, left = jax.jvp(lambda v: balance_for(shading, v, order).left(v), (v,), (jnp.ones_like(v),))
    by_straight, by_diagonal = ([push * x for x in d[1:]] for push, d in ((first, d.straight), (second, d.diagonal)))
    return by_straight[0] + by_diagonal[0] - left, Upwind(*by_straight[1:], *by_diagonal[1:])


def _difference(v: Image, near: Image, far: Image, used: Mask, second: bool) -> Image:
    """a (v − m) along one edge; what is not used has values that no derivative stumbles over."""
    near = jnp.where(used, near, v - 1)
    far = jnp.where(used & (far < 0.5 * HUGE), far, near)
    a, m, _ = _one_sided(v, near, far, second)
    return jnp.where(used, a * (v - m), 0)


def _weights(metric, stencil: Stencil) -> tuple[Image, Image, Image]:
    """h^{kl} in the basis of the stencil's edges; an edge alone counts with what is normal to the other one."""
    g11, g12, g22 = _frame(metric, stencil.direction)
    determinant = g11 * g22 - g12 * g12
    h11, h12 = _oblique(g11, g12, g22, stencil.side.astype(g11.dtype))
    both = stencil.straight & stencil.diagonal
    return (
        jnp.where(both, h11, determinant / g11),
        jnp.where(both, h12, 0),
        jnp.where(both, g11, determinant / h11),
    )


def _frame(metric, direction) -> tuple[Image, Image, Image]:
    """(g across the sweep, mixed, along it) as the sweep in `direction` (per image, or per pixel) sees it."""
    g11, g12, g22 = metric[..., 0, 0], metric[..., 0, 1], metric[..., 1, 1]
    return (
        jnp.where(direction < 2, g11, g22),
        jnp.where(direction % 2 == 1, g12, -g12),
        jnp.where(direction < 2, g22, g11),
    )


def _oblique(g11, g12, g22, side):
    """h^{11}, h^{12} in the basis e₁ = (0, −1), e₂ = (side, −1)."""
    return g22 + 2 * side * g12 + g11, -side * g12 - g11


def _offset(direction: int, back: int, shift: int) -> tuple[int, int]:
    """(rows, columns) of the neighbour `back` rows upstream and `shift` to the side."""
    down, right = STEPS[direction]
    return (down * back, shift) if direction < 2 else (shift, right * back)


def _at(padded: Float[Array, "high wide"], offset: tuple[int, int], shape: tuple[int, ...]) -> Image:
    return jax.lax.slice(
        padded,
        (PAD + offset[0], PAD + offset[1]),
        (PAD + offset[0] + shape[0], PAD + offset[1] + shape[1]),
    )


def _one_sided(here, near, far, second):
    """(a, m, v(y)) of the difference a (v − m) towards the neighbour y, `near`, and the one beyond."""
    fall, before = here - near, near - far
    ratio = before / jnp.where(fall > 0, fall, 1)
    share = jnp.clip(jnp.minimum(4 * ratio - 1, (4 - ratio) / 2), 0, 1)
    share = jnp.where(second & (far < 0.5 * HUGE) & (fall > 0), share, 0)
    a = 1 + 0.5 * share
    return a, near + 0.5 * share * before / a, near


def _from_edge(difference, q, balance):
    """q a² (v − m)² + b v² = p: the front comes along the edge."""
    a, m, near = difference
    m = jnp.where(near < 0.5 * HUGE, m, 0)
    x = _larger_root(q * a * a, 0.0, 0.0, m, balance)
    return jnp.where((near < 0.5 * HUGE) & (x >= 0), m + x, HUGE)


def _from_triangle(straight, diagonal, h11, h12, h22, balance):
    """h^{kl} D_k D_l + b v² = p, D_k = a_k (v − m_k); only if the front comes between the two edges."""
    (a1, m1, near1), (a2, m2, near2) = straight, diagonal
    known = (near1 < 0.5 * HUGE) & (near2 < 0.5 * HUGE)
    m1, m2 = jnp.where(known, m1, 0), jnp.where(known, m2, 0)
    c11, c12, c22 = h11 * a1 * a1, h12 * a1 * a2, h22 * a2 * a2
    gap = m2 - m1
    x = _larger_root(c11 + 2 * c12 + c22, (c12 + c22) * gap, c22 * gap * gap, m1, balance)
    d1, d2 = a1 * x, a2 * (x - gap)
    between = (h11 * d1 + h12 * d2 >= 0) & (h12 * d1 + h22 * d2 >= 0) & (d1 >= 0) & (d2 >= 0)
    return jnp.where(known & between, m1 + x, HUGE)


def _larger_root(quad, half, rest, m, balance: Balance):
    """x with quad·x² − 2·half·x + rest + square·(m + x)² + linear·(m + x) = constant; NaN where there is none."""
    quad = quad + balance.square
    half, rest = half - balance.slope(m), rest - balance.left(m)
    return (half + jnp.sqrt(half * half - quad * rest)) / quad
