"""The forward model: from a surface to the irradiance it sends into the camera, and to a stored photograph.

Everything here is elementwise or a difference of neighbours: `jax.jit`, `jax.vmap` and `jax.grad` pass through.
"""

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxsfs.camera import AbstractCamera, AbstractCentralCamera
from jaxsfs.forms import Scalar
from jaxsfs.irradiance import Irradiance
from jaxsfs.lights import Lights, check_two_angles, shade_lights
from jaxsfs.photometry import AbstractFalloff, AbstractResponse, NoFalloff, SRGBResponse
from jaxsfs.reflectance import AbstractReflectance, Lambertian
from jaxsfs.surface import Surface

FloatImage = Float[Array, "*shape"]

_LAMBERTIAN = Lambertian()
_SRGB = SRGBResponse()
_NO_FALLOFF = NoFalloff()


def shade(
    range: FloatImage,
    cosine: FloatImage,
    *,
    reflectance: AbstractReflectance = _LAMBERTIAN,
    albedo: Scalar | FloatImage = 1.0,
) -> FloatImage:
    """Irradiance of surface points lit from the projection centre: E = ρ G(cos θ)/r² (eq. 5).

    `range`: r > 0 in scene units; `cosine`: cos θ in [0, 1]; `albedo`: ρ, one number or one per pixel. E has the
    unit of ρ/r².
    """
    return albedo * reflectance(cosine) / range**2


def shade_distant(
    cosine: FloatImage, *, reflectance: AbstractReflectance = _LAMBERTIAN, albedo: Scalar | FloatImage = 1.0
) -> FloatImage:
    """Irradiance of surface points lit from far away along the viewing direction: E = ρ G(cos θ) (eq. 1)."""
    return albedo * reflectance(cosine)


@jax.jit
def render(
    surface: Surface, *, reflectance: AbstractReflectance = _LAMBERTIAN, albedo: Scalar | FloatImage = 1.0
) -> Irradiance:
    """Irradiance image of `surface` with the light at the projection centre: E = ρ G(cos θ)/r², cos θ from
    differences of ln r, of second order.

    Valid where the difference exists and the surface faces the camera; the values are 0 elsewhere. Shadows do not
    exist: light and eye coincide. Raises ValueError for a camera without a projection centre.
    """
    if not isinstance(surface.camera, AbstractCentralCamera):
        raise ValueError(
            f"{type(surface.camera).__name__} has no projection centre for the light to sit at; "
            "write render_distant(surface) for a distant frontal light"
        )
    cosine, valid = _facing(surface)
    distance = jnp.where(valid, surface.range, 1)
    values = shade(distance, cosine, reflectance=reflectance, albedo=albedo)
    return Irradiance(jnp.where(valid, values, 0), valid)


@jax.jit
def render_distant(
    surface: Surface, *, reflectance: AbstractReflectance = _LAMBERTIAN, albedo: Scalar | FloatImage = 1.0
) -> Irradiance:
    """Irradiance image of `surface` under a distant light along the optical axis: E = ρ G(cos θ).

    The setting of eqs. (1)–(4) (Kimmel & Bruckstein 1995) when the camera is orthographic; θ is measured to the ray.
    """
    cosine, valid = _facing(surface)
    values = shade_distant(cosine, reflectance=reflectance, albedo=albedo)
    return Irradiance(jnp.where(valid, values, 0), valid)


def render_lights(
    surface: Surface,
    lights: Lights,
    *,
    reflectance: AbstractReflectance = _LAMBERTIAN,
    albedo: Scalar | FloatImage = 1.0,
) -> Irradiance:
    """Irradiance image of `surface` under lights beside the lens: E = ρ Σ p_i S_i(cos ψ_i) G(θ_i, θ_e)/|l_i − x|²,
    normals from differences of ln r, of second order.

    `surface` in the unit of the lights' positions (mm). Valid where the normal exists, the surface faces the camera
    and at least one light; the values are 0 elsewhere. Thrown shadows are not modelled. Raises ValueError for a camera
    without a projection centre, and for a reflectance other than Lambertian and Power (see `lights.reflected`).
    """
    if not isinstance(surface.camera, AbstractCentralCamera):
        raise ValueError(f"lights beside the lens need a central camera, got {type(surface.camera).__name__}")
    check_two_angles(reflectance)
    return _render_lights(surface, lights, reflectance, albedo)


@jax.jit
def _render_lights(surface: Surface, lights: Lights, reflectance: AbstractReflectance, albedo: Scalar | FloatImage):
    normals, exists = surface.normals()
    rays = surface.camera.rays(surface.range.dtype)
    valid = exists & (jnp.sum(normals * rays, axis=-1) < 0)
    # what is not valid is seen from straight ahead, so that no derivative of a reflectance is infinite
    points = jnp.where(valid, surface.range, 1)[..., None] * rays
    normals = jnp.where(valid[..., None], normals, -rays)
    values = shade_lights(points, normals, lights, reflectance=reflectance, albedo=albedo)
    valid = valid & (values > 0)
    return Irradiance(jnp.where(valid, values, 0), valid)


@jax.jit
def photograph(
    irradiance: Irradiance,
    camera: AbstractCamera,
    *,
    response: AbstractResponse = _SRGB,
    falloff: AbstractFalloff = _NO_FALLOFF,
    gain: Scalar = 1.0,
) -> Float[Array, "height width"]:
    """Stored photograph: response(clip(gain · V(α) · E, 0, 1)), values in [0, 1]; 0 where not valid.

    `falloff` is V, a function of the angle α between ray and optical axis. Values at 1 are clipped: they only say
    that E was at least that much.
    """
    vignette = falloff(camera.rays(irradiance.values.dtype)[..., 2])
    linear = jnp.where(irradiance.valid, gain * vignette * irradiance.values, 0)
    return response.encode(jnp.clip(linear, 0, 1))


def _facing(surface):
    """cos θ, and where it exists and is positive; 1 elsewhere, so that no derivative of a reflectance is infinite."""
    cosine, exists = surface.cosines()
    valid = exists & (cosine > 0)
    # rounding can carry the cosine of a frontal point past 1, out of G's domain
    return jnp.where(valid, jnp.minimum(cosine, 1), 1), valid
