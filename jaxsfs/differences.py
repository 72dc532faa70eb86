"""Differences and weighted sums of image fields over neighbouring pixels."""

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float


def masked_slopes(
    field: Float[Array, "height width"], valid: Bool[Array, "height width"]
) -> tuple[Float[Array, "height width"], Float[Array, "height width"], Bool[Array, "height width"]]:
    """∂u and ∂v of `field` per px, and where both exist; invalid pixels are never read.

    Central where both neighbours are valid; next to the border a one-sided difference, of second order where two
    neighbours in a row are valid.
    """
    # else XLA computes both anew for each of the eight neighbours that are read
    field, valid = jax.lax.optimization_barrier((field, valid))
    du, ok_u = _derivative(field, valid, axis=1)
    dv, ok_v = _derivative(field, valid, axis=0)
    return du, dv, valid & ok_u & ok_v


def shifted(field: Array, step: int, axis: int, fill) -> Array:
    """field[i + step] along `axis`; `fill` beyond the image."""
    size = field.shape[axis]
    if abs(step) >= size:
        return jnp.full_like(field, fill)
    pad = [(0, 0)] * field.ndim
    pad[axis] = (max(-step, 0), max(step, 0))
    padded = jnp.pad(field, pad, constant_values=fill)
    start = max(step, 0)
    return jax.lax.slice_in_dim(padded, start, start + size, axis=axis)


def correlated(
    field: Float[Array, "height width"], kernel: Float[Array, " taps"], axis: int
) -> Float[Array, "height width"]:
    """Σ_k kernel[k] field[i + k − taps//2] along `axis`; zeros beyond the image."""
    size, reach = field.shape[axis], kernel.shape[0] // 2
    pad = [(0, 0)] * field.ndim
    pad[axis] = (reach, reach)
    padded = jnp.pad(field, pad)

    # A loop: XLA's convolution of one channel takes twenty times as long on a CPU, and of unrolled sums it computes the
    # first axis again for every tap of the second.
    def add(k, total):
        return total + kernel[k] * jax.lax.dynamic_slice_in_dim(padded, k, size, axis)

    return jax.lax.fori_loop(0, kernel.shape[0], add, jnp.zeros_like(field))


def _derivative(field, valid, axis):
    safe = jnp.where(valid, field, 0)
    value = {step: shifted(safe, step, axis, 0) for step in (-2, -1, 1, 2)}
    ok = {step: shifted(valid, step, axis, False) for step in (-2, -1, 1, 2)}
    central = 0.5 * (value[1] - value[-1])
    ahead = jnp.where(ok[2], -1.5 * safe + 2 * value[1] - 0.5 * value[2], value[1] - safe)
    behind = jnp.where(ok[-2], 1.5 * safe - 2 * value[-1] + 0.5 * value[-2], safe - value[-1])
    derivative = jnp.where(ok[1] & ok[-1], central, jnp.where(ok[1], ahead, behind))
    return derivative, valid & (ok[1] | ok[-1])
