"""Robust fit of one lens model to one set of observations."""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from jaxsfs.calibration._lens import ASPECT, LENS_SIZE, SHAPE, camera_of, lens_named, rays_and_slopes
from jaxsfs.calibration._plane import PlanePose
from jaxsfs.calibration._problem import VIEW_SIZE, VIEWS_AT, Problem, Rows, pad, pose_from
from jaxsfs.calibration._solve import Solution, solve
from jaxsfs.camera import AbstractCentralCamera

CULL = 3.5  # robust standard deviations
_NOISE_FLOOR = 0.01  # px


@dataclasses.dataclass(frozen=True)
class Setup:
    """What is fitted: the observations, which parameters are free, and the priors on them.

    `systematic` one sd in px of an error that all of them share (rows ×
    parts). `prior_sd` is inf for no prior. `size` is (width, height) in px;
    `views` the number of photographs with a pose (0 for lines), `groups` the number of lines (1 otherwise).
    `precision` of every row: typical sd over the row's own, 1 by default.
    """

    kind: str
    observations: Rows
    size: tuple[int, int]
    views: int
    groups: int
    free: Bool[np.ndarray, " size"]
    prior: Float[np.ndarray, " size"]
    prior_sd: Float[np.ndarray, " size"]
    systematic: Float[np.ndarray, "count parts"]
    aspect: bool = False
    precision: Float[np.ndarray, " count"] | None = None

    @property
    def scale(self) -> Float[np.ndarray, " count"]:
        """`precision`, or ones."""
        return np.ones(len(self.observations.group)) if self.precision is None else self.precision


@dataclasses.dataclass(frozen=True)
class Fit:
    """A lens model fitted to a `Setup`.

    `parameters` (lens, extra, views), `residual` in px (rows × parts) with `weight` 0 for culled rows, `noise` the
    robust sd in px of a residual of precision 1, `jacobian` of residual · weight · precision/noise, `covariance` of
    the free parameters, (JᵀJ)⁺ with the priors in it, `condition` of JᵀJ scaled to unit diagonal.
    """

    name: str
    setup: Setup
    parameters: Float[np.ndarray, " size"]
    residual: Float[np.ndarray, "count parts"]
    weight: Float[np.ndarray, " count"]
    noise: float
    jacobian: Float[np.ndarray, "count parts size"]
    covariance: Float[np.ndarray, "size size"]
    condition: float
    success: bool

    @property
    def camera(self) -> AbstractCentralCamera:
        return camera_of(self.name, self.parameters[:LENS_SIZE], *self.setup.size)

    @property
    def f(self) -> float:
        return float(np.exp(self.parameters[0]))

    @property
    def standardised(self) -> Float[np.ndarray, "count parts"]:
        """residual · precision/noise: of sd 1 if the noise is what it is taken for."""
        return self.residual * self.setup.scale[:, None] / self.noise

    @property
    def rms(self) -> float:
        """Root mean square distance in px over the rows that were kept."""
        square = np.sum(self.residual**2, axis=1)
        return float(np.sqrt(np.sum(self.weight * square) / max(np.sum(self.weight), 1)))

    def pose(self, view: int) -> PlanePose:
        at = VIEWS_AT + VIEW_SIZE * view
        return pose_from(jnp.asarray(self.parameters[at : at + VIEW_SIZE]))


def rays_of(fitted: "Fit", pixel: Float[np.ndarray, "count 2"]) -> Float[np.ndarray, "count 3"]:
    """Unit rays of the pixels."""
    return lens_rays(fitted.name, fitted.parameters[:LENS_SIZE], pixel)


def lens_rays(
    name: str, lens: Float[np.ndarray, "8"], pixel: Float[np.ndarray, "count 2"]
) -> Float[np.ndarray, "count 3"]:
    """Unit rays of the pixels for a parameter vector."""
    return _padded_call(_rays, name, lens, pixel)


def plane_points(fitted: "Fit", pixel: Float[np.ndarray, "count 2"], view: int = 0) -> Float[np.ndarray, "count 2"]:
    """Target coordinates (mm) that the pixels see on the fitted plane of a photograph."""
    return _padded_call(_on_plane, fitted.name, fitted.parameters[:LENS_SIZE], pixel, fitted.pose(view))


def _padded_call(function, name: str, lens, pixel: Float[np.ndarray, "count 2"], *more) -> np.ndarray:
    size = max(1024, 1 << (len(pixel) - 1).bit_length())
    padded = jnp.asarray(np.concatenate([pixel, np.repeat(pixel[:1], size - len(pixel), axis=0)]))
    build = jnp.asarray(lens_named(name).build)
    return np.array(function(build, jnp.asarray(lens), padded, *more))[: len(pixel)]


@eqx.filter_jit
def _rays(build, lens, pixels: Float[Array, "count 2"]) -> Float[Array, "count 3"]:
    return rays_and_slopes(build, lens, pixels)[0]


@eqx.filter_jit
def _on_plane(build, lens, pixels: Float[Array, "count 2"], pose: PlanePose) -> Float[Array, "count 2"]:
    return jax.vmap(pose.on_target)(rays_and_slopes(build, lens, pixels)[0])


