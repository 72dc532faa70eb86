"""Irradiance: what the solvers read."""

import equinox as eqx
from jaxtyping import Array, Bool, Float


class Irradiance(eqx.Module):
    """Image irradiance E(u, v) in linear light, with the fall-off divided out: E = ρ G(cos θ)/r².

    `values`: arbitrary radiometric unit, ≥ 0; the unit of ρ/r² (with ρ = 1 and r in scene units).
    `valid`: pixels whose value is data; others are never read.
    """

    values: Float[Array, "height width"]
    valid: Bool[Array, "height width"]
