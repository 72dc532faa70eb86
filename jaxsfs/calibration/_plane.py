"""The pose of a flat target before the camera."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxsfs._arrays import AnyArray, module_of
from jaxsfs.forms import Scalar

Vectors = Float[AnyArray, "... 3"]


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


def pose_from(view: Float[np.ndarray, "6"]) -> PlanePose:
    """The pose that six numbers stand for: rotation (3), offset (2), ln height."""
    return PlanePose(jnp.asarray(view[:3]), jnp.asarray(view[3:5]), float(np.exp(view[5])))


def points_on_plane(
    view: Float[np.ndarray, "6"], rays: Float[np.ndarray, "count 3"]
) -> tuple[Float[np.ndarray, "count 2"], Float[np.ndarray, " count"]]:
    """`PlanePose.on_target` and `facing` of many rays, on the host, for the six numbers of a pose."""
    local = rotate(-view[:3], rays)
    return np.exp(view[5]) * local[:, :2] / np.maximum(local[:, 2:], 1e-2) - view[3:5], local[:, 2]


def rotate(rotation: Vectors, vector: Vectors) -> Vectors:
    """exp([rotation]×)·vector by Rodrigues' formula, in numpy for numpy arrays; smooth at rotation 0."""
    xp = module_of(vector)
    angle = xp.sqrt(xp.sum(rotation**2, axis=-1) + 1e-16)
    (ax, ay, az), (x, y, z) = (_parts(v) for v in (rotation, vector))
    ax, ay, az = ax / angle, ay / angle, az / angle
    sine, cosine = xp.sin(angle), xp.cos(angle)
    along = (ax * x + ay * y + az * z) * (1 - cosine)
    turned = (
        x * cosine + (ay * z - az * y) * sine + ax * along,
        y * cosine + (az * x - ax * z) * sine + ay * along,
        z * cosine + (ax * y - ay * x) * sine + az * along,
    )
    return xp.stack(turned, axis=-1)


def by_rotation(rotation: Vectors, moment: Vectors) -> Vectors:
    """∂F/∂rotation of an F that a further small turn ε of exp([rotation]×) changes by moment·ε: Jᵀ·moment, J the left
    Jacobian of SO(3)."""
    xp = module_of(moment)
    square = xp.sum(rotation**2, axis=-1, keepdims=True) + 1e-12
    angle = xp.sqrt(square)
    once = xp.cross(rotation, moment)
    by_once, by_twice = (1 - xp.cos(angle)) / square, (angle - xp.sin(angle)) / (square * angle)
    return moment - by_once * once + by_twice * xp.cross(rotation, once)


def _parts(vector: Vectors):
    return vector[..., 0], vector[..., 1], vector[..., 2]


def tilted(tilt_deg: float, direction_deg: float, height: float, offset=(0.0, 0.0), roll_deg: float = 0.0) -> PlanePose:
    """A pose from angles in degrees: roll about the optical axis, then a tilt about the axis at `direction_deg`
    in the image plane; `offset` and `height` in mm."""
    direction, tilt = np.deg2rad(direction_deg), np.deg2rad(tilt_deg)
    lean = tilt * np.array([np.cos(direction), np.sin(direction), 0.0])
    turn = np.array([0.0, 0.0, 1.0]) * np.deg2rad(roll_deg)
    columns = [rotate(lean, rotate(turn, unit)) for unit in np.eye(3)]
    rotation = rotation_vector(np.stack(columns, axis=1))
    return PlanePose(jnp.asarray(rotation, float), jnp.asarray(offset, float), height)


def rotation_vector(matrix: Float[AnyArray, "3 3"]) -> Vectors:
    """The rotation vector of a rotation matrix with angle < 180°, in numpy for numpy arrays."""
    xp = module_of(matrix)
    skew = xp.stack([matrix[2, 1] - matrix[1, 2], matrix[0, 2] - matrix[2, 0], matrix[1, 0] - matrix[0, 1]]) / 2
    sine = xp.sqrt(xp.sum(skew**2))
    angle = xp.arctan2(sine, (xp.trace(matrix) - 1) / 2)
    return skew * xp.where(sine > 1e-12, angle / xp.maximum(sine, 1e-12), 1.0)
