"""Cameras with one radial profile: an image radius that depends on the angle α from the optical axis alone.

With q = ((u − cx)/fx, (v − cy)/fy) a model is two smooth functions, which never divide by the distance from the
axis: `magnification(point)` m with q = m·(x, y), and `unit(q)` the ray.
"""

import abc
import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from jaxsfs.camera._base import AbstractCentralCamera, resized_centre, with_size
from jaxsfs.camera._roots import monotone_root
from jaxsfs.forms import Scalar


class AbstractRadialCamera(AbstractCentralCamera):
    """pixel = centre + diag(fx, fy)·m(point)·(x, y)."""

    @abc.abstractmethod
    def focal(self) -> tuple[Scalar, Scalar]:
        """(fx, fy) in px."""

    @abc.abstractmethod
    def magnification(self, point: Float[Array, "3"]) -> Float[Array, ""]:
        """m: image radius for unit focal length over √(x² + y²); homogeneous of degree −1."""

    @abc.abstractmethod
    def unit(self, q: Float[Array, "2"]) -> Float[Array, "3"]:
        """Unit ray of the normalised image point q."""

    @abc.abstractmethod
    def limit(self) -> Scalar:
        """Largest |q| that has a ray (exclusive)."""

    def ray(self, pixel: Float[Array, "2"]) -> Float[Array, "3"]:
        # Pixels outside the model get the axis: finite, with finite derivatives, and marked by `is_valid`.
        return self.unit(jnp.where(self.is_valid(pixel), self.normalised(pixel), 0))

    def project(self, point: Float[Array, "3"]) -> Float[Array, "2"]:
        return self._centre(point.dtype) + self._focal(point.dtype) * self.magnification(point) * point[:2]

    def is_valid(self, pixel: Float[Array, "2"]) -> Bool[Array, ""]:
        q = self.normalised(pixel)
        return jnp.sum(q * q) < jnp.asarray(self.limit(), pixel.dtype) ** 2

    def normalised(self, pixel: Float[Array, "2"]) -> Float[Array, "2"]:
        """q of `pixel`."""
        return (pixel - self._centre(pixel.dtype)) / self._focal(pixel.dtype)

    def _centre(self, dtype) -> Float[Array, "2"]:
        return jnp.stack([jnp.asarray(self.cx, dtype), jnp.asarray(self.cy, dtype)])

    def _focal(self, dtype) -> Float[Array, "2"]:
        fx, fy = self.focal()
        return jnp.stack([jnp.asarray(fx, dtype), jnp.asarray(fy, dtype)])


class Perspective(AbstractRadialCamera):
    """Pinhole: q = (x, y)/z. `fx`, `fy` are focal lengths in px (z_pi of the paper)."""

    fx: Scalar
    fy: Scalar
    cx: Scalar
    cy: Scalar
    width: int = eqx.field(static=True)
    height: int = eqx.field(static=True)

    def focal(self) -> tuple[Scalar, Scalar]:
        return self.fx, self.fy

    def magnification(self, point: Float[Array, "3"]) -> Float[Array, ""]:
        return 1 / point[2]

    def unit(self, q: Float[Array, "2"]) -> Float[Array, "3"]:
        return jnp.append(q, 1.0) / jnp.sqrt(1 + jnp.sum(q * q))

    def limit(self) -> Scalar:
        return jnp.inf

    def inverse_metric(self, pixel: Float[Array, "2"]) -> Float[Array, "2 2"]:
        """g^{ij} = R² S (I + q qᵀ) S, R² = 1 + |q|², S = diag(fx, fy): the bracket of eq. (6)."""
        q, s = self.normalised(pixel), self._focal(pixel.dtype)
        return (1 + jnp.sum(q * q)) * jnp.outer(s, s) * (jnp.eye(2, dtype=q.dtype) + jnp.outer(q, q))

    def resized(self, width: int, height: int) -> "Perspective":
        return _resized_focal(self, width, height)


