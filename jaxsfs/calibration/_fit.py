"""Robust fit of one lens model to one set of observations."""

import dataclasses

import jax
import numpy as np
from jaxtyping import Bool, Float

from jaxsfs.calibration._lens import ASPECT, LENS_SIZE, SHAPE, camera_of, lens_named, rays
from jaxsfs.calibration._plane import PlanePose, points_on_plane, pose_from
from jaxsfs.calibration._problem import VIEW_SIZE, VIEWS_AT, Observations, Problem, Rows, padded, weighted
from jaxsfs.calibration._residuals import look, metric, residuals
from jaxsfs.calibration._solve import solve
from jaxsfs.camera import AbstractCentralCamera

CULL = 3.5  # robust standard deviations
_SETTLED = 0.003  # of the rows: what culling may still change
_NOISE_FLOOR = 0.01  # px
_LONGEST = 100.0  # f over the image width, at most
_HOLDS = 3  # solves of lines, at most, each with the metric where the one before ended
_GAIN = 0.1  # of χ²: less is not worth another


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

    def view(self, index: int) -> Float[np.ndarray, "6"]:
        """The six numbers of a photograph's pose."""
        at = VIEWS_AT + VIEW_SIZE * index
        return self.parameters[at : at + VIEW_SIZE]

    def pose(self, index: int) -> PlanePose:
        return pose_from(self.view(index))


def observed(fitted: "Fit") -> Observations:
    """The observations as the fit weighed them."""
    setup = fitted.setup
    weight = fitted.weight * setup.scale
    return weighted(setup.observations, weight, lens_named(fitted.name).build, setup.kind, setup.groups)


def rays_of(fitted: "Fit", pixel: Float[np.ndarray, "count 2"]) -> Float[np.ndarray, "count 3"]:
    """Unit rays of the pixels."""
    return lens_rays(fitted.name, fitted.parameters[:LENS_SIZE], pixel)


def lens_rays(
    name: str, lens: Float[np.ndarray, "8"], pixel: Float[np.ndarray, "count 2"]
) -> Float[np.ndarray, "count 3"]:
    """Unit rays of the pixels for a parameter vector."""
    return np.asarray(rays(lens_named(name).build, lens, pixel).ray)


def plane_points(fitted: "Fit", pixel: Float[np.ndarray, "count 2"], view: int = 0) -> Float[np.ndarray, "count 2"]:
    """Target coordinates (mm) that the pixels see on the fitted plane of a photograph."""
    return points_on_plane(fitted.view(view), rays_of(fitted, pixel))[0]


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
    """Levenberg–Marquardt with culling at 3.5 robust sd and refits, until the kept rows hardly change.

    `weight` 0 excludes rows from the start; `noise` is a first guess of the residuals' sd in px.
    """
    allowed = np.ones(len(setup.observations.group)) if weight is None else weight.astype(float)
    kept, parameters = allowed.copy(), start.copy()
    _clear_shape(name, parameters)
    solution = _solve(name, setup, parameters, kept, noise)
    for turn in range(rounds):
        if turn:
            solution = _solve(name, setup, parameters, kept, noise)
        if not solution.success:
            break
        parameters = solution.parameters
        residual = solution.residual
        residual = residual * setup.scale[:, None]
        new_noise = max(robust_sd(residual[kept > 0]), _NOISE_FLOOR)
        distance = np.sqrt(np.mean(residual**2, axis=1))
        near = allowed * (distance < CULL * new_noise)
        settled = np.mean(near != kept) <= _SETTLED and abs(new_noise / noise - 1) < 0.2
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


@dataclasses.dataclass(frozen=True)
class _Solved:
    """Parameters with their unweighted residuals in px and the Jacobian of residual · weight/noise."""

    parameters: Float[np.ndarray, " size"]
    residual: Float[np.ndarray, "count parts"]
    jacobian: Float[np.ndarray, "count parts size"]
    success: bool


def _solve(name: str, setup: Setup, start, weight, noise: float) -> _Solved:
    """Solves again while what a solve holds has changed: lines only, whose metric may pull a fit astray."""
    scaled = weight * setup.scale
    seen = weighted(setup.observations, scaled, lens_named(name).build, setup.kind, setup.groups)
    at = _at(seen, start, scaled / noise)
    parameters, success = start, False
    for _ in range(_HOLDS if setup.kind == "lines" else 1):
        scale = _conditional_sd(name, setup, at[2])
        before = _cost(setup, at[0], parameters, scaled / noise)
        parameters, success = _solve_held(name, setup, seen, at[1], parameters, scale, noise)
        at = _at(seen, parameters, scaled / noise)
        if not success or abs(_cost(setup, at[0], parameters, scaled / noise) - before) < _GAIN:
            break
    residual, _, jacobian = at
    finite = bool(np.isfinite(parameters).all() and np.isfinite(residual).all() and np.isfinite(jacobian).all())
    # with f → ∞ all rays become one, and fit any line
    sane = finite and bool(parameters[0] < np.log(_LONGEST * setup.size[0]))
    return _Solved(parameters, residual, jacobian, success and sane)


def _cost(setup: Setup, residual, parameters, factor) -> float:
    """χ² with the priors."""
    data = np.sum((residual * factor[:, None]) ** 2)
    return float(data + np.sum(((parameters - setup.prior) / setup.prior_sd) ** 2))


def _conditional_sd(name: str, setup: Setup, jacobian) -> Float[np.ndarray, " size"]:
    """sd of each free parameter if the others were known; 1 for those held."""
    free, prior_weight = free_for(name, setup), 1 / setup.prior_sd
    return np.where(free, 1 / np.sqrt(np.sum(jacobian**2, axis=(0, 1)) + prior_weight**2), 1.0)


def _solve_held(name: str, setup: Setup, seen: Observations, held, start, scale, noise: float):
    """Parameters and success of one compiled solve, its arrays padded to a few sizes."""
    views = max(1, 1 << (setup.views - 1).bit_length()) if setup.views else 0
    more = (0, VIEWS_AT + VIEW_SIZE * views - len(start))
    count = len(seen.weight)
    device, held = padded(seen, held, max(1024, 1 << (count - 1).bit_length()))
    parts = [np.pad(part, more) for part in (free_for(name, setup), setup.prior, 1 / setup.prior_sd, start, scale)]
    free, prior, prior_weight, begin, scale, divisor = jax.device_put([*parts, np.asarray(float(noise))])
    problem = Problem(device, held, free, prior, prior_weight)
    found = solve(problem, begin, scale, divisor)  # pyright: ignore[reportCallIssue] -- of a partial decorator
    return np.array(found.parameters)[: len(start)], bool(found.success)


def _at(seen: Observations, parameters, factor) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Residuals, metric, and Jacobian of the residuals times `factor`."""
    with np.errstate(all="ignore"):  # a fit that ran away is told by what is not finite
        rays = look(seen, parameters)
        held = metric(seen, parameters, rays)
        residual, jacobian = residuals(seen, parameters, rays, held)
    return residual, held, jacobian * factor[:, None, None]


def _as_fit(name: str, setup: Setup, solution: _Solved, weight, noise: float) -> Fit:
    parameters, residual = solution.parameters, solution.residual
    free = free_for(name, setup)
    jacobian = solution.jacobian
    # a failed fit has no covariance, but its failure must arrive where it is asked for
    usable = jacobian if solution.success else np.zeros_like(jacobian)
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
        success=solution.success,
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