def free_for(name: str, setup: Setup) -> Bool[np.ndarray, " size"]:
    """The setup's free parameters with the shape parameters that the lens model has."""
    free = setup.free.copy()
    free[ASPECT] = setup.aspect
    free[SHAPE:LENS_SIZE] = np.arange(LENS_SIZE - SHAPE) < lens_named(name).shapes
    return free


def fit(
    name: str,
    setup: Setup,
    start: Float[np.ndarray, " size"],
    weight: Float[np.ndarray, " count"] | None = None,
    rounds: int = 4,
    noise: float = 0.3,
) -> Fit:
    """Levenberg–Marquardt with culling at 3.5 robust sd and refits, until the kept rows no longer change.

    `weight` 0 excludes rows from the start; `noise` is a first guess of the residuals' sd in px.
    """
    allowed = np.ones(len(setup.observations.group)) if weight is None else weight.astype(float)
    kept, parameters = allowed.copy(), start.copy()
    _clear_shape(name, parameters)
    solution = _solve(name, setup, parameters, kept, noise)
    for turn in range(rounds):
        if turn:
            solution = _solve(name, setup, parameters, kept, noise)
        if not bool(solution.success):
            break
        parameters = np.array(solution.parameters)
        residual = np.array(solution.residual)
        residual = residual * setup.scale[:, None]
        new_noise = max(robust_sd(residual[kept > 0]), _NOISE_FLOOR)
        distance = np.sqrt(np.mean(residual**2, axis=1))
        near = allowed * (distance < CULL * new_noise)
        settled = np.array_equal(near, kept) and abs(new_noise / noise - 1) < 0.2
        noise = new_noise
        if settled or turn == rounds - 1:
            break
        kept = near if near.sum() > 0.4 * allowed.sum() else kept
    return _as_fit(name, setup, solution, kept, noise)


def _clear_shape(name: str, parameters: Float[np.ndarray, " size"]) -> None:
    """Sets shape parameters that the model does not have to 0, in place."""
    parameters[SHAPE + lens_named(name).shapes : LENS_SIZE] = 0.0


def robust_sd(residual: Float[np.ndarray, "..."]) -> float:
    """1.4826 times the median absolute value."""
    return float(1.4826 * np.median(np.abs(residual))) if residual.size else 0.0


def _solve(name: str, setup: Setup, start, weight, noise: float) -> Solution:
    count = len(weight)
    size = max(1024, 1 << (count - 1).bit_length())
    free = free_for(name, setup)
    views = max(1, 1 << (setup.views - 1).bit_length()) if setup.views else 0
    more = VIEWS_AT + VIEW_SIZE * views - len(start)
    problem = Problem(
        observations=pad(setup.observations, weight * setup.scale, size),
        build=jnp.asarray(lens_named(name).build),
        free=jnp.asarray(np.pad(free, (0, more))),
        prior=jnp.asarray(np.pad(setup.prior, (0, more))),
        prior_weight=jnp.asarray(np.pad(1 / setup.prior_sd, (0, more))),
        kind=setup.kind,
        groups=setup.groups,
    )
    found = solve(problem, jnp.asarray(np.pad(start, (0, more))), jnp.asarray(noise))
    cut = len(start)
    trimmed = Solution(
        found.parameters[:cut], found.residual[:count], found.jacobian[:count, :, :cut], found.success, found.steps
    )
    return jax.block_until_ready(trimmed)


def _as_fit(name: str, setup: Setup, solution: Solution, weight, noise: float) -> Fit:
    parameters, residual = np.array(solution.parameters), np.array(solution.residual)
    free = free_for(name, setup)
    jacobian = np.array(solution.jacobian)
    # a failed fit has no covariance, but its failure must arrive where it is asked for
    usable = jacobian if bool(solution.success) else np.zeros_like(jacobian)
    covariance, condition = _covariance(usable, weight, free, setup.prior_sd)
    return Fit(
        name=name,
        setup=setup,
        parameters=parameters,
        residual=residual,
        weight=weight,
        noise=noise,
        jacobian=jacobian,
        covariance=covariance,
        condition=condition,
        success=bool(solution.success),
    )


def _covariance(jacobian, weight, free, prior_sd) -> tuple[np.ndarray, float]:
    """(JᵀJ)⁺ over observations (already divided by the noise) and priors, and the condition number of JᵀJ scaled to
    unit diagonal."""
    kept = jacobian[weight > 0].reshape(-1, len(free))[:, free]
    normal = kept.T @ kept + np.diag(1 / prior_sd[free] ** 2)
    scale = 1 / np.sqrt(np.maximum(np.diag(normal), 1e-300))
    values, vectors = np.linalg.eigh(normal * np.outer(scale, scale))
    values = np.maximum(values, 1e-14)
    inverse = (vectors / values) @ vectors.T * np.outer(scale, scale)
    covariance = np.zeros((len(free), len(free)))
    covariance[np.ix_(free, free)] = inverse
    return covariance, float(values[-1] / values[0])
