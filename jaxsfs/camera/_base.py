"""What every camera can do. Conventions, stated once:

* `pixel` is (u, v): u to the right, v down, in px; the centre of the first pixel is (0, 0). Arrays are `[v, u]`.
* The camera frame is x right, y down, z forward; a central camera's origin is its projection centre.
* Methods take one pixel or one point; `jax.vmap` makes them work on many. The plural methods
  (`pixels`, `rays`, …) do so over the whole image.
"""

import abc
import dataclasses
import functools
from collections.abc import Callable
from typing import TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from jaxsfs.forms import Scalar

CameraT = TypeVar("CameraT", bound="AbstractCamera")


class AbstractCamera(eqx.Module):
    """A map between pixels and rays, and the metric that it gives to the image.

    Parameters of subclasses are Python floats or arrays: leaves of the pytree, so `jax.grad` reaches them.
    """

    width: eqx.AbstractVar[int]
    height: eqx.AbstractVar[int]
    cx: eqx.AbstractVar[Scalar]
    cy: eqx.AbstractVar[Scalar]

    @abc.abstractmethod
    def ray(self, pixel: Float[Array, "2"]) -> Float[Array, "3"]:
        """Unit vector through `pixel`. Finite everywhere; meaningless where `is_valid` is false."""

    @abc.abstractmethod
    def project(self, point: Float[Array, "3"]) -> Float[Array, "2"]:
        """Pixel that sees `point`; the exact inverse of `ray` on the valid field."""

    @abc.abstractmethod
    def is_valid(self, pixel: Float[Array, "2"]) -> Bool[Array, ""]:
        """Whether the model has a ray for `pixel`. The image's own borders are not asked."""

    @abc.abstractmethod
    def inverse_metric(self, pixel: Float[Array, "2"]) -> Float[Array, "2 2"]:
        """g^{ij}: the inverse of g_ij = ∂_i d·∂_j d (d the ray), in px². Design: |∇φ|² = g^{ij} φ_i φ_j."""

    @abc.abstractmethod
    def point(self, pixel: Float[Array, "2"], distance: Float[Array, ""]) -> Float[Array, "3"]:
        """Point of the camera frame at `distance` along the ray of `pixel` (unit of `distance`)."""

    @abc.abstractmethod
    def resized(self, width: int, height: int) -> "AbstractCamera":
        """The camera of the same picture scaled to `width` × `height` px."""

    def sees(self, point: Float[Array, "3"]) -> Bool[Array, ""]:
        """Whether `point` lies where the model is one-to-one: its pixel's ray leads back to it."""
        pixel = self.project(point)
        direction = point / jnp.maximum(jnp.linalg.norm(point), 1e-30)
        return self.is_valid(pixel) & (jnp.dot(self.ray(pixel), direction) > 1 - 1e-4)

    def cropped(self: CameraT, left: int, top: int, width: int, height: int) -> CameraT:
        """The camera of the `width` × `height` px cut whose first pixel is (`left`, `top`)."""
        moved = dataclasses.replace(self, cx=self.cx - left, cy=self.cy - top)
        return with_size(moved, width, height)

    def pixels(self, dtype: jnp.dtype | None = None) -> Float[Array, "height width 2"]:
        """(u, v) of every pixel centre."""
        dtype = jnp.result_type(float) if dtype is None else dtype
        u = jnp.arange(self.width, dtype=dtype)
        v = jnp.arange(self.height, dtype=dtype)
        return jnp.stack(jnp.meshgrid(u, v), axis=-1)

    def rays(self, dtype: jnp.dtype | None = None) -> Float[Array, "height width 3"]:
        """Unit ray of every pixel."""
        return _rays(self, jnp.result_type(float) if dtype is None else dtype)

    def inverse_metrics(self, dtype: jnp.dtype | None = None) -> Float[Array, "height width 2 2"]:
        """g^{ij} at every pixel."""
        return _inverse_metrics(self, jnp.result_type(float) if dtype is None else dtype)

    def field(self, dtype: jnp.dtype | None = None) -> Bool[Array, "height width"]:
        """Pixels that have a ray."""
        return _field(self, jnp.result_type(float) if dtype is None else dtype)


class AbstractCentralCamera(AbstractCamera):
    """All rays start at one projection centre, where the light sits too.

    A new camera needs `ray`, `project` (homogeneous of degree 0), `is_valid` and `resized`, nothing else.
    """

    def point(self, pixel: Float[Array, "2"], distance: Float[Array, ""]) -> Float[Array, "3"]:
        """distance · ray (eq. 13 for the spherical camera)."""
        return distance * self.ray(pixel)

    def inverse_metric(self, pixel: Float[Array, "2"]) -> Float[Array, "2 2"]:
        """g^{ij} = P Pᵀ, P = ∂project/∂point at the unit ray: `project` is homogeneous of degree 0, so P d = 0
        and P is the pseudo-inverse of ∂ray/∂pixel."""
        jacobian = jax.jacfwd(self.project)(self.ray(pixel))
        return jacobian @ jacobian.T


# One program each: operation by operation, a ray that is a root compiles some forty.


@functools.partial(jax.jit, static_argnames="dtype")
def _rays(camera: AbstractCamera, dtype) -> Float[Array, "height width 3"]:
    return over_image(camera.ray)(camera.pixels(dtype))


@functools.partial(jax.jit, static_argnames="dtype")
def _inverse_metrics(camera: AbstractCamera, dtype) -> Float[Array, "height width 2 2"]:
    return over_image(camera.inverse_metric)(camera.pixels(dtype))


@functools.partial(jax.jit, static_argnames="dtype")
def _field(camera: AbstractCamera, dtype) -> Bool[Array, "height width"]:
    return over_image(camera.is_valid)(camera.pixels(dtype))


def over_image(function: Callable) -> Callable:
    """`function` of one pixel, as a function of an image of pixels."""
    return jax.vmap(jax.vmap(function))


def resized_centre(camera: AbstractCamera, width: int, height: int) -> tuple[Scalar, Scalar]:
    """(cx, cy) after scaling: pixels are areas, so it is their borders (−½, size − ½) that map to each other."""
    sx, sy = width / camera.width, height / camera.height
    return (camera.cx + 0.5) * sx - 0.5, (camera.cy + 0.5) * sy - 0.5


def with_size(camera: CameraT, width: int, height: int) -> CameraT:
    """The same parameters with another image size (the size is static, out of `tree_at`'s reach)."""
    if width < 1 or height < 1:
        raise ValueError(f"an image is at least 1 x 1 px, got {width} x {height}")
    return dataclasses.replace(camera, width=int(width), height=int(height))
