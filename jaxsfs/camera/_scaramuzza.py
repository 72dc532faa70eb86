"""The OCamCalib camera: a polynomial of the image radius gives the ray."""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from jaxsfs.camera._base import AbstractCentralCamera, resized_centre, with_size
from jaxsfs.camera._roots import monotone_root
from jaxsfs.forms import Scalar


class Scaramuzza(AbstractCentralCamera):
    """Ray (x', y', a₀ + a₁ρ + a₂ρ² + a₃ρ³ + a₄ρ⁴), ρ = √(x'² + y'²), with
    (u − cx, v − cy)ᵀ = [[c, d], [e, 1]] (x', y')ᵀ (MATLAB's stretch matrix; a₀ > 0 looks forward).

    The inverse is solved for. OCamCalib's fitted inverse polynomial is not exact, so the metric from it would not
    belong to the rays. Source: Scaramuzza et al. 2006.
    """

    a: tuple[Scalar, Scalar, Scalar, Scalar, Scalar]
    cx: Scalar
    cy: Scalar
    width: int = eqx.field(static=True)
    height: int = eqx.field(static=True)
    c: Scalar = 1.0
    d: Scalar = 0.0
    e: Scalar = 0.0

    def ray(self, pixel: Float[Array, "2"]) -> Float[Array, "3"]:
        sensor = jnp.where(self.is_valid(pixel), self._sensor(pixel), 0)
        direction = jnp.append(sensor, self._axial(_length(sensor)))
        return direction / jnp.sqrt(jnp.sum(direction**2))

    def project(self, point: Float[Array, "3"]) -> Float[Array, "2"]:
        height2 = jnp.sum(point[:2] ** 2)
        off = height2 > 1e-14 * jnp.sum(point * point)
        height = jnp.sqrt(jnp.where(off, height2, 1))
        norm = jnp.sqrt(jnp.sum(point * point))
        end = self._turn().astype(point.dtype)

        # The ray of radius ρ lies at the point's angle: ρ z = h (a₀ + a₁ρ + …); the left side minus the right
        # grows with ρ as long as the angle does.
        def misfit(rho):
            return (rho * point[2] - height * self._axial(rho)) / norm

        rho = monotone_root(misfit, jnp.zeros_like(end), end, iterations=20)
        scale = jnp.where(off, rho / height, self.a[0] / jnp.where(off, 1, point[2]))
        x, y = scale * point[0], scale * point[1]
        return jnp.stack([self.cx + self.c * x + self.d * y, self.cy + self.e * x + y])

    def is_valid(self, pixel: Float[Array, "2"]) -> Bool[Array, ""]:
        return _length(self._sensor(pixel)) < self._turn().astype(pixel.dtype)

    def resized(self, width: int, height: int) -> "Scaramuzza":
        sx, sy = width / self.width, height / self.height
        cx, cy = resized_centre(self, width, height)
        a = tuple(a_n * sy ** (1 - n) for n, a_n in enumerate(self.a))
        scaled = dataclasses.replace(self, a=a, cx=cx, cy=cy, c=self.c * (sx / sy), d=self.d * (sx / sy))
        return with_size(scaled, width, height)

    def _sensor(self, pixel: Float[Array, "2"]) -> Float[Array, "2"]:
        """(x', y') of `pixel`: the inverse of the affine part."""
        p, q = pixel[0] - self.cx, pixel[1] - self.cy
        determinant = self.c - self.d * self.e
        return jnp.stack([p - self.d * q, self.c * q - self.e * p]) / determinant

    def _axial(self, rho: Float[Array, ""]) -> Float[Array, ""]:
        a0, a1, a2, a3, a4 = self.a
        return a0 + rho * (a1 + rho * (a2 + rho * (a3 + rho * a4)))

    def _turn(self) -> Float[Array, ""]:
        """Radius up to which the angle atan2(ρ, axial) grows: axial − ρ·axial' > 0."""
        a0, _, a2, a3, a4 = (jax.lax.stop_gradient(jnp.asarray(a, float)) for a in self.a)
        rho = jnp.linspace(0, 2.0 * max(self.width, self.height), 1025)
        growth = a0 - rho**2 * (a2 + rho * (2 * a3 + rho * 3 * a4))
        return rho[jnp.maximum(jnp.argmax(jnp.append(growth <= 0, True)), 1) - 1]


def _length(vector: Float[Array, "2"]) -> Float[Array, ""]:
    """Euclidean length with derivative 0, not NaN, at 0."""
    square = jnp.sum(vector**2)
    return jnp.where(square > 0, jnp.sqrt(jnp.where(square > 0, square, 1)), 0)
