"""The paper's first-order level-set scheme in JAX, frozen: a reference to measure against, not to be improved.

φ_s = F √(g^{ij} φ_i φ_j), s = ln r, in equal steps; Osher & Sethian's upwind differences (eq. 4), the cross term from
the larger of both one-sided ones; a pixel's arrival is the step at which φ turns positive. It starts from a cone at the
nearest singular point.
"""

import jax
import jax.numpy as jnp


def propagate(irradiance, inverse_metric, *, steps: int):
    """Range of a Lambertian surface of albedo 1; its largest possible one where no front came by."""
    dtype = irradiance.dtype
    limit = -0.5 * jnp.log(irradiance)
    start, end = jnp.min(limit), jnp.max(limit)
    ds = (end - start) / steps
    g11, g12, g22 = inverse_metric[..., 0, 0], inverse_metric[..., 0, 1], inverse_metric[..., 1, 1]
    fastest = 0.7 / (ds * jnp.sqrt(g11 + g22))
    height, width = irradiance.shape
    v, u = jnp.meshgrid(jnp.arange(height), jnp.arange(width), indexing="ij")
    source = jnp.unravel_index(jnp.argmin(limit), limit.shape)
    squared = (v - source[0]) ** 2 + (u - source[1]) ** 2
    phi = (1.5 - jnp.sqrt(squared.astype(dtype))) / jnp.sqrt(jnp.mean(g11))

    def upwind(phi, axis):
        step = jnp.diff(phi, axis=axis)
        low, high = [(0, 0), (0, 0)], [(0, 0), (0, 0)]
        low[axis], high[axis] = (1, 0), (0, 1)
        behind, ahead = -jnp.pad(step, low), jnp.pad(step, high)
        return jnp.where(ahead > behind, jnp.maximum(ahead, 0), -jnp.maximum(behind, 0))

    def step(state, n):
        phi, arrival = state
        s = start + ds * (n + 1).astype(dtype)
        c = jnp.clip(jnp.exp(2 * (s - limit)), 0.01, 1)
        speed = jnp.minimum(c / jnp.sqrt(jnp.maximum(1 - c * c, 1e-8)), fastest)
        pu, pv = upwind(phi, 1), upwind(phi, 0)
        square = g11 * pu * pu + 2 * g12 * pu * pv + g22 * pv * pv
        new = phi + ds * speed * jnp.sqrt(jnp.maximum(square, 0))
        return (new, jnp.where((arrival > s) & (new > 0), s, arrival)), None

    (_, arrival), _ = jax.lax.scan(step, (phi, jnp.where(phi > 0, start, limit + 1)), jnp.arange(steps))
    return jnp.exp(jnp.minimum(arrival, limit))
