"""Surfaces with exact range and irradiance, written from their formulas (not from the package's renderer)."""

import functools

import jax.numpy as jnp
import numpy as np

from jaxsfs.camera import Spherical


def disc_camera(size: int, half_field_deg: float = 50.0) -> Spherical:
    """Square image whose inscribed circle is at the half field."""
    radius = (size - 1) / 2
    f = radius / np.sin(np.deg2rad(half_field_deg))
    return Spherical(f=f, cx=radius, cy=radius, width=size, height=size)


def disc(size: int) -> np.ndarray:
    v, u = np.mgrid[:size, :size] - (size - 1) / 2
    return np.hypot(u, v) <= (size - 1) / 2


def rays(camera: Spherical) -> np.ndarray:
    """Eqs. (12)-(13) with r = 1."""
    v, u = np.mgrid[: camera.height, : camera.width].astype(float)
    x, y = (u - camera.cx) / camera.f, (v - camera.cy) / camera.f
    return np.stack([x, y, np.sqrt(np.maximum(1 - x * x - y * y, 1e-9))], axis=-1)


def plane(d: np.ndarray, tilt_deg: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Range and cos θ of the plane at distance 1 with its normal tilted about y: r = 1/(n·d), cos θ = n·d."""
    t = np.deg2rad(tilt_deg)
    cosine = d @ np.array([np.sin(t), 0, np.cos(t)])
    return 1 / cosine, cosine


def ball(d: np.ndarray, distance: float = 2.0, radius: float = 1.62) -> tuple[np.ndarray, np.ndarray]:
    """A ball on the axis, seen from outside: r² − 2 r d·c + c² − R² = 0."""
    along = distance * d[..., 2]
    root = np.sqrt(np.maximum(along**2 - distance**2 + radius**2, 1e-9))
    return along - root, root / radius


def waves(d: np.ndarray, amplitude: float = 0.05, frequency: float = 12.0) -> tuple[np.ndarray, np.ndarray]:
    """ln r = −ln cos α + A sin(k x) sin(k y): a wall with many nearest points. |∇w|² from x, y as coordinates of the
    sphere, with g^{ij} = δ_ij − x_i x_j."""
    x, y, z = np.moveaxis(d, -1, 0)
    a, k = amplitude, frequency
    wx = x / z**2 + a * k * np.cos(k * x) * np.sin(k * y)
    wy = y / z**2 + a * k * np.sin(k * x) * np.cos(k * y)
    slope2 = wx**2 + wy**2 - (x * wx + y * wy) ** 2
    return np.exp(-np.log(z) + a * np.sin(k * x) * np.sin(k * y)), 1 / np.sqrt(1 + np.maximum(slope2, 0))


SURFACES = {"plane": plane, "tilted": functools.partial(plane, tilt_deg=15), "ball": ball, "waves": waves}


def scene(name: str, size: int, half_field_deg: float = 50.0):
    """(camera, range, cos θ, mask) of a named surface."""
    camera = disc_camera(size, half_field_deg)
    distance, cosine = SURFACES[name](rays(camera))
    return camera, distance, cosine, disc(size)


def as_image(values: np.ndarray, mask: np.ndarray, dtype=jnp.float64):
    """Values where the mask holds, 1 elsewhere, as a JAX array."""
    return jnp.asarray(np.where(mask, values, 1.0), dtype)
