"""The least-squares problems: parameters, priors and residuals in px, padded to fixed sizes.

Parameter vector: lens (8), extra (2), then 6 per photograph: rotation (3), offset (2), ln height. `extra` is
(line width in mm, –) for rings, the ln of the two target scales for points, unused for lines.
"""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from jaxsfs.calibration._lens import LENS_SIZE, ray_and_slope, rays_and_slopes
from jaxsfs.calibration._plane import PlanePose, rotate

EXTRA_SIZE, VIEW_SIZE = 2, 6
VIEWS_AT = LENS_SIZE + EXTRA_SIZE


@dataclasses.dataclass(frozen=True)
class Rows:
    """Image points of a target, one per row.

    `pixel`: measured (u, v). `target`: (X, Y) in mm for points; (radius of the printed ring in mm, 0) for rings;
    unused for lines. `polarity`: for ring edges +1 where dark lies inside, −1 where it lies outside. `shift`: px by
    which the seen edge lies further from the dark side than the printed one. `group`: index of the photograph, for
    lines index of the line.
    """

    pixel: Float[np.ndarray, "count 2"]
    target: Float[np.ndarray, "count 2"]
    polarity: Float[np.ndarray, " count"]
    shift: Float[np.ndarray, " count"]
    group: Int[np.ndarray, " count"]


class Observations(eqx.Module):
    """`Rows` on the device, padded to a fixed size with rows of `weight` 0."""

    pixel: Float[Array, "count 2"]
    target: Float[Array, "count 2"]
    polarity: Float[Array, " count"]
    shift: Float[Array, " count"]
    group: Int[Array, " count"]
    weight: Float[Array, " count"]


class Problem(eqx.Module):
    """Everything that one solve reads. `prior` and `prior_weight` (1/σ, 0 for none) hold parameters softly;
    those not `free` keep their start. `groups` bounds `observations.group` (padded; lines only)."""

    observations: Observations
    build: Int[Array, ""]
    free: Bool[Array, " size"]
    prior: Float[Array, " size"]
    prior_weight: Float[Array, " size"]
    kind: str = eqx.field(static=True)
    groups: int = eqx.field(static=True)


def residuals(problem: Problem, parameters: Float[Array, " size"]) -> Float[Array, "count parts"]:
    """Unweighted residuals in px: (u, v) of projected minus seen for points, one signed distance for rings/lines."""
    if problem.kind == "lines":
        return _lines(problem, parameters)
    return _local_residuals(problem, parameters)


@jax.custom_jvp
def _local_residuals(problem: Problem, parameters: Float[Array, " size"]) -> Float[Array, "count parts"]:
    """Residuals of points and rings: each depends on the lens, the extra parameters and its own photograph only."""
    local = _LOCAL[problem.kind]
    return jax.vmap(lambda *part: local(problem.build, *part), in_axes=(None, 0, 0))(*_arguments(problem, parameters))


@_local_residuals.defjvp
def _local_residuals_jvp(primals, tangents):
    """The Jacobian row by row in reverse mode (16 numbers a row), which costs a quarter of as many forward passes."""
    problem, parameters = primals
    shared, views, rows = _arguments(problem, parameters)
    local = _LOCAL[problem.kind]

    def with_value(shared, view, row):
        value = local(problem.build, shared, view, row)
        return value, value

    rows_of = jax.vmap(jax.jacrev(with_value, argnums=(0, 1), has_aux=True), in_axes=(None, 0, 0))
    (by_shared, by_view), value = rows_of(shared, views, rows)
    moved_shared, moved_views, _ = _arguments(problem, tangents[1])
    moved = jnp.einsum("npk,k->np", by_shared, moved_shared) + jnp.einsum("npk,nk->np", by_view, moved_views)
    return value, moved


def _arguments(problem: Problem, parameters: Float[Array, " size"]):
    """Lens and extra parameters, the photograph's parameters of every row, the rows."""
    views = parameters[VIEWS_AT:].reshape(-1, VIEW_SIZE)[problem.observations.group]
    return parameters[:VIEWS_AT], views, problem.observations


def pose_from(view: Float[Array, "6"]) -> PlanePose:
    """The pose that six parameters of a photograph stand for."""
    return PlanePose(view[:3], view[3:5], jnp.exp(view[5]))


