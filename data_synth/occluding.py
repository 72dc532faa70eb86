"""Scenes in which a part hides another, so that range jumps: ball in a bowl, vase, polyps, folded colon."""

from typing import ClassVar

import jax.numpy as jnp
from jaxtyping import Array, Float

from data_synth.scene import AbstractScene, Vector
from data_synth.smooth import Ball, HollowBall, Plane
from data_synth.tracing import trace
from jaxsfs.forms import Scalar


class BallInBowl(AbstractScene):
    """Ball of `radius` about (x, y, z) in front of a bowl: the inside of a sphere of `bowl` radius about
    (0, 0, bowl_z). The limb is the cone of rays at asin(radius/|centre|) from the ball's centre."""

    occludes: ClassVar[bool] = True

    radius: Scalar = 0.45
    x: Scalar = 0.25
    y: Scalar = -0.1
    z: Scalar = 1.5
    bowl: Scalar = 2.0
    bowl_z: Scalar = 0.6

    def clearance(self, point: Vector) -> Float[Array, ""]:
        return jnp.minimum(self._ball().clearance(point), self._hollow().clearance(point))

    def distance(self, origin: Vector, direction: Vector) -> Float[Array, ""]:
        return jnp.minimum(self._ball().distance(origin, direction), self._hollow().distance(origin, direction))

    def _ball(self) -> Ball:
        return Ball(self.radius, self.x, self.y, self.z)

    def _hollow(self) -> HollowBall:
        return HollowBall(self.bowl, 0.0, 0.0, self.bowl_z)


class Vase(AbstractScene):
    """Vase of revolution about the vertical line (0, ·, `z`), in front of the plane at `z`:
    z_vase = z − √(f(y)² − x²), f(y) = 0.15 − 0.1 y (6y + 1)² (y − 1)² (3y − 2), 0 ≤ y ≤ 1 upwards,
    y = ½ − (camera's y), and a cylinder beyond.

    Source: Zhang, Tsai, Cryer & Shah 1999 (after Ascher & Carter 1993), whose camera is orthographic with a distant
    frontal light; a central camera sees the same body.
    """

    occludes: ClassVar[bool] = True

    z: Scalar = 1.0

    def clearance(self, point: Vector) -> Float[Array, ""]:
        x, y, z = point
        # |f'| is at most 0.64, and √(1 + 0.64²) < 1.19: divided by that, the slope is below 1
        body = (jnp.sqrt(x**2 + (z - self.z) ** 2) - vase_radius(0.5 - y)) / 1.19
        return jnp.minimum(body, self.z - z)

    def distance(self, origin: Vector, direction: Vector) -> Float[Array, ""]:
        return trace(self.clearance, origin, direction, reach=20.0)


def vase_radius(y: Float[Array, "*shape"]) -> Float[Array, "*shape"]:
    """f(y) of the survey's vase, constant outside 0 ≤ y ≤ 1."""
    y = jnp.clip(y, 0, 1)
    return 0.15 - 0.1 * y * (6 * y + 1) ** 2 * (y - 1) ** 2 * (3 * y - 2)


class PolypWall(AbstractScene):
    """Wall z = h + slope_x x + slope_y y that carries polyps: balls blended into it by a smooth minimum.

    `polyps`: one (x, y, lift, radius) each; the ball's centre lies `lift` in front of the wall, so lift > 0 gives
    an overhang. `blend`: width of the transition in scene units.
    """

    occludes: ClassVar[bool] = True

    polyps: tuple[tuple[Scalar, Scalar, Scalar, Scalar], ...] = ((0.35, -0.2, 0.22, 0.3), (-0.45, 0.3, 0.12, 0.22))
    h: Scalar = 1.5
    slope_x: Scalar = 0.15
    slope_y: Scalar = -0.1
    blend: Scalar = 0.12

    def clearance(self, point: Vector) -> Float[Array, ""]:
        surface = Plane(self.h, self.slope_x, self.slope_y).clearance(point)
        for x, y, lift, radius in self.polyps:
            z = self.h + self.slope_x * x + self.slope_y * y - lift
            surface = smooth_minimum(surface, Ball(radius, x, y, z).clearance(point), self.blend)
        return surface

    def distance(self, origin: Vector, direction: Vector) -> Float[Array, ""]:
        return trace(self.clearance, origin, direction, reach=20.0)


class FoldedColon(AbstractScene):
    """Bent tube with ring folds that hide what lies behind them, closed by a flat end at z = `length`.

    Around the axis (bend (1 − cos(z/2)) − x₀, −y₀), with (X, Y) from the axis and ρ its length, the wall is at
    ρ = R (1 − depth · ridge · (¾ + ¼ (X³ − 3XY²)/R³)), ridge = exp(sharpness · (cos(2π(z − first + skew X)/spacing)
    − 1)): folds of three lobes, as between three taeniae.
    """

    occludes: ClassVar[bool] = True

    radius: Scalar = 1.0
    depth: Scalar = 0.3
    spacing: Scalar = 1.2
    first: Scalar = 1.3
    sharpness: Scalar = 3.0
    skew: Scalar = 0.2
    bend: Scalar = 0.35
    x0: Scalar = 0.15
    y0: Scalar = -0.1
    length: Scalar = 6.0

    def clearance(self, point: Vector) -> Float[Array, ""]:
        z = point[2]
        x = point[0] - self.bend * (1 - jnp.cos(z / 2)) + self.x0
        y = point[1] + self.y0
        turn = 2 * jnp.pi / self.spacing
        ridge = jnp.exp(self.sharpness * (jnp.cos(turn * (z - self.first + self.skew * x)) - 1))
        lobes = 0.75 + 0.25 * (x**3 - 3 * x * y**2) / self.radius**3
        wall = self.radius * (1 - self.depth * ridge * lobes) - jnp.sqrt(x**2 + y**2)
        return jnp.minimum(wall / self._steepest(), self.length - z)

    def distance(self, origin: Vector, direction: Vector) -> Float[Array, ""]:
        return trace(self.clearance, origin, direction, reach=20.0)

    def _steepest(self) -> Scalar:
        """A bound of the wall's slope inside the tube: across, 1 + ¾ depth and the skew's share of the ridge; along,
        the ridge, whose steepest slope is below 0.61 √sharpness · 2π/spacing; the whole leaning with the axis."""
        slope = 0.61 * jnp.sqrt(1.0 * self.sharpness) * 2 * jnp.pi / self.spacing
        ridge = slope * self.depth * self.radius
        across = 1 + 0.75 * self.depth + jnp.abs(self.skew * ridge)
        return jnp.sqrt(across**2 + ridge**2) * (1 + jnp.abs(0.5 * self.bend))


def smooth_minimum(a: Float[Array, ""], b: Float[Array, ""], width: Scalar) -> Float[Array, ""]:
    """min(a, b), rounded where |a − b| < width; its gradient is a convex combination of theirs, so never steeper."""
    overlap = jnp.maximum(width - jnp.abs(a - b), 0) / width
    return jnp.minimum(a, b) - 0.25 * width * overlap**2
