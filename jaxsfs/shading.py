"""The shading equation as a front sees it: how steep the surface is at a pixel that the front reaches at w.

w = ln r for the light at the camera, w = z for a distant one. Solvers know a shading, the inverse metric and a mask,
and nothing else of cameras or reflectances.
"""

import abc
from collections.abc import Callable

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from jaxsfs.forms import Scalar
from jaxsfs.reflectance import AbstractReflectance, Lambertian, Power

# cos θ below this is taken as this: a front that slow (89.4°) stands still at any resolution.
MIN_COSINE = 0.01

Image = Float[Array, "height width"]


class Balance(eqx.Module):
    """|∇v|²_g + square·v² + linear·v = constant, pixel by pixel; coefficients that are the same everywhere are numbers,
    so that no image is read for them."""

    constant: Float[Array, "..."]
    linear: Float[Array, "..."] | Scalar
    square: Float[Array, "..."] | Scalar

    def map_images(self, function: Callable[[Array], Array]) -> "Balance":
        """With `function` applied to the coefficients that are images."""
        return jax.tree.map(lambda x: function(x) if jnp.ndim(x) > 0 else x, self)

    def slope(self, v: Float[Array, "..."]) -> Float[Array, "..."]:
        """Half the derivative of square·v² + linear·v by v."""
        return self.square * v + 0.5 * self.linear

    def left(self, v: Float[Array, "..."]) -> Float[Array, "..."]:
        """|∇v|²_g where v has this value."""
        return self.constant - v * (self.square * v + self.linear)


class AbstractShading(eqx.Module):
    """|∇w|²_g = 1/c² − 1 with c = cos θ, which may depend on w."""

    @abc.abstractmethod
    def cosine(self, w: Image) -> Image:
        """c at each pixel if the front reached it at w."""

    @abc.abstractmethod
    def deadline(self) -> Image:
        """The largest w that c ≤ 1 allows at each pixel; +inf where there is no bound."""

    @abc.abstractmethod
    def darkness(self) -> Image:
        """Smallest where the surface most likely faces the light: where a front starts when nothing else is known."""

    @abc.abstractmethod
    def from_range(self, distance: Scalar) -> Scalar:
        """w of a range (of a z, for a distant light)."""

    @abc.abstractmethod
    def to_range(self, w: Image) -> Image:
        """Range of w, the inverse of `from_range`."""

    @abc.abstractmethod
    def natural_power(self) -> Scalar:
        """The power p of `lift` in which the equation is a quadratic one, or nearly."""

    @abc.abstractmethod
    def is_quadratic(self) -> bool:
        """Whether the equation in v with the natural power is a quadratic one, namely `quadratic_balance`."""

    @abc.abstractmethod
    def quadratic_balance(self) -> "Balance":
        """The equation in v with the natural power, where `is_quadratic`."""

    @abc.abstractmethod
    def lift(self, w: Image, p: Scalar) -> Image:
        """The unknown v of the static solver: a growing function of w."""

    @abc.abstractmethod
    def lower(self, v: Image, p: Scalar) -> Image:
        """w of v, the inverse of `lift`."""

    @abc.abstractmethod
    def balance(self, v: Image, p: Scalar) -> "Balance":
        """The equation in v, linearised at `v`."""

    def speed(self, w: Image) -> Image:
        """F = c/√(1 − c²) = 1/|∇w|_g, the front's speed (eqs. 3 and 6); large, not infinite, at c = 1."""
        c = jnp.clip(self.cosine(w), MIN_COSINE, 1)
        return c / jnp.sqrt(jnp.maximum(1 - c * c, 1e-8))


