"""One compiled Levenberg–Marquardt solve for all lenses and targets."""

import equinox as eqx
import jax
import jax.numpy as jnp
import lineax as lx
import optimistix as optx
from jaxtyping import Array, Bool, Float

from jaxsfs.calibration._problem import Problem, residuals


class Solution(eqx.Module):
    """`parameters`, the unweighted `residual` in px per observation, the `jacobian` of the weighted residuals
    (residual · weight/noise) and whether the solver succeeded."""

    parameters: Float[Array, " size"]
    residual: Float[Array, "count parts"]
    jacobian: Float[Array, "count parts size"]
    success: Bool[Array, ""]
    steps: Array


@eqx.filter_jit
def solve(problem: Problem, start: Float[Array, " size"], noise: Float[Array, ""]) -> Solution:
    """Minimises Σ w²|residual/noise|² + Σ (prior weight · (parameter − prior))² from `start`.

    Residuals are divided by the noise (px) first, so that priors (in their own units) weigh what they say.
    """

    def full(parameters):
        return jnp.where(problem.free, parameters, start)

    def weighted(parameters, _):
        return residuals(problem, full(parameters)) * (problem.observations.weight / noise)[:, None]

    def objective(parameters, _):
        held = problem.prior_weight * (full(parameters) - problem.prior)
        frozen = jnp.where(problem.free, 0.0, parameters - start)
        return weighted(parameters, None).reshape(-1), held, frozen

    # the normal equations: QR of a tall matrix starts threads that fight with others for the cores
    solver = optx.LevenbergMarquardt(rtol=1e-6, atol=1e-6, linear_solver=lx.Normal(lx.Cholesky()))
    found = optx.least_squares(objective, solver, start, options={"jac": "fwd"}, max_steps=60, throw=False)
    parameters = full(found.value)
    jacobian = jax.jacfwd(weighted)(parameters, None)
    residual = residuals(problem, parameters)
    finite = jnp.all(jnp.isfinite(parameters)) & jnp.all(jnp.isfinite(residual)) & jnp.all(jnp.isfinite(jacobian))
    # out of steps is not out of hope: flexible lenses creep along directions that the data hardly feel
    ended = (found.result == optx.RESULTS.successful) | (found.result == optx.RESULTS.nonlinear_max_steps_reached)
    success = ended & finite
    return Solution(parameters, residual, jacobian, success, found.stats["num_steps"])
