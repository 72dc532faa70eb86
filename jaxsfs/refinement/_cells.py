"""The equation of the true lights between the pixels: one residual per square of four of them.

A box scheme: at the middle of four pixels w = ln r is their mean and its slopes are differences of their pairs, both
of second order with the smallest stencil, so that no wave but the chequerboard goes unseen (the prior sees that one).
"""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from jaxsfs.forms import Scalar
from jaxsfs.irradiance import Irradiance
from jaxsfs.lights import Lights, shade_lights
from jaxsfs.reflectance import AbstractReflectance
from jaxsfs.surface import Surface

Image = Float[Array, "height width"]
Grid = Float[Array, "rows columns"]
Vectors = Float[Array, "rows columns 3"]

_DARKEST = 1e-3  # share of the irradiance that the model is not below: ln 0 where a trial surface turns from all lights


class Cells(eqx.Module):
    """Squares of four pixels, (height − 1) × (width − 1): unit `ray` through their middle and its derivatives by the
    pixel, mean ln E, and whether all four pixels have a surface and light."""

    ray: Vectors
    ray_u: Vectors
    ray_v: Vectors
    log_irradiance: Grid
    used: Bool[Array, "rows columns"]


class Model(eqx.Module):
    """What turns w and its slopes into ln E."""

    lights: Lights
    reflectance: AbstractReflectance
    albedo: Scalar


def cells_of(surface: Surface, irradiance: Irradiance) -> Cells:
    """The cells of the pixels that have a surface and light."""
    camera, dtype = surface.camera, surface.range.dtype
    lit = surface.valid & irradiance.valid & (irradiance.values > 0)
    log = jnp.where(lit, jnp.log(jnp.where(lit, irradiance.values, 1)), 0)
    used = lit[:-1, :-1] & lit[:-1, 1:] & lit[1:, :-1] & lit[1:, 1:]
    middle = camera.pixels(dtype)[:-1, :-1] + jnp.asarray(0.5, dtype)
    ray = jax.vmap(jax.vmap(camera.ray))(middle)
    slope = jax.vmap(jax.vmap(jax.jacfwd(camera.ray)))(middle)
    return Cells(ray, slope[..., 0], slope[..., 1], box(log)[0], used)


def box(w: Image) -> tuple[Grid, Grid, Grid]:
    """Mean, ∂u and ∂v of w at the middle of every four pixels."""
    a, b, c, d = w[:-1, :-1], w[:-1, 1:], w[1:, :-1], w[1:, 1:]
    return (a + b + c + d) / 4, (b + d - a - c) / 2, (c + d - a - b) / 2


def residual(w: Image, cells: Cells, model: Model) -> Grid:
    """ln E_model(w) − ln E per cell; 0 where a cell is not used.

    In logarithms the equation is nearly linear in w (−2w for the distance), every pixel weighs alike, and the albedo
    is one constant.
    """
    mean, w_u, w_v = box(w)
    return jnp.where(cells.used, log_irradiance(mean, w_u, w_v, cells, model) - cells.log_irradiance, 0)


@jax.custom_jvp
def log_irradiance(mean: Grid, w_u: Grid, w_v: Grid, cells: Cells, model: Model) -> Grid:
    """ln E of the surface element e^w d with slopes ∂w: normal ∝ −(∂_u d + ∂_u w d) × (∂_v d + ∂_v w d)."""
    across = jnp.cross(cells.ray_u + w_u[..., None] * cells.ray, cells.ray_v + w_v[..., None] * cells.ray)
    normal = -across / jnp.sqrt(jnp.sum(across**2, axis=-1, keepdims=True) + 1e-30)
    points = jnp.exp(mean)[..., None] * cells.ray
    lit = shade_lights(points, normal, model.lights, reflectance=model.reflectance, albedo=model.albedo)
    return jnp.log(jnp.maximum(lit, _DARKEST * jnp.exp(cells.log_irradiance)))


@log_irradiance.defjvp
def _log_irradiance_jvp(primals, tangents):
    """Three factors per cell, so that a product with the Jacobian is a stencil and does not visit the lights again.
    Cells and model are data: only w is differentiated."""
    point, rest = primals[:3], primals[3:]
    one, zero = jnp.ones_like(point[0]), jnp.zeros_like(point[0])

    def function(*w):
        return log_irradiance.fun(*w, *rest)

    value, at_mean = jax.jvp(function, point, (one, zero, zero))
    _, at_u = jax.jvp(function, point, (zero, one, zero))
    _, at_v = jax.jvp(function, point, (zero, zero, one))
    return value, at_mean * tangents[0] + at_u * tangents[1] + at_v * tangents[2]