class LightAtCamera(AbstractShading):
    """E = ρ G(cos θ)/r²: c = G⁻¹(e^{2w} E/ρ), so w = ln(r/unit) ≤ ½ ln(ρ/E) − ln unit (eq. 5).

    `bound` is that limit, the range of a surface that faces the light; meaningless where the image has no data.
    `limit` ≤ `bound` is the deadline: lower where more is known of the largest range. `unit` is a length that makes w
    small numbers.
    """

    bound: Image
    limit: Image
    reflectance: AbstractReflectance
    albedo: Scalar
    unit: Scalar

    def cosine(self, w: Image) -> Image:
        return self.reflectance.inverse(jnp.exp(2 * (w - self.bound)))

    def deadline(self) -> Image:
        return self.limit

    def darkness(self) -> Image:
        return self.bound

    def from_range(self, distance: Scalar) -> Scalar:
        """w = ln(r/unit). Raises ValueError for a range that is not positive."""
        if not isinstance(distance, jax.Array) and not distance > 0:
            raise ValueError(f"a range must be positive, got {distance}")
        return jnp.log(jnp.asarray(distance / self.unit, self.bound.dtype))

    def to_range(self, w: Image) -> Image:
        return self.unit * jnp.exp(w)

    def bound_of(self, irradiance: Scalar) -> Scalar:
        """Bound of a pixel of this irradiance."""
        return 0.5 * jnp.log(self.albedo / irradiance) - jnp.log(self.unit)

    def irradiance_of(self, bound: Float[Array, ""]) -> Float[Array, ""]:
        """Irradiance of a pixel of this bound."""
        return self.albedo / (self.unit * jnp.exp(bound)) ** 2

    def natural_power(self) -> Scalar:
        return 2 / self.reflectance.exponent()

    def is_quadratic(self) -> bool:
        return isinstance(self.reflectance, Lambertian | Power)

    def quadratic_balance(self) -> "Balance":
        """For G = cos^a and p = 2/a, |∇v|²_g + p²v² = p²(ρ/E)^{2/a}; for a Lambertian surface v = r² and
        |∇v|²_g + 4v² = 4ρ²/E²."""
        p = self.natural_power()
        top = self.lift(self.bound, p)
        return Balance(p**2 * top**2, 0.0, p**2)

    def lift(self, w: Image, p: Scalar) -> Image:
        """v = sign(p) e^{pw} = sign(p) r^p."""
        return jnp.sign(1.0 * p) * jnp.exp(p * w)

    def lower(self, v: Image, p: Scalar) -> Image:
        return jnp.log(jnp.abs(v)) / p

    def balance(self, v: Image, p: Scalar) -> "Balance":
        """|∇v|²_g = R(v), R = p²v²(1/c² − 1), R' = 2p²v (1/c² − 1 − 2/(pκc²)) with κ = d ln G/d ln c; but no steeper
        than the chord to R = 0 at the deadline, so that R stays positive up to there."""
        top = self.lift(self.bound, p)
        cosine = jnp.clip(self.reflectance.inverse(jnp.abs(v / top) ** (2 / p)), MIN_COSINE, 1)
        steepness = 1 / cosine**2 - 1
        value, slope = jax.jvp(self.reflectance, (cosine,), (jnp.ones_like(cosine),))
        kappa = jnp.maximum(slope * cosine / value, 1e-3)
        right = p**2 * v**2 * steepness
        tangent = 2 * p**2 * v * (2 / (p * kappa * cosine**2) - steepness)
        room = top - v
        far = room > 1e-3 * jnp.abs(v)
        linear = jnp.where(far, jnp.minimum(jnp.abs(tangent), right / jnp.where(far, room, 1)), jnp.abs(tangent))
        return Balance(right + linear * v, linear, 0.0)


class DistantLight(AbstractShading):
    """E = ρ cos θ with parallel rays and light along them: c = E/ρ, whatever w = z/unit (eqs. 1–4).

    `facing` is E/ρ in [0, 1].
    """

    facing: Image
    unit: Scalar

    def cosine(self, w: Image) -> Image:
        return self.facing

    def deadline(self) -> Image:
        return jnp.full_like(self.facing, jnp.inf)

    def darkness(self) -> Image:
        return -self.facing

    def from_range(self, distance: Scalar) -> Scalar:
        return jnp.asarray(distance, self.facing.dtype) / self.unit

    def to_range(self, w: Image) -> Image:
        return self.unit * w

    def natural_power(self) -> Scalar:
        return 1.0

    def is_quadratic(self) -> bool:
        return True

    def quadratic_balance(self) -> "Balance":
        cosine = jnp.clip(self.facing, MIN_COSINE, 1)
        return Balance(1 / cosine**2 - 1, 0.0, 0.0)

    def lift(self, w: Image, p: Scalar) -> Image:
        """v = z whatever p: |∇z|² = 1/c² − 1."""
        return w

    def lower(self, v: Image, p: Scalar) -> Image:
        return v

    def balance(self, v: Image, p: Scalar) -> "Balance":
        return self.quadratic_balance()


@jax.jit
def light_at_camera(
    irradiance: Image, inside: Bool[Array, "height width"], albedo: Scalar, reflectance: AbstractReflectance
) -> LightAtCamera:
    """The shading of a near light; the unit is the range of the brightest pixel if it faces the light."""
    brightest = jnp.max(jnp.where(inside, irradiance, 0))
    relative = jnp.where(inside, irradiance / brightest, 1)
    bound = -0.5 * jnp.log(relative)
    return LightAtCamera(bound, bound, reflectance, albedo, jnp.sqrt(albedo / brightest))


def distant_light(irradiance: Image, albedo: Scalar, unit: Scalar) -> DistantLight:
    """The shading of a distant frontal light; `unit` is a typical length of the picture."""
    return DistantLight(jnp.clip(irradiance / albedo, 0, 1), unit)
