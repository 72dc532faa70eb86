"""Surface: a range at every pixel of a camera."""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from jaxsfs.camera import AbstractCamera, AbstractCentralCamera
from jaxsfs.differences import masked_slopes


class Surface(eqx.Module):
    """r(u, v)·d(u, v): the surface that a camera sees, as `range` along each pixel's ray.

    `range` is in scene units (mm once the scale is known), NaN nowhere: read it where `valid`. For an orthographic
    camera it is z. `contours`: pixels of occluding contours, where known; they belong to the nearer side, and what is
    farther is not connected with them. Differences do not read them.
    """

    camera: AbstractCamera
    range: Float[Array, "height width"]
    valid: Bool[Array, "height width"]
    contours: Bool[Array, "height width"] | None = None

    @jax.jit  # one program: operation by operation, a camera compiles dozens
    def points(self) -> Float[Array, "height width 3"]:
        """Points in the camera frame (x right, y down, z forward), eq. (13); meaningless where not valid."""
        pixels = self.camera.pixels(self.range.dtype)
        return jax.vmap(jax.vmap(self.camera.point))(pixels, self.range)

    def depth(self) -> Float[Array, "height width"]:
        """z of the points (eq. 12). Not the range."""
        return self.points()[..., 2]

    @jax.jit
    def normals(self) -> tuple[Float[Array, "height width 3"], Bool[Array, "height width"]]:
        """Unit normals towards the camera, and where they exist.

        The tangents are ∂_i point + r_i ∂_r point. Only the range is differenced (as ln r for a central camera,
        which is smoother), the camera's part is exact.
        """
        safe = jnp.where(self.valid, self.range, 1)
        along_u, along_v, ok = self._slopes()
        gradient = jnp.stack([along_u, along_v], axis=-1)
        if isinstance(self.camera, AbstractCentralCamera):
            gradient = safe[..., None] * gradient

        def normal(pixel, distance, slope):
            along_pixel, along_ray = jax.jacfwd(self.camera.point, argnums=(0, 1))(pixel, distance)
            tangents = along_pixel + jnp.outer(along_ray, slope)
            outward = jnp.cross(tangents[:, 0], tangents[:, 1])
            return -outward / jnp.maximum(jnp.sqrt(jnp.sum(outward**2)), 1e-30)

        pixels = self.camera.pixels(self.range.dtype)
        return jax.vmap(jax.vmap(normal))(pixels, safe, gradient), ok

    @jax.jit
    def cosines(self) -> tuple[Float[Array, "height width"], Bool[Array, "height width"]]:
        """cos θ between normal and direction to the camera, and where it exists: 1/√(1 + |∇ ln r|²_g) (eq. 4 over the
        rays' sphere) for a central camera, the normals' own otherwise."""
        if not isinstance(self.camera, AbstractCentralCamera):
            normals, ok = self.normals()
            return -jnp.sum(normals * self.camera.rays(self.range.dtype), axis=-1), ok
        along_u, along_v, ok = self._slopes()
        g = self.camera.inverse_metrics(self.range.dtype)
        square = g[..., 0, 0] * along_u**2 + 2 * g[..., 0, 1] * along_u * along_v + g[..., 1, 1] * along_v**2
        return 1 / jnp.sqrt(1 + square), ok

    def smooth(self) -> Bool[Array, "height width"]:
        """Pixels of the surface that are no occluding contour."""
        return self.valid if self.contours is None else self.valid & ~self.contours

    def _slopes(
        self,
    ) -> tuple[Float[Array, "height width"], Float[Array, "height width"], Bool[Array, "height width"]]:
        """∂ per px along u and v of ln r (for a central camera; of r otherwise), and where both exist; nothing is
        differenced across a contour."""
        field = jnp.where(self.valid, self.range, 1)
        if isinstance(self.camera, AbstractCentralCamera):
            field = jnp.log(jnp.maximum(field, 1e-30))
        return masked_slopes(field, self.smooth())
