"""Warping between cameras: eqs. (14)–(15) for the spherical and the perspective one."""

import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxsfs.camera._base import AbstractCamera, over_image
from jaxsfs.camera._radial import Perspective


def rectification_map(source: AbstractCamera, target: AbstractCamera) -> Float[Array, "height width 2"]:
    """Pixel of `source` that `target` sees at each of its own pixels; NaN where `source` sees nothing.

    With a spherical source and a perspective target this is eq. (15). The map is what `cv2.remap` wants.
    """

    def pixel(target_pixel):
        direction = target.ray(target_pixel)
        seen = source.sees(direction) & target.is_valid(target_pixel)
        return jnp.where(seen, source.project(direction), jnp.nan)

    return over_image(pixel)(target.pixels())


def perspective_like(camera: AbstractCamera, half_field_deg: float | int | None = None) -> Perspective:
    """A perspective camera of the same image size and centre.

    `half_field_deg`: half of the horizontal field; without it, the scale at the principal point is kept (z_pi = f).
    """
    if half_field_deg is None:
        at_centre = camera.inverse_metric(jnp.stack([jnp.asarray(camera.cx, float), jnp.asarray(camera.cy, float)]))
        focal_length = float(jnp.sqrt(jnp.trace(at_centre) / 2))
    elif 0 < half_field_deg < 90:
        focal_length = camera.width / 2 / float(jnp.tan(jnp.deg2rad(1.0 * half_field_deg)))
    else:
        raise ValueError(f"half_field_deg must lie between 0 and 90 degrees, got {half_field_deg}")
    return Perspective(
        fx=focal_length, fy=focal_length, cx=camera.cx, cy=camera.cy, width=camera.width, height=camera.height
    )
