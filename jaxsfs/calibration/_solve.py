"""One compiled Levenberg–Marquardt solve for all lenses, and for all photographs of one kind of target."""

from functools import partial

import equinox as eqx
import jax
import jax.numpy as jnp
import lineax as lx
import optimistix as optx
from jaxtyping import Array, Bool, Float, Int

from jaxsfs.calibration._problem import Problem
from jaxsfs.calibration._residuals import look, residuals

_STRIDE = 300.0  # conditional sds in a unit step of the solver: its first damping is 1/_STRIDE²
_STEPS = 60
_TOLERANCE = 0.05 / _STRIDE


class Solution(eqx.Module):
    """`parameters`, whether the solver succeeded, and its steps."""

    parameters: Float[Array, " size"]
    success: Bool[Array, ""]
    steps: Int[Array, ""]


# Kernels are small and many: with care or with fusion emitters, compiling them would take most of a cold start.
# (Later versions know no other emitters and refuse the option.)
_COMPILER: dict[str, str | int | bool] = {"xla_backend_optimization_level": 1}
if jax.__version_info__ < (0, 11):
    _COMPILER["xla_cpu_use_fusion_emitters"] = False


@partial(eqx.filter_jit, compiler_options=_COMPILER)  # pyright: ignore
def solve(
    problem: Problem, start: Float[Array, " size"], scale: Float[Array, " size"], noise: Float[Array, ""]
) -> Solution:
    """Minimises Σ w²|residual/noise|² + Σ (prior weight · (parameter − prior))² from `start`.

    Residuals are divided by the noise (px) first, so that priors (in their own units) weigh what they say. The solver
    moves y = (parameters − start)/scale: with conditional sds as scales no unit is favoured, and its tolerance is a
    share of an sd.
    """
    scale = _STRIDE * scale
    begin = jnp.zeros_like(start)
    # to a jaxpr once: the solver asks for it in several places, and formulas are slow to trace
    converted = eqx.filter_closure_convert(partial(_value_and_jacobian, problem, start, scale, noise), begin)
    linearised = jax.jit(lambda y: converted(y))

    def weighted_residuals(y, _):
        held = jax.lax.stop_gradient(y)
        value, jacobian = linearised(held)
        return value + jacobian @ (y - held)  # the derivative is known: nothing is to be differentiated

    found = optx.least_squares(
        weighted_residuals, _solver(), begin, options={"jac": "fwd"}, max_steps=_STEPS, throw=False
    )
    # out of steps is not out of hope: flexible lenses creep along directions that the data hardly feel
    ended = (found.result == optx.RESULTS.successful) | (found.result == optx.RESULTS.nonlinear_max_steps_reached)
    return Solution(start + jnp.where(problem.free, scale * found.value, 0.0), ended, found.stats["num_steps"])


def _value_and_jacobian(
    problem: Problem,
    start: Float[Array, " size"],
    scale: Float[Array, " size"],
    noise: Float[Array, ""],
    y: Float[Array, " size"],
) -> tuple[Float[Array, " rows"], Float[Array, "rows size"]]:
    """Weighted residuals with the priors' below them, and their derivatives by y; parameters that are not free are
    held by y = 0."""
    o, free = problem.observations, problem.free
    weight, parameters = (o.weight / noise)[:, None], start + jnp.where(free, scale * y, 0.0)
    residual, jacobian = residuals(o, parameters, look(o, parameters), problem.metric)
    held = jnp.where(free, problem.prior_weight * (parameters - problem.prior), y)
    by_data = weight[..., None] * jacobian * jnp.where(free, scale, 0.0)[None, None]
    by_held = jnp.diag(jnp.where(free, problem.prior_weight * scale, 1.0))
    value = jnp.concatenate([(weight * residual).ravel(), held])
    return value, jnp.concatenate([by_data.reshape(-1, len(start)), by_held])


def _solver() -> optx.LevenbergMarquardt:
    """Levenberg–Marquardt that trusts a step once it went mostly as predicted: with the usual 99 % it creeps along
    directions that the data hardly feel."""
    # the normal equations: QR of a tall matrix starts threads that fight with others for the cores
    solver = optx.LevenbergMarquardt(rtol=1e-5, atol=_TOLERANCE, linear_solver=lx.Normal(lx.Cholesky()))
    trusting = optx.ClassicalTrustRegion(high_cutoff=0.6, high_constant=8.0)
    return eqx.tree_at(lambda one: one.search, solver, trusting)
