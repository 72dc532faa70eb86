"""What the true lights give a surface, over what a light at the lens would give it."""

from functools import partial

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from jaxsfs.lights import Lights, shade_lights
from jaxsfs.reflectance import AbstractReflectance
from jaxsfs.surface import Surface

Image = Float[Array, "height width"]

# Lights some millimetres off change the irradiance by less than this; more comes from a bad normal.
_LARGEST = 10.0
_MIN_COSINE = 0.02


@partial(jax.jit, static_argnames="smooth_px")
def light_ratio(surface: Surface, lights: Lights, reflectance: AbstractReflectance, *, smooth_px: int = 2) -> Image:
    """q = E(lights)/E(light at the lens) of `surface`, per pixel; the albedo cancels. 1 where there is no surface.

    q changes slowly: it is Σ p_i S_i (r/|l_i − x|)³ (1 − d·l_i/r + ∇w·l_i/r) for a Lambertian surface, w = ln r and ∇w
    the slope along the ray sphere. Normals are differences of a noisy range, so q is smoothed over `smooth_px` (the σ
    of a Gaussian, whole px; 0: not at all).
    """
    normals, exists = surface.normals()
    rays = surface.camera.rays(surface.range.dtype)
    cosine = -jnp.sum(normals * rays, axis=-1)
    known = exists & (cosine > _MIN_COSINE)
    distance = jnp.where(known, surface.range, 1)
    normals = jnp.where(known[..., None], normals, -rays)
    lit = shade_lights(distance[..., None] * rays, normals, lights, reflectance=reflectance)
    colocated = reflectance(jnp.where(known, jnp.minimum(cosine, 1), 1)) / distance**2
    ratio = jnp.clip(lit / colocated, 1 / _LARGEST, _LARGEST)
    return _smoothed(ratio, known, smooth_px)


def _smoothed(ratio: Image, known: Bool[Array, "height width"], smooth_px: int) -> Image:
    """Gaussian mean over the known pixels; they alone give, all receive."""
    if not smooth_px:
        return jnp.where(known, ratio, 1)
    reach = 3 * smooth_px
    taps = jnp.exp(-0.5 * (jnp.arange(-reach, reach + 1, dtype=ratio.dtype) / smooth_px) ** 2)
    weight = known.astype(ratio.dtype)
    weight, weighted = _blurred(weight, taps), _blurred(ratio * weight, taps)
    return jnp.where(weight > 0, weighted / jnp.where(weight > 0, weight, 1), 1)


def _blurred(image: Image, taps: Float[Array, " taps"]) -> Image:
    """Separable convolution, zeros beyond the image (one call per axis: chained shifts would be fused and redone)."""
    reach = taps.size // 2
    down = jax.lax.conv_general_dilated(image[None, None], taps.reshape(1, 1, -1, 1), (1, 1), [(reach, reach), (0, 0)])
    return jax.lax.conv_general_dilated(down, taps.reshape(1, 1, 1, -1), (1, 1), [(0, 0), (reach, reach)])[0, 0]
