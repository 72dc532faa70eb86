"""Upwind differences for a metric: Selling's decomposition g^{ij} = Σ_k λ_k e_k e_kᵀ, λ_k ≥ 0, integer e_k.

With it |∇φ|²_g = Σ_k λ_k (e_k·∇φ)², a sum of squares of differences between pixels, so that a monotone scheme for
each direction is a monotone scheme for the metric. Source: Mirebeau 2014 (Selling 1874).
"""

import itertools
import math

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

Offset = tuple[int, int]

# Offsets (du, dv), one of each ± pair, in rings of growing reach. A ring is needed once the anisotropy (square root
# of the eigenvalue ratio of g; 1/cos α for the spherical camera) passes 2.41, 4.23 and 6.16; the last one reaches
# 8.08 (α = 82.9°).
_RINGS: tuple[tuple[Offset, ...], ...] = (
    ((1, 0), (0, 1), (1, 1), (1, -1)),
    ((2, 1), (2, -1), (1, 2), (1, -2)),
    ((3, 1), (3, -1), (1, 3), (1, -3)),
    ((4, 1), (4, -1), (1, 4), (1, -4), (3, 2), (3, -2), (2, 3), (2, -3)),
)


def offsets_for(
    inverse_metric: Float[Array, "height width 2 2"], mask: Bool[Array, "height width"]
) -> tuple[Offset, ...]:
    """The smallest of the offset lists that carries `inverse_metric` over `mask`; the widest one if none does.

    Reads concrete arrays: the list is part of a compiled program's shape. Pixels that even the widest list cannot
    carry are marked by `selling_weights`.
    """
    g = np.asarray(inverse_metric)[np.asarray(mask)]
    if g.size == 0:
        return _RINGS[0]
    half_trace, gap = (g[:, 0, 0] + g[:, 1, 1]) / 2, np.hypot((g[:, 0, 0] - g[:, 1, 1]) / 2, g[:, 0, 1])
    anisotropy2 = np.max((half_trace + gap) / np.maximum(half_trace - gap, 1e-12 * half_trace))
    limits = (1 + math.sqrt(2), 4.23, 6.16, 8.08)
    rings = next((n for n, limit in enumerate(limits, 1) if anisotropy2 <= limit**2), len(limits))
    return tuple(itertools.chain.from_iterable(_RINGS[:rings]))


def selling_weights(
    inverse_metric: Float[Array, "height width 2 2"], offsets: tuple[Offset, ...]
) -> tuple[Float[Array, "offsets height width"], Bool[Array, "height width"]]:
    """λ_k ≥ 0 (px²·g's unit) for every offset, and where `offsets` carry the metric exactly.

    Selling's algorithm: from a superbase b₀ + b₁ + b₂ = 0 flip until all b_i·g b_j ≤ 0; then
    g = −Σ (b_j·g b_k) e_i e_iᵀ with e_i ⟂ b_i.
    """
    superbase, products = _obtuse_superbase(inverse_metric)
    weights = []
    for du, dv in offsets:
        # e_i = (−v_i, u_i) of b_i = (u_i, v_i); an offset and its opposite are the same
        match = [jnp.abs(b[0] * du + b[1] * dv) + jnp.abs(jnp.abs(b[0]) - abs(dv)) for b in superbase]
        weights.append(sum(jnp.where(m == 0, -p, 0) for m, p in zip(match, products, strict=True)))
    weights = jnp.maximum(jnp.stack(weights), 0)
    trace = jnp.trace(inverse_metric, axis1=-2, axis2=-1)
    lengths = jnp.array([du**2 + dv**2 for du, dv in offsets], weights.dtype)
    carried = jnp.abs(jnp.tensordot(lengths, weights, 1) - trace) <= 1e-4 * trace
    return weights, carried


def _obtuse_superbase(inverse_metric, flips: int = 8):
    """The superbase as [3][2] integer images, and −λ_i = b_j·g b_k."""
    g11, g12, g22 = inverse_metric[..., 0, 0], inverse_metric[..., 0, 1], inverse_metric[..., 1, 1]
    one, zero = jnp.ones(g11.shape, jnp.int32), jnp.zeros(g11.shape, jnp.int32)

    def product(a, b):
        a, b = a.astype(g11.dtype), b.astype(g11.dtype)
        return g11 * a[0] * b[0] + g12 * (a[0] * b[1] + a[1] * b[0]) + g22 * a[1] * b[1]

    def pairs(base):
        return jnp.stack([product(base[(i + 1) % 3], base[(i + 2) % 3]) for i in range(3)])

    def flip(_, base):
        products = pairs(base)
        worst = jnp.argmax(products, axis=0)
        i, j = (worst + 1) % 3, (worst + 2) % 3
        b_i = jnp.take_along_axis(base, i[None, None], axis=0)[0]
        b_j = jnp.take_along_axis(base, j[None, None], axis=0)[0]
        flipped = jnp.stack([-b_i, b_j, b_i - b_j])
        return jnp.where((jnp.max(products, axis=0) > 0)[None, None], flipped, base)

    start = jnp.stack([jnp.stack([one, zero]), jnp.stack([zero, one]), jnp.stack([-one, -one])])
    base = jax.lax.fori_loop(0, flips, flip, start)
    return base, pairs(base)
