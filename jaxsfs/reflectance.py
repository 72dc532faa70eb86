"""G(cos θ), the reflectance of a surface lit from where it is seen, and its inverse.

Every G is normalised to G(1) = 1 and grows on [0, 1], so E = ρ G(cos θ)/r² gives the bound r² ≤ ρ/E.
"""

import abc

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxsfs.forms import Scalar, parse_form, power, require

FloatImage = Float[Array, "*shape"]


class AbstractReflectance(eqx.Module):
    """G and G⁻¹, elementwise on arrays of any shape."""

    @abc.abstractmethod
    def __call__(self, cosine: FloatImage) -> FloatImage:
        """G(cos θ) for cos θ in [0, 1]."""

    @abc.abstractmethod
    def inverse(self, value: FloatImage) -> FloatImage:
        """cos θ with G(cos θ) = value; clipped to [0, 1] outside G's range."""

    @abc.abstractmethod
    def exponent(self) -> Scalar:
        """d ln G/d ln cos θ at cos θ = 1: the a of the power cos^a that G resembles where it matters most."""


class Lambertian(AbstractReflectance):
    """G = cos θ."""

    def __call__(self, cosine: FloatImage) -> FloatImage:
        return cosine

    def inverse(self, value: FloatImage) -> FloatImage:
        return jnp.clip(value, 0, 1)

    def exponent(self) -> Scalar:
        return 1.0


class Power(AbstractReflectance):
    """G = cos^a θ. Measured on colonoscope frames: a near 0.65."""

    a: Scalar

    def __check_init__(self):
        require(self.a, lambda a: a > 0, "power reflectance needs an exponent a > 0")

    def __call__(self, cosine: FloatImage) -> FloatImage:
        return power(cosine, self.a)

    def inverse(self, value: FloatImage) -> FloatImage:
        return power(jnp.clip(value, 0, 1), 1 / self.a)

    def exponent(self) -> Scalar:
        return self.a


class OrenNayar(AbstractReflectance):
    """Rough diffuse surface, light at the eye: G = cos θ + b sin²θ with b = B/A,
    A = 1 − σ²/(2σ² + 0.66), B = 0.45 σ²/(σ² + 0.09), σ the slope roughness in radians.

    Source: Oren & Nayar 1994 with coincident directions. G stops growing before cos θ = 1 for b > ½
    (σ > 0.622), which is refused. G(0) = b: darker values have no angle and give cos θ = 0.
    """

    sigma: Scalar

    def __check_init__(self):
        require(self.sigma, lambda s: 0 <= s <= 0.622, "Oren-Nayar roughness must lie in [0, 0.622] rad")

    def __call__(self, cosine: FloatImage) -> FloatImage:
        return cosine + self._b() * (1 - cosine**2)

    def inverse(self, value: FloatImage) -> FloatImage:
        # b c² − c + (value − b) = 0; this form of the smaller root has no division by b
        b = self._b()
        excess = jnp.clip(value, b, 1) - b
        return jnp.clip(2 * excess / (1 + jnp.sqrt(jnp.maximum(1 - 4 * b * excess, 0))), 0, 1)

    def exponent(self) -> Scalar:
        return 1 - 2 * self._b()

    def _b(self) -> Scalar:
        s2 = self.sigma**2
        return (0.45 * s2 / (s2 + 0.09)) / (1 - 0.5 * s2 / (s2 + 0.33))


class Phong(AbstractReflectance):
    """G = (1 − k) cos θ + k max(0, cos 2θ)ⁿ: Phong's lobe with the light at the eye, seen at 2θ from the mirror
    direction. k in [0, 1), n ≥ 1. Source: Phong 1975; used for endoscopes by Okatani & Deguchi 1997 as "G"."""

    k: Scalar
    n: Scalar

    def __check_init__(self):
        require(self.k, lambda k: 0 <= k < 1, "Phong's specular share k must lie in [0, 1)")
        require(self.n, lambda n: n >= 1, "Phong's exponent n must be at least 1")

    def __call__(self, cosine: FloatImage) -> FloatImage:
        return (1 - self.k) * cosine + self.k * power(jnp.maximum(2 * cosine**2 - 1, 0), self.n)

    def inverse(self, value: FloatImage) -> FloatImage:
        return _inverse_by_bisection(self, value)

    def exponent(self) -> Scalar:
        return 1 - self.k + 4 * self.k * self.n


class BlinnPhong(AbstractReflectance):
    """G = (1 − k) cos θ + k cosⁿ θ: the half vector is the viewing direction. k in [0, 1), n ≥ 1.
    Source: Blinn 1977 with coincident directions."""

    k: Scalar
    n: Scalar

    def __check_init__(self):
        require(self.k, lambda k: 0 <= k < 1, "Blinn-Phong's specular share k must lie in [0, 1)")
        require(self.n, lambda n: n >= 1, "Blinn-Phong's exponent n must be at least 1")

    def __call__(self, cosine: FloatImage) -> FloatImage:
        return (1 - self.k) * cosine + self.k * power(cosine, self.n)

    def inverse(self, value: FloatImage) -> FloatImage:
        return _inverse_by_bisection(self, value)

    def exponent(self) -> Scalar:
        return 1 - self.k + self.k * self.n


_FORMS = {
    "lambertian": (Lambertian, ()),
    "power": (Power, ("A",)),
    "oren-nayar": (OrenNayar, ("SIGMA",)),
    "phong": (Phong, ("K", "N")),
    "blinn-phong": (BlinnPhong, ("K", "N")),
}


def parse_reflectance(text: str) -> AbstractReflectance:
    """`lambertian`, `power:A`, `oren-nayar:SIGMA`, `phong:K,N` or `blinn-phong:K,N` as a reflectance."""
    return parse_form("reflectance", text, _FORMS)


def _inverse_by_bisection(reflectance: AbstractReflectance, value: FloatImage) -> FloatImage:
    """The inverse of an increasing G on [0, 1]: bisection in as many steps as a double has bits, so exact."""

    def halve(_, bracket):
        low, high = bracket
        middle = 0.5 * (low + high)
        below = reflectance(middle) < value
        return jnp.where(below, middle, low), jnp.where(below, high, middle)

    steps = 26 if value.dtype == jnp.float32 else 52
    low, high = jax.lax.fori_loop(0, steps, halve, (jnp.zeros_like(value), jnp.ones_like(value)))
    root = jax.lax.stop_gradient(0.5 * (low + high))
    # one Newton step carries the derivative through the implicit function theorem
    at_root, slope = jax.jvp(reflectance, (root,), (jnp.ones_like(root),))
    return jnp.clip(root - (at_root - jnp.clip(value, 0, 1)) / jax.lax.stop_gradient(slope), 0, 1)
