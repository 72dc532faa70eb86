"""A scene seen by a camera with the light at its lens: everything that is exactly known about the picture."""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from data_synth.occlusion import find_cuts
from data_synth.scene import AbstractScene, Hit
from jaxsfs.camera import AbstractCamera, AbstractCentralCamera
from jaxsfs.forms import Scalar
from jaxsfs.irradiance import Irradiance
from jaxsfs.reflectance import AbstractReflectance, Lambertian
from jaxsfs.rendering import shade, shade_distant
from jaxsfs.surface import Surface

_LAMBERTIAN = Lambertian()
_BATCH = 64


class View(eqx.Module):
    """What `camera` sees of a scene, exact at every pixel centre (nothing is differenced).

    `surface`: exact range; for an orthographic camera z. `normals`: unit, towards the camera. `cosines`: cos θ.
    `irradiance`: E = ρ G(cos θ)/r², or ρ G(cos θ) for an orthographic camera with a distant frontal light.
    `cuts`: neighbours that an occlusion separates, `[v, u, 0]` to the right and `[v, u, 1]` below (see `find_cuts`).
    All are meaningful where `surface.valid`.
    """

    camera: AbstractCamera
    surface: Surface
    normals: Float[Array, "height width 3"]
    cosines: Float[Array, "height width"]
    irradiance: Irradiance
    cuts: Bool[Array, "height width 2"]

    def discontinuities(self) -> Bool[Array, "height width"]:
        """Pixels with a 4-neighbour on the other side of an occlusion, on both sides of it."""
        right, below = self.cuts[..., 0], self.cuts[..., 1]
        return right | jnp.roll(right, 1, axis=1) | below | jnp.roll(below, 1, axis=0)


def look(scene: AbstractScene, camera: AbstractCamera) -> Hit:
    """Range, normal and hit at every pixel of `camera`; `jax.grad` reaches the parameters of both.

    Raises ValueError for a scene that is written in terms of rays from one centre and a camera that has none.
    """
    _check(scene, camera)
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
    _check(scene, camera)
    surface, normals, cosines, irradiance = _observe(scene, camera, reflectance, albedo, half_field_deg)
    return View(camera, surface, normals, cosines, irradiance, find_cuts(scene, surface))


@jax.jit
def _observe(scene, camera, reflectance, albedo, half_field_deg):
    hits = _look(scene, camera)
    rays = camera.rays()
    valid = hits.hit & camera.field()
    if half_field_deg is not None:
        valid = valid & (rays[..., 2] >= jnp.cos(jnp.deg2rad(1.0 * half_field_deg)))
    cosine = jnp.clip(-jnp.sum(hits.normal * rays, axis=-1), 0, 1)
    if isinstance(camera, AbstractCentralCamera):
        values = shade(hits.range, cosine, reflectance=reflectance, albedo=albedo)
    else:
        values = shade_distant(cosine, reflectance=reflectance, albedo=albedo)
    surface = Surface(camera, hits.range, valid)
    return surface, hits.normal, cosine, Irradiance(jnp.where(valid, values, 0), valid)


def _check(scene: AbstractScene, camera: AbstractCamera) -> None:
    if scene.central_only and not isinstance(camera, AbstractCentralCamera):
        raise ValueError(f"{type(scene).__name__} is defined for rays from one centre, not {type(camera).__name__}'s")


@jax.jit
def _look(scene: AbstractScene, camera: AbstractCamera) -> Hit:
    pixels = camera.pixels()
    # parallel rays start on the plane z = 0, so that their range is z; the rays of a central camera at the origin
    start = jnp.zeros(pixels.shape[:2], pixels.dtype)
    origins = jax.vmap(jax.vmap(camera.point))(pixels, start)
    # few rays in lockstep: a batch takes as many steps as its slowest ray (the last batch is filled up with the
    # first ray, so that one batch size is compiled)
    count = origins.shape[0] * origins.shape[1]
    order = jnp.arange(-(-count // _BATCH) * _BATCH).reshape(-1, _BATCH)
    order = jnp.where(order < count, order, 0)
    rays, origins = camera.rays().reshape(-1, 3), origins.reshape(-1, 3)
    hits = jax.lax.map(lambda batch: scene.intersect(rays[batch], origins[batch]), order)
    return jax.tree.map(
        lambda leaf: leaf.reshape(-1, *leaf.shape[2:])[:count].reshape(*start.shape, *leaf.shape[2:]), hits
    )
