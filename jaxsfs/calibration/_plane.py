"""The pose of a flat target before the camera."""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxsfs.forms import Scalar


class PlanePose(eqx.Module):
    """Where a flat target lies: target point (X, Y) is seen at R·(X + offset_x, Y + offset_y, height).

    R = exp([rotation]×) in radians; `height` is the perpendicular distance of the projection centre from the plane
    and −`offset` the foot of that perpendicular on the target, both in the target's unit (mm).
    """

    rotation: Float[Array, "3"]
    offset: Float[Array, "2"]
    height: Scalar

    def to_camera(self, target_point: Float[Array, "2"]) -> Float[Array, "3"]:
        """The point of the camera frame (mm) of a target point (mm)."""
        height = jnp.asarray(self.height, target_point.dtype)
        return rotate(self.rotation, jnp.append(target_point + self.offset, height))

    def on_target(self, ray: Float[Array, "3"]) -> Float[Array, "2"]:
        """Where a ray meets the plane, in target coordinates (mm). Rays that miss it are bent to just hit it,
        so the value is finite; ask `facing` first."""
        local = rotate(-self.rotation, ray)
        return self.height * local[:2] / jnp.maximum(local[2], 1e-2) - self.offset

    def facing(self, ray: Float[Array, "3"]) -> Float[Array, ""]:
        """n·d: cosine between the ray and the plane's normal; positive where the ray meets the plane."""
        return rotate(-self.rotation, ray)[2]

    def tilt(self) -> Float[Array, ""]:
        """Angle between the optical axis and the plane's normal, in radians."""
        axis = jnp.array([0.0, 0.0, 1.0], self.rotation.dtype)
        return jnp.arccos(jnp.clip(self.facing(axis), -1, 1))


def rotate(rotation: Float[Array, "3"], vector: Float[Array, "3"]) -> Float[Array, "3"]:
    """exp([rotation]×)·vector by Rodrigues' formula; smooth at rotation 0."""
    angle = jnp.sqrt(jnp.sum(rotation**2) + 1e-16)
    axis = rotation / angle
    turned = vector * jnp.cos(angle) + jnp.cross(axis, vector) * jnp.sin(angle)
    return turned + axis * jnp.dot(axis, vector) * (1 - jnp.cos(angle))


def tilted(tilt_deg: float, direction_deg: float, height: float, offset=(0.0, 0.0), roll_deg: float = 0.0) -> PlanePose:
    """A pose from angles in degrees: roll about the optical axis, then a tilt about the axis at `direction_deg`
    in the image plane; `offset` and `height` in mm."""
    roll = jnp.deg2rad(jnp.asarray(roll_deg, float))
    direction, tilt = jnp.deg2rad(jnp.asarray(direction_deg, float)), jnp.deg2rad(jnp.asarray(tilt_deg, float))
    lean = tilt * jnp.stack([jnp.cos(direction), jnp.sin(direction), jnp.zeros(())])
    turn = jnp.array([0.0, 0.0, 1.0]) * roll
    columns = [rotate(lean, rotate(turn, unit)) for unit in jnp.eye(3)]
    return PlanePose(rotation_vector(jnp.stack(columns, axis=1)), jnp.asarray(offset, float), height)


def rotation_vector(matrix: Float[Array, "3 3"]) -> Float[Array, "3"]:
    """The rotation vector of a rotation matrix with angle < 180°."""
    skew = jnp.stack([matrix[2, 1] - matrix[1, 2], matrix[0, 2] - matrix[2, 0], matrix[1, 0] - matrix[0, 1]]) / 2
    sine = jnp.sqrt(jnp.sum(skew**2))
    angle = jnp.arctan2(sine, (jnp.trace(matrix) - 1) / 2)
    return skew * jnp.where(sine > 1e-12, angle / jnp.maximum(sine, 1e-12), 1.0)
