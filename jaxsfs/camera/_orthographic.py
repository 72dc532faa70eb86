"""Parallel rays: the camera of eqs. (1)–(4)."""

import dataclasses

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from jaxsfs.camera._base import AbstractCamera, resized_centre, with_size
from jaxsfs.forms import Scalar


class Orthographic(AbstractCamera):
    """pixel = centre + scale·(x, y); all rays are (0, 0, 1), and "range" means z.

    `scale` is in px per unit of length; `aspect` is the ratio of the vertical to the horizontal scale. Used with
    a distant frontal light (Kimmel & Bruckstein 1995a), where g^{ij} = scale² δ and the equation is one for z.
    """

    scale: Scalar
    cx: Scalar
    cy: Scalar
    width: int = eqx.field(static=True)
    height: int = eqx.field(static=True)
    aspect: Scalar = 1.0

    def ray(self, pixel: Float[Array, "2"]) -> Float[Array, "3"]:
        return jnp.array([0.0, 0.0, 1.0], pixel.dtype)

    def project(self, point: Float[Array, "3"]) -> Float[Array, "2"]:
        return jnp.stack([self.cx + self.scale * point[0], self.cy + self.scale * self.aspect * point[1]])

    def is_valid(self, pixel: Float[Array, "2"]) -> Bool[Array, ""]:
        return jnp.all(jnp.isfinite(pixel))

    def sees(self, point: Float[Array, "3"]) -> Bool[Array, ""]:
        return jnp.all(jnp.isfinite(point))

    def inverse_metric(self, pixel: Float[Array, "2"]) -> Float[Array, "2 2"]:
        """g^{ij} = scale² δ_ij."""
        return jnp.diag(jnp.stack([self.scale**2, (self.scale * self.aspect) ** 2]).astype(pixel.dtype))

    def point(self, pixel: Float[Array, "2"], distance: Float[Array, ""]) -> Float[Array, "3"]:
        """(x, y, distance)."""
        x = (pixel[0] - self.cx) / self.scale
        y = (pixel[1] - self.cy) / (self.scale * self.aspect)
        return jnp.stack([x, y, distance])

    def resized(self, width: int, height: int) -> "Orthographic":
        sx, sy = width / self.width, height / self.height
        cx, cy = resized_centre(self, width, height)
        moved = dataclasses.replace(self, scale=self.scale * sx, aspect=self.aspect * (sy / sx), cx=cx, cy=cy)
        return with_size(moved, width, height)