def _point(
    build: Int[Array, ""], shared: Float[Array, "10"], view: Float[Array, "6"], o: Observations
) -> Float[Array, "2"]:
    """S (d* − d) with d the pixel's ray, d* the direction of the target point, S the pseudo-inverse of ∂d/∂pixel:
    the reprojection error to first order, without inverting the lens's profile."""
    ray, slope = ray_and_slope(build, shared[:LENS_SIZE], o.pixel)
    point = pose_from(view).to_camera(o.target * jnp.exp(shared[LENS_SIZE:]))
    gap = point / jnp.sqrt(jnp.sum(point**2)) - ray
    metric = slope.T @ slope
    determinant = metric[0, 0] * metric[1, 1] - metric[0, 1] ** 2
    a, b = slope.T @ gap
    return jnp.stack([metric[1, 1] * a - metric[0, 1] * b, metric[0, 0] * b - metric[0, 1] * a]) / determinant


def _ring(
    build: Int[Array, ""], shared: Float[Array, "10"], view: Float[Array, "6"], o: Observations
) -> Float[Array, "1"]:
    """(R(u, v) − R_k ∓ width/2)/|∇R| ∓ shift: the distance in px of the edge point from the printed edge's image.
    R is the radius on the paper of the point that the pixel sees."""
    ray, slope = ray_and_slope(build, shared[:LENS_SIZE], o.pixel)
    pose = pose_from(view)
    local = rotate(-pose.rotation, ray)
    depth = jnp.maximum(local[2], 1e-2)
    point = pose.height * local[:2] / depth - pose.offset
    radius = jnp.sqrt(jnp.sum(point**2) + 1e-12)
    towards = point / radius
    # ∂R/∂d in the plane's frame, turned back into the camera's
    fall = jnp.append(towards, -jnp.dot(towards, local[:2]) / depth) * pose.height / depth
    gradient = rotate(pose.rotation, fall) @ slope
    distance = (radius - o.target[0] - o.polarity * shared[LENS_SIZE] / 2) / jnp.sqrt(jnp.sum(gradient**2) + 1e-12)
    return (distance - o.polarity * o.shift)[None]


_LOCAL = {"points": _point, "rings": _ring}


def _lines(problem: Problem, parameters: Float[Array, " size"]) -> Float[Array, "count 1"]:
    """Sampson distance: (n·d)/|∇(n·d)| in px of the original image, n the normal of the line's best great circle,
    found from the rays themselves (smallest eigenvector of Σ w d dᵀ)."""
    o = problem.observations
    rays, slopes = rays_and_slopes(problem.build, parameters[:LENS_SIZE], o.pixel)
    spread = jax.ops.segment_sum(o.weight[:, None, None] * rays[:, :, None] * rays[:, None, :], o.group, problem.groups)
    # lines of fewer than three points have no normal: a harmless matrix with distinct eigenvalues, and no residual
    count = jax.ops.segment_sum(o.weight, o.group, problem.groups)
    spread = jnp.where((count >= 3)[:, None, None], spread, jnp.diag(jnp.array([1.0, 2.0, 3.0]))[None])
    normal = jnp.linalg.eigh(spread)[1][:, :, 0][o.group]
    gradient = jnp.einsum("ni,nij->nj", normal, slopes)
    distance = jnp.sum(normal * rays, axis=1) / jnp.sqrt(jnp.sum(gradient**2, axis=1) + 1e-18)
    return jnp.where(count[o.group] >= 3, distance, 0.0)[:, None]


def pad(rows: Rows, weight: Float[np.ndarray, " count"], size: int) -> Observations:
    """`rows` with padding of weight 0 up to `size` rows (copies of the first row, so every value is sane)."""
    count = len(weight)
    index = np.concatenate([np.arange(count), np.zeros(size - count, int)])
    return Observations(
        pixel=jnp.asarray(rows.pixel[index]),
        target=jnp.asarray(rows.target[index]),
        polarity=jnp.asarray(rows.polarity[index]),
        shift=jnp.asarray(rows.shift[index]),
        group=jnp.asarray(rows.group[index]),
        weight=jnp.asarray(np.pad(weight, (0, size - count))),
    )
