"""Scenes whose range is a formula: plane, balls, wavy wall, tube. No part hides another."""

from typing import ClassVar

import jax.numpy as jnp
from jaxtyping import Array, Float

from data_synth.scene import AbstractScene, Vector
from jaxsfs.forms import Scalar


class Plane(AbstractScene):
    """Plane z = h + slope_x x + slope_y y. Facing the camera (no slope): r = h/cos α, cos θ = cos α."""

    h: Scalar = 1.0
    slope_x: Scalar = 0.0
    slope_y: Scalar = 0.0

    def clearance(self, point: Vector) -> Float[Array, ""]:
        x, y, z = point
        return (self.h + self.slope_x * x + self.slope_y * y - z) / jnp.sqrt(1.0 + self.slope_x**2 + self.slope_y**2)

    def distance(self, origin: Vector, direction: Vector) -> Float[Array, ""]:
        x, y, z = origin
        approach = direction[2] - self.slope_x * direction[0] - self.slope_y * direction[1]
        gap = self.h + self.slope_x * x + self.slope_y * y - z
        return jnp.where(approach > 0, gap / jnp.where(approach > 0, approach, 1), jnp.inf)


class Ball(AbstractScene):
    """Ball of `radius` about (x, y, z), seen from outside: r = b − √(b² − |c|² + R²), b = c·d."""

    radius: Scalar = 9.0
    x: Scalar = 0.0
    y: Scalar = 0.0
    z: Scalar = 10.0

    def clearance(self, point: Vector) -> Float[Array, ""]:
        return _length(point - _vector(self, point)) - self.radius

    def distance(self, origin: Vector, direction: Vector) -> Float[Array, ""]:
        along, discriminant = _chord(origin, direction, _vector(self, origin), self.radius)
        hit = (discriminant > 0) & (along > 0)
        return jnp.where(hit, along - jnp.sqrt(jnp.where(hit, discriminant, 1)), jnp.inf)


class HollowBall(AbstractScene):
    """Sphere of `radius` about (x, y, z), seen from inside: r = b + √(b² − |c|² + R²), b = c·d.

    The camera must be inside, off the centre for any shading at all: from the centre every ray is a normal. With
    the centre behind the camera (z < 0) range grows towards the rim, with z > 0 it shrinks.
    """

    radius: Scalar = 2.2
    x: Scalar = 0.15
    y: Scalar = -0.1
    z: Scalar = -1.0

    def clearance(self, point: Vector) -> Float[Array, ""]:
        return self.radius - _length(point - _vector(self, point))

    def distance(self, origin: Vector, direction: Vector) -> Float[Array, ""]:
        along, discriminant = _chord(origin, direction, _vector(self, origin), self.radius)
        hit = discriminant > 0
        return jnp.where(hit, along + jnp.sqrt(jnp.where(hit, discriminant, 1)), jnp.inf)


class WavyWall(AbstractScene):
    """Wall with many nearest points: ln r = ln r₀ + a cos(k x) cos(k y) + b (1 − cos α)², (x, y, cos α) the ray.

    Star-shaped about the camera, so nothing is hidden. Every nearest point is a singular point (cos θ = 1); `b`
    opens the wall towards the rim, so that range grows outward there.
    """

    central_only: ClassVar[bool] = True

    range0: Scalar = 1.5
    a: Scalar = 0.03
    k: Scalar = 12.0
    b: Scalar = 1.2

    def log_range(self, ray: Vector) -> Float[Array, ""]:
        """ln r of a unit ray."""
        waves = self.a * jnp.cos(self.k * ray[0]) * jnp.cos(self.k * ray[1])
        return jnp.log(1.0 * self.range0) + waves + self.b * (1 - ray[2]) ** 2

    def clearance(self, point: Vector) -> Float[Array, ""]:
        norm = _length(point)
        return self.log_range(point / norm) - jnp.log(norm)

    def distance(self, origin: Vector, direction: Vector) -> Float[Array, ""]:
        return jnp.exp(self.log_range(direction))


class Tube(AbstractScene):
    """Straight tube of `radius` about the line through (x, y) along the optical axis, closed by a flat end at
    z = `length`; the camera is inside."""

    radius: Scalar = 1.0
    x: Scalar = 0.2
    y: Scalar = 0.1
    length: Scalar = 6.0

    def clearance(self, point: Vector) -> Float[Array, ""]:
        wall = self.radius - _length(point[:2] - _vector(self, point)[:2])
        return jnp.minimum(wall, self.length - point[2])

    def distance(self, origin: Vector, direction: Vector) -> Float[Array, ""]:
        across = jnp.sum(direction[:2] ** 2)
        offset = origin[:2] - _vector(self, origin)[:2]
        b = jnp.sum(offset * direction[:2])
        # the root of across t² + 2 b t − (R² − |offset|²) in the form that stays finite on the axis
        inside = jnp.maximum(self.radius**2 - jnp.sum(offset**2), 0)
        denominator = b + jnp.sqrt(b**2 + across * inside)
        wall = jnp.where(denominator > 0, inside / jnp.where(denominator > 0, denominator, 1), jnp.inf)
        forward = direction[2] > 0
        end = jnp.where(forward, (self.length - origin[2]) / jnp.where(forward, direction[2], 1), jnp.inf)
        return jnp.minimum(wall, end)


def _vector(scene: Ball | HollowBall | Tube, like: Vector) -> Vector:
    z = 0.0 if isinstance(scene, Tube) else scene.z
    return jnp.stack([jnp.asarray(part, like.dtype) for part in (scene.x, scene.y, z)])


def _chord(origin: Vector, direction: Vector, centre: Vector, radius: Scalar):
    """Length to the chord's middle, and the square of half the chord."""
    towards = centre - origin
    along = jnp.sum(towards * direction)
    miss = towards - along * direction
    return along, radius**2 - jnp.sum(miss**2)


def _length(vector: Float[Array, "n"]) -> Float[Array, ""]:
    return jnp.sqrt(jnp.sum(vector**2))
