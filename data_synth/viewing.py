"""A scene seen by a camera with the light at its lens: everything that is exactly known about the picture."""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from data_synth.scene import AbstractScene, Hit
from jaxsfs.camera import AbstractCamera, AbstractCentralCamera
from jaxsfs.forms import Scalar
from jaxsfs.irradiance import Irradiance
from jaxsfs.reflectance import AbstractReflectance, Lambertian
from jaxsfs.rendering import shade, shade_distant
from jaxsfs.surface import Surface

_LAMBERTIAN = Lambertian()


class View(eqx.Module):
    """What `camera` sees of a scene, exact at every pixel centre (nothing is differenced).

    `surface`: exact range; for an orthographic camera z. `normals`: unit, towards the camera. `cosines`: cos θ.
    `irradiance`: E = ρ G(cos θ)/r², or ρ G(cos θ) for an orthographic camera with a distant frontal light.
    All are meaningful where `surface.valid`.
    """

    camera: AbstractCamera
    surface: Surface
    normals: Float[Array, "height width 3"]
    cosines: Float[Array, "height width"]
    irradiance: Irradiance


def look(scene: AbstractScene, camera: AbstractCamera) -> Hit:
    """Range, normal and hit at every pixel of `camera`; `jax.grad` reaches the parameters of both.

    Raises ValueError for a scene that is written in terms of rays from one centre and a camera that has none.
    """
    if scene.central_only and not isinstance(camera, AbstractCentralCamera):
        raise ValueError(f"{type(scene).__name__} is defined for rays from one centre, not {type(camera).__name__}'s")
    return _look(scene, camera)


def observe(
    scene: AbstractScene,
    camera: AbstractCamera,
    *,
    reflectance: AbstractReflectance = _LAMBERTIAN,
    albedo: Scalar = 1.0,
    half_field_deg: Scalar | None = None,
) -> View:
    """The exact view of `scene`: light at the projection centre, or distant and frontal for an orthographic camera.

    `half_field_deg` limits the picture to the rays within that angle from the optical axis, the round field of an
    endoscope. Computed in double precision where JAX has it switched on.
    """
    hits = look(scene, camera)
    rays = camera.rays()
    valid = hits.hit & camera.field()
    if half_field_deg is not None:
        valid = valid & (rays[..., 2] >= jnp.cos(jnp.deg2rad(1.0 * half_field_deg)))
    cosine = jnp.clip(-jnp.sum(hits.normal * rays, axis=-1), 0, 1)
    if isinstance(camera, AbstractCentralCamera):
        values = shade(hits.range, cosine, reflectance=reflectance, albedo=albedo)
    else:
        values = shade_distant(cosine, reflectance=reflectance, albedo=albedo)
    irradiance = Irradiance(jnp.where(valid, values, 0), valid)
    return View(camera, Surface(camera, hits.range, valid), hits.normal, cosine, irradiance)


@jax.jit
def _look(scene: AbstractScene, camera: AbstractCamera) -> Hit:
    pixels = camera.pixels()
    # parallel rays start on the plane z = 0, so that their range is z; the rays of a central camera at the origin
    start = jnp.zeros(pixels.shape[:2], pixels.dtype)
    origins = jax.vmap(jax.vmap(camera.point))(pixels, start)
    # row by row: a traced row ends when its own rays have arrived, and it fits the cache
    return jax.lax.map(lambda row: scene.intersect(*row), (camera.rays(), origins))
