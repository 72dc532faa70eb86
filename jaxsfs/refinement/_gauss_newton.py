"""All pixels at once: the equation of the true lights as least squares in w = ln r, without a matrix."""

from functools import partial

import equinox as eqx
import jax
import jax.numpy as jnp
import lineax as lx
import optimistix as optx
from jaxtyping import Array, Bool, Float, Int

from jaxsfs.forms import Scalar
from jaxsfs.irradiance import Irradiance
from jaxsfs.lights import Lights
from jaxsfs.refinement._cells import Cells, Model, cells_of, residual
from jaxsfs.reflectance import AbstractReflectance
from jaxsfs.surface import Surface

Image = Float[Array, "height width"]

_UNEXPLAINED = 0.3  # |ln E_model − ln E| of a start that has a jump there: nothing is differenced across it


class Polish(eqx.Module):
    """`surface`; `before`, `after`: root mean square of ln E_model − ln E over the cells; `steps` taken."""

    surface: Surface
    before: Float[Array, ""]
    after: Float[Array, ""]
    steps: Int[Array, ""]


@partial(jax.jit, static_argnames=("steps", "inner"))
def polish(
    surface: Surface,
    irradiance: Irradiance,
    lights: Lights,
    *,
    reflectance: AbstractReflectance,
    albedo: Scalar,
    smoothness: Scalar = 0.04,
    steps: int = 6,
    inner: int = 60,
) -> Polish:
    """Minimises Σ (ln E_lights(w) − ln E)² + Σ (s p ∂²w)² over w = ln r from a `surface` near the solution.

    Levenberg–Marquardt with at most `steps` steps of `inner` conjugate gradients each. s is `smoothness`, p the pixels
    per radian, ∂² the second difference along rows and columns: so the prior weighs a surface's bends alike at
    all resolutions (both sums count pixels). Squares that the start does not explain within 30 % are left out, as are
    bends across them: there the surface jumps.
    """
    precision = jnp.result_type(float)  # optimistix keeps its damping in the default one, and so must w be
    given, dtype = surface, surface.range.dtype
    surface = eqx.tree_at(lambda s: s.range, surface, surface.range.astype(precision))
    irradiance = eqx.tree_at(lambda e: e.values, irradiance, irradiance.values.astype(precision))
    valid = surface.valid
    start = jnp.where(valid, jnp.log(jnp.where(valid, surface.range, 1)), 0)
    model = Model(lights, reflectance, jnp.asarray(albedo, precision))
    cells = cells_of(surface, irradiance)
    misfit = residual(start, cells, model)
    jump = cells.used & (jnp.abs(misfit) > _UNEXPLAINED)
    cells = eqx.tree_at(lambda c: c.used, cells, cells.used & ~jump)
    bendable = _bendable(valid, jump)
    weight = smoothness * jnp.sqrt(_pixels_per_radian_squared(cells))

    def objective(w, _):
        bends = jnp.where(bendable[0], _bend(w), 0), jnp.where(bendable[1], _bend(w.T), 0)
        return residual(w, cells, model), *(weight * bend for bend in bends)

    # a fixed number of conjugate gradients: the slow rest is left to the next linearisation
    linear = lx.Normal(lx.CG(rtol=0.0, atol=0.0, max_steps=inner, stabilise_every=None))
    solver = optx.LevenbergMarquardt(rtol=1e-4, atol=1e-4, linear_solver=linear)
    found = optx.least_squares(objective, solver, start, max_steps=steps, throw=False)
    w = jnp.where(jnp.all(jnp.isfinite(found.value)), found.value, start)
    before, after = (_rms(residual(x, cells, model), cells.used) for x in (start, w))
    polished = Surface(given.camera, jnp.where(valid, jnp.exp(w).astype(dtype), given.range), valid, given.contours)
    return Polish(polished, before, after, jnp.asarray(found.stats["num_steps"]))


def _bend(w: Image) -> Float[Array, "height columns"]:
    return w[:, 2:] - 2 * w[:, 1:-1] + w[:, :-2]


def _bendable(valid: Bool[Array, "height width"], jump: Bool[Array, "rows columns"]):
    """Triples of pixels in a row, and in a column (transposed), that no jump touches."""
    corners = ((0, 1), (1, 0))
    touched = jnp.any(jnp.stack([jnp.pad(jump, (rows, columns)) for rows in corners for columns in corners]), axis=0)
    smooth = valid & ~touched
    return tuple(ok[:, 2:] & ok[:, 1:-1] & ok[:, :-2] for ok in (smooth, smooth.T))


def _pixels_per_radian_squared(cells: Cells) -> Float[Array, ""]:
    per_pixel = jnp.sum(cells.ray_u**2 + cells.ray_v**2, axis=-1) / 2
    return 1 / jnp.mean(per_pixel, where=cells.used)


def _rms(values: Float[Array, "rows columns"], used: Bool[Array, "rows columns"]) -> Float[Array, ""]:
    return jnp.sqrt(jnp.mean(values**2, where=used))
