"""Kannala–Brandt's polynomial fitted to another lens, and how far it misses."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float
from scipy.optimize import least_squares

from jaxsfs.camera import AbstractCamera, KannalaBrandt, Scaramuzza

_SAMPLES = 301  # pixels along a side, at most


class Misfit(NamedTuple):
    """Distance in px between the pixels of the same rays in both cameras, over the field that the image shows:
    root of the mean square, the largest, and the largest angle from the axis in degrees."""

    rms: float
    largest: float
    reach_deg: float

    def __str__(self) -> str:
        return f"rms {self.rms:.2g} px, at most {self.largest:.2g} px, up to {self.reach_deg:.1f} degrees from the axis"


def fisheye_like(camera: AbstractCamera) -> tuple[KannalaBrandt, Misfit]:
    """The fisheye nearest to `camera` over the pixels of its image that have a ray."""
    rays, pixels = _samples(camera)
    size, (cx, cy) = (camera.width, camera.height), (float(camera.cx), float(camera.cy))
    if isinstance(camera, Scaramuzza):
        focal = (float(camera.a[0]) * float(camera.c), float(camera.a[0]))
        radial = float(camera.d) == 0 == float(camera.e)
    else:
        fx, fy = camera.focal()  # pyright: ignore[reportAttributeAccessIssue] -- all others are radial
        focal, radial = (float(fx), float(fy)), True
    return fisheye_of_samples(rays, pixels, size, (*focal, cx, cy), radial)


def fisheye_of_samples(
    rays: Float[np.ndarray, "count 3"],
    pixels: Float[np.ndarray, "count 2"],
    size: tuple[int, int],
    intrinsics: tuple[float, float, float, float],
    radial: bool = False,
) -> tuple[KannalaBrandt, Misfit]:
    """The fisheye that sees `rays` nearest to `pixels`, by least squares in px.

    `intrinsics`: fx, fy, cx, cy to start from; a `radial` lens keeps its centre and the ratio fy/fx.
    Raises ValueError when the fitted polynomial does not grow over the field, since no program could invert it.
    """
    fx, fy, cx, cy = intrinsics
    theta = _angle(rays)
    scale, k = _profile(theta, np.hypot((pixels[:, 0] - cx) / fx, (pixels[:, 1] - cy) / fy))
    found = np.array([fx * scale, fy * scale, cx, cy, *k])
    if not radial:
        units = np.array([fx, fy, 10.0, 10.0, 0.1, 0.1, 0.1, 0.1])
        solved = least_squares(lambda p: (_fisheye(rays, p) - pixels).ravel(), found, x_scale=units, xtol=1e-14)
        found = solved.x
    _check_growing(found[4:], float(theta.max()))
    distance = np.linalg.norm(_fisheye(rays, found) - pixels, axis=1)
    fx, fy, cx, cy, k1, k2, k3, k4 = found.tolist()
    misfit = Misfit(float(np.sqrt(np.mean(distance**2))), float(distance.max()), float(np.rad2deg(theta.max())))
    return KannalaBrandt(fx, fy, cx, cy, *size, (k1, k2, k3, k4)), misfit


def _samples(camera: AbstractCamera) -> tuple[Float[np.ndarray, "count 3"], Float[np.ndarray, "count 2"]]:
    """Rays of pixels all over the image, in 64 bit whatever the caller's precision."""
    u = np.linspace(0, camera.width - 1, min(camera.width, _SAMPLES))
    v = np.linspace(0, camera.height - 1, min(camera.height, _SAMPLES))
    pixels = np.stack(np.meshgrid(u, v), axis=-1).reshape(-1, 2)
    with jax.enable_x64(True):
        valid = np.asarray(jax.jit(jax.vmap(camera.is_valid))(jnp.asarray(pixels)))
        if valid.sum() < 100:
            raise ValueError("the camera has almost no rays inside its image: check f, cx and cy")
        rays = np.asarray(jax.jit(jax.vmap(camera.ray))(jnp.asarray(pixels[valid])))
    return rays, pixels[valid]


def _profile(theta: Float[np.ndarray, " count"], radius: Float[np.ndarray, " count"]) -> tuple[float, list[float]]:
    """s and k1 … k4 of radius ≈ s (θ + k1 θ³ + … + k4 θ⁹): linear in s, s k1, …, s k4."""
    reach = theta.max()
    powers = (theta / reach)[:, None] ** np.arange(1, 10, 2)
    weights = np.linalg.lstsq(powers, radius, rcond=None)[0] / reach ** np.arange(1, 10, 2)
    return float(weights[0]), (weights[1:] / weights[0]).tolist()


def _fisheye(rays: Float[np.ndarray, "count 3"], p: Float[np.ndarray, "8"]) -> Float[np.ndarray, "count 2"]:
    theta, t2 = _angle(rays), _angle(rays) ** 2
    radius = theta * (1 + t2 * (p[4] + t2 * (p[5] + t2 * (p[6] + t2 * p[7]))))
    height = np.hypot(rays[:, 0], rays[:, 1])
    scale = np.where(height > 0, radius / np.where(height > 0, height, 1), 1.0)
    return p[2:4] + p[:2] * scale[:, None] * rays[:, :2]


def _angle(rays: Float[np.ndarray, "count 3"]) -> Float[np.ndarray, " count"]:
    return np.arctan2(np.hypot(rays[:, 0], rays[:, 1]), rays[:, 2])


def _check_growing(k: Float[np.ndarray, "4"], reach: float) -> None:
    t2 = np.linspace(0, reach, 1000) ** 2
    slope = 1 + t2 * (3 * k[0] + t2 * (5 * k[1] + t2 * (7 * k[2] + t2 * 9 * k[3])))
    if slope.min() <= 0:
        turn = np.rad2deg(np.sqrt(t2[np.argmax(slope <= 0)]))
        raise ValueError(
            f"four fisheye coefficients cannot follow this lens up to {np.rad2deg(reach):.1f} degrees: the fit turns "
            f"back at {turn:.1f} degrees; crop the camera to the part of the image that is used"
        )
