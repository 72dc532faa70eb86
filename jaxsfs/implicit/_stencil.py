"""Which pixels each value of a static solution came from, and the equation that it obeys there."""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int8

from jaxsfs.forms import Scalar
from jaxsfs.shading import AbstractShading, Balance
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


def find_stencil(
    v: Image, owner: Int8[Array, "height width"], shading: AbstractShading, metric, p: Scalar, free: Mask, second: bool
) -> Stencil:
    """The stencil whose update in the sweep `owner` gives each value of `v`; none where not `free`."""
    balance = shading.balance(v, p)
    padded = jnp.pad(v, PAD, constant_values=HUGE)

    def compare(direction, best):
        gap, kind = best
        mine = owner == direction.astype(jnp.int8)
        for k, offer in enumerate(_offers(padded, v.shape, metric, balance, direction, second)):
            closer = mine & (jnp.abs(offer - v) < gap)
            gap, kind = jnp.where(closer, jnp.abs(offer - v), gap), jnp.where(closer, jnp.int8(k), kind)
        return gap, kind

    start = jnp.full(v.shape, jnp.inf, v.dtype), jnp.zeros(v.shape, jnp.int8)
    gap, kind = jax.lax.fori_loop(0, len(STEPS), compare, start)
    found = free & (gap < 0.1 * HUGE)
    side, straight, diagonal = (jnp.asarray(column)[kind] for column in zip(*_KINDS, strict=True))
    direction = jnp.where(found, owner, jnp.int8(NO_DIRECTION))
    return Stencil(direction, side.astype(jnp.int8), found & straight, found & diagonal)


# side, whether the straight edge is used, whether the diagonal one is
_KINDS = ((-1, True, False), (-1, False, True), (-1, True, True), (1, False, True), (1, True, True))


def _offers(padded, shape, metric, balance, direction, second: bool) -> list[Image]:
    """What the sweep in `direction` offers to every pixel, for each of `_KINDS`."""
    g11, g12, g22 = _frame(metric, direction)
    determinant = g11 * g22 - g12 * g12

    def neighbour(back, shift):
        along = jnp.where(direction % 2 == 1, -back, back)
        offset = jnp.where(direction < 2, jnp.stack([along, shift]), jnp.stack([shift, along]))
        return jax.lax.dynamic_slice(padded, offset + PAD, shape)

    straight = _one_sided(neighbour, 0, second)
    offers = [_from_edge(straight, determinant / g11, balance)]
    for side in (-1, 1):
        diagonal = _one_sided(neighbour, side, second)
        h11, h12 = _oblique(g11, g12, g22, side)
        offers.append(_from_edge(diagonal, determinant / h11, balance))
        offers.append(_from_triangle(straight, diagonal, h11, h12, g11, balance))
    return offers


def upwind_values(v: Image, stencil: Stencil, fill: float) -> Upwind:
    """The values that each pixel's stencil reads; `fill` beyond the image and where there is no stencil."""
    padded = jnp.pad(v, PAD, constant_values=fill)
    straight = [jnp.full_like(v, fill)] * 2
    diagonal = [jnp.full_like(v, fill)] * 2
    for direction in range(len(STEPS)):
        mine = stencil.direction == direction
        for reach in (1, 2):
            value = _at(padded, _offset(direction, reach, 0), v.shape)
            straight[reach - 1] = jnp.where(mine, value, straight[reach - 1])
            for side in (-1, 1):
                value = _at(padded, _offset(direction, reach, reach * side), v.shape)
                diagonal[reach - 1] = jnp.where(mine & (stencil.side == side), value, diagonal[reach - 1])
    return Upwind(straight[0], straight[1], diagonal[0], diagonal[1])


def misfit(
    v: Image, upwind: Upwind, stencil: Stencil, shading: AbstractShading, metric, p: Scalar, second: bool
) -> Image:
    """F = Σ h^{kl} D_k D_l + square·v² + linear·v − constant over each pixel's stencil, 0 at the solution."""
    h11, h12, h22 = _weights(metric, stencil)
    d1 = _difference(v, upwind.straight_near, upwind.straight_far, stencil.straight, second)
    d2 = _difference(v, upwind.diagonal_near, upwind.diagonal_far, stencil.diagonal, second)
    balance = shading.balance(v, p)
    steepness = h11 * d1 * d1 + 2 * h12 * d1 * d2 + h22 * d2 * d2
    return steepness - balance.left(v)


def _difference(v: Image, near: Image, far: Image, used: Mask, second: bool) -> Image:
    """a (v − m) along one edge; what is not used has values that no derivative stumbles over."""
    near = jnp.where(used, near, v - 1)
    far = jnp.where(used & (far < 0.5 * HUGE), far, near)
    a, m, _ = _one_sided(lambda back, shift: (v, near, far)[back], 0, second)
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


def _one_sided(neighbour, shift, second):
    """(a, m, v(y)) of the difference a (v − m) towards the neighbour y."""
    here, near, far = neighbour(0, 0), neighbour(1, shift), neighbour(2, 2 * shift)
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
