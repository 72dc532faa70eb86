"""What every scene can do: answer rays with exact range and exact normal."""

import abc
from typing import ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

Vector = Float[Array, "3"]


class Hit(eqx.Module):
    """Where rays meet a scene for the first time.

    `range` from the rays' origins, in scene units; `normal` the unit normal on the side the ray came from;
    `hit` false for rays that meet nothing: their range is 1 and their normal looks back along the ray.
    """

    range: Float[Array, "*batch"]
    normal: Float[Array, "*batch 3"]
    hit: Bool[Array, "*batch"]


class AbstractScene(eqx.Module):
    """A surface known in closed form, in the camera frame: x right, y down, z forward, camera at the origin.

    Parameters are numbers or scalars that `jax.grad` reaches. `central_only`: the scene is written in terms of
    rays from the origin and has no meaning for others. `occludes`: some parts may hide others, so range may jump.
    """

    central_only: ClassVar[bool] = False
    occludes: ClassVar[bool] = False

    @abc.abstractmethod
    def clearance(self, point: Vector) -> Float[Array, ""]:
        """The scene's implicit equation: positive in free space, 0 on the surface; ∇clearance is the normal's way."""

    @abc.abstractmethod
    def distance(self, origin: Vector, direction: Vector) -> Float[Array, ""]:
        """Length along the unit `direction` from `origin` to the first surface point; inf where there is none."""

    def intersect(
        self,
        directions: Float[Array | np.ndarray, "*batch 3"],
        origins: Float[Array | np.ndarray, "*batch 3"] | None = None,
    ) -> Hit:
        """First surface point on each ray.

        `directions`: unit vectors; `origins`: where the rays start, the camera's centre if left out. Exact to the
        precision of the arrays' dtype, except within some 1e-8 of the limb of an occluding part.
        """
        directions = jnp.asarray(directions)
        origins = jnp.zeros_like(directions) if origins is None else jnp.asarray(origins)
        flat = jax.vmap(self._answer)(origins.reshape(-1, 3), directions.reshape(-1, 3))
        batch = directions.shape[:-1]
        return jax.tree.map(lambda leaf: leaf.reshape(batch + leaf.shape[1:]), flat)

    def _answer(self, origin: Vector, direction: Vector) -> Hit:
        distance = self.distance(origin, direction)
        hit = jnp.isfinite(distance)
        distance = jnp.where(hit, distance, 1)
        gradient = jax.grad(self.clearance)(origin + distance * direction)
        gradient = jnp.where(hit, gradient, -direction)
        return Hit(distance, gradient / jnp.sqrt(jnp.sum(gradient**2)), hit)