class _SingleFocal(AbstractRadialCamera):
    """One focal length `f` in px and the pixel aspect fy/fx."""

    f: Scalar
    cx: Scalar
    cy: Scalar
    width: int = eqx.field(static=True)
    height: int = eqx.field(static=True)
    aspect: Scalar = 1.0

    def focal(self) -> tuple[Scalar, Scalar]:
        return self.f, self.f * self.aspect

    def resized(self, width: int, height: int) -> "_SingleFocal":
        moved = _resized_centre(self, width, height)
        sx, sy = width / self.width, height / self.height
        return dataclasses.replace(moved, f=self.f * sx, aspect=self.aspect * (sy / sx))


class Spherical(_SingleFocal):
    """The paper's camera: |q| = s + k s³, s = sin α; k = 0 is eq. (19), √(u² + v²) = f sin α.

    `f` is the radius of the projection sphere in px (the distortion parameter). Rays with α < 90° only; for
    k < −1/3 the profile turns back before that and the field ends there.
    """

    k: Scalar = 0.0

    def magnification(self, point: Float[Array, "3"]) -> Float[Array, ""]:
        norm2 = jnp.sum(point * point)
        return (1 + self.k * (jnp.sum(point[:2] ** 2) / norm2)) / jnp.sqrt(norm2)

    def unit(self, q: Float[Array, "2"]) -> Float[Array, "3"]:
        a = 1 / (1 + self.k * self._sine2(q))
        return jnp.append(a * q, jnp.sqrt(jnp.maximum(1 - a * a * jnp.sum(q * q), 1e-12)))

    def limit(self) -> Scalar:
        k = jnp.asarray(self.k, float)
        s = jnp.where(k < -1 / 3, jnp.sqrt(-1 / jnp.minimum(3 * k, -1)), 1.0)
        return s + k * s**3

    def inverse_metric(self, pixel: Float[Array, "2"]) -> Float[Array, "2 2"]:
        """g^{ij} = S (m² I + t q qᵀ) S with m = 1 + k s², t = (4k − 1 + (8k² − 6k) s² − 9k² s⁴)/m²;
        for k = 0, f² δ_ij − u_i u_j: eqs. (16)–(18) and the last equation of Section 5."""
        q, s, k = self.normalised(pixel), self._focal(pixel.dtype), self.k
        s2 = self._sine2(q)
        m2 = (1 + k * s2) ** 2
        t = (4 * k - 1 + (8 * k**2 - 6 * k) * s2 - 9 * k**2 * s2**2) / m2
        return jnp.outer(s, s) * (m2 * jnp.eye(2, dtype=q.dtype) + t * jnp.outer(q, q))

    def _sine2(self, q: Float[Array, "2"]) -> Float[Array, ""]:
        """sin²α of q; the root of s(1 + k s²) = |q|, as s² so that the axis is no special point."""
        r2 = jnp.sum(q * q)
        k = jnp.asarray(self.k, q.dtype)
        turn = jnp.where(k < -1 / 3, -1 / jnp.minimum(3 * k, -1), 1.0).astype(q.dtype)
        return monotone_root(lambda x: x * (1 + k * x) ** 2 - r2, jnp.zeros_like(r2), turn)


class Equidistant(_SingleFocal):
    """|q| = α."""

    def magnification(self, point: Float[Array, "3"]) -> Float[Array, ""]:
        return angle_over_height(point)

    def unit(self, q: Float[Array, "2"]) -> Float[Array, "3"]:
        return ray_at_angle(q, lambda radius: radius)

    def limit(self) -> Scalar:
        return jnp.pi


class Equisolid(_SingleFocal):
    """|q| = 2 sin(α/2)."""

    def magnification(self, point: Float[Array, "3"]) -> Float[Array, ""]:
        norm = jnp.sqrt(jnp.sum(point * point))
        return jnp.sqrt(2 / (norm * (norm + point[2])))

    def unit(self, q: Float[Array, "2"]) -> Float[Array, "3"]:
        half2 = jnp.sum(q * q) / 4
        return jnp.append(q * jnp.sqrt(jnp.maximum(1 - half2, 1e-12)), 1 - 2 * half2)

    def limit(self) -> Scalar:
        return 2.0


