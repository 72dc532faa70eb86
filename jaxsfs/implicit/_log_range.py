"""ln r of an image as one traceable function."""

import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from jaxsfs.camera import AbstractCentralCamera
from jaxsfs.forms import Scalar
from jaxsfs.implicit._solve import solve
from jaxsfs.irradiance import Irradiance
from jaxsfs.reflectance import AbstractReflectance, Lambertian
from jaxsfs.shading import light_at_camera


def log_range(
    irradiance: Irradiance,
    camera: AbstractCentralCamera,
    *,
    albedo: Scalar = 1.0,
    reflectance: AbstractReflectance = Lambertian(),  # noqa: B008 (frozen)
    order: int = 2,
    max_rounds: int = 80,
    tolerance: float | None = None,
) -> tuple[Float[Array, "height width"], Bool[Array, "height width"]]:
    """w = ln r with E = ρ G(cos θ)/r² for the light at the camera, and where it is known (0 elsewhere).

    What `reconstruct` solves, without what it decides on the host (occluding contours, rim, status), so that it works
    under `jax.jit`, `jax.vmap`, `jax.jvp` and `jax.grad`. Derivatives by irradiance, albedo, and the parameters of
    camera and reflectance come from the implicit function theorem: about the cost of one more solution whatever the
    number of parameters (`grad`), memory of some tens of images whatever the number of rounds.

    `irradiance.valid` decides what is read and may not be traced through; its other pixels have derivative 0.
    `tolerance`: mean relative change of a round at which the sweeps stop (1e-9 in double precision, 1e-6 in single).
    """
    values = irradiance.values
    inside = irradiance.valid & camera.field(values.dtype) & jnp.isfinite(values) & (values > 0)
    shading = light_at_camera(jnp.where(inside, values, 1), inside, albedo, reflectance)
    if tolerance is None:
        tolerance = 1e-6 if values.dtype == jnp.float32 else 1e-9
    found = solve(
        shading,
        camera.inverse_metrics(values.dtype),
        inside,
        jnp.full(inside.shape, jnp.inf, values.dtype),
        order=order,
        max_rounds=max_rounds,
        tolerance=tolerance,
    )
    return jnp.where(found.reached, found.w + jnp.log(shading.unit), 0), found.reached