class Stereographic(_SingleFocal):
    """|q| = 2 tan(α/2)."""

    def magnification(self, point: Float[Array, "3"]) -> Float[Array, ""]:
        return 2 / (jnp.sqrt(jnp.sum(point * point)) + point[2])

    def unit(self, q: Float[Array, "2"]) -> Float[Array, "3"]:
        half2 = jnp.sum(q * q) / 4
        return jnp.append(q, 1 - half2) / (1 + half2)

    def limit(self) -> Scalar:
        return jnp.inf


class KannalaBrandt(AbstractRadialCamera):
    """OpenCV's fisheye model: |q| = θ + k₁θ³ + k₂θ⁵ + k₃θ⁷ + k₄θ⁹, θ = α."""

    fx: Scalar
    fy: Scalar
    cx: Scalar
    cy: Scalar
    width: int = eqx.field(static=True)
    height: int = eqx.field(static=True)
    k: tuple[Scalar, Scalar, Scalar, Scalar] = (0.0, 0.0, 0.0, 0.0)

    def focal(self) -> tuple[Scalar, Scalar]:
        return self.fx, self.fy

    def magnification(self, point: Float[Array, "3"]) -> Float[Array, ""]:
        scale = angle_over_height(point)
        theta2 = jnp.sum(point[:2] ** 2) * scale**2
        return scale * self._series(theta2)

    def unit(self, q: Float[Array, "2"]) -> Float[Array, "3"]:
        end = jax.lax.stop_gradient(self._turn()).astype(q.dtype)

        def angle(radius):
            return monotone_root(lambda t: t * self._series(t * t) - radius, jnp.zeros_like(radius), end)

        return ray_at_angle(q, angle)

    def limit(self) -> Scalar:
        end = self._turn()
        return end * self._series(end**2)

    def resized(self, width: int, height: int) -> "KannalaBrandt":
        return _resized_focal(self, width, height)

    def _series(self, theta2: Float[Array, ""]) -> Float[Array, ""]:
        k1, k2, k3, k4 = self.k
        return 1 + theta2 * (k1 + theta2 * (k2 + theta2 * (k3 + theta2 * k4)))

    def _turn(self) -> Float[Array, ""]:
        """The angle up to which the profile grows, at most π."""
        theta = jnp.linspace(0, jnp.pi, 1025)
        k1, k2, k3, k4 = self.k
        t = theta**2
        slope = 1 + t * (3 * k1 + t * (5 * k2 + t * (7 * k3 + t * 9 * k4)))
        return theta[jnp.maximum(jnp.argmax(jnp.append(slope <= 0, True)), 1) - 1]


def angle_over_height(point: Float[Array, "3"]) -> Float[Array, ""]:
    """α/√(x² + y²), with its limit 1/z on the axis (where the plain quotient has no derivative)."""
    height2 = jnp.sum(point[:2] ** 2)
    off = height2 > 1e-14 * jnp.sum(point * point)
    height = jnp.sqrt(jnp.where(off, height2, 1))
    return jnp.where(off, jnp.arctan2(height, point[2]) / height, 1 / jnp.where(off, 1, point[2]))


def ray_at_angle(q: Float[Array, "2"], angle) -> Float[Array, "3"]:
    """Unit ray in the direction of q at `angle(|q|)` from the axis; on the axis angle(|q|) ≈ |q|."""
    r2 = jnp.sum(q * q)
    off = r2 > 1e-14
    radius = jnp.sqrt(jnp.where(off, r2, 1))
    alpha = angle(radius)
    return jnp.append(q * jnp.where(off, jnp.sin(alpha) / radius, 1.0), jnp.where(off, jnp.cos(alpha), 1 - r2 / 2))


def _resized_focal(camera, width: int, height: int):
    moved = _resized_centre(camera, width, height)
    sx, sy = width / camera.width, height / camera.height
    return dataclasses.replace(moved, fx=camera.fx * sx, fy=camera.fy * sy)


def _resized_centre(camera, width: int, height: int):
    cx, cy = resized_centre(camera, width, height)
    return with_size(dataclasses.replace(camera, cx=cx, cy=cy), width, height)
