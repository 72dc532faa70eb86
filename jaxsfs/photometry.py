"""From stored values to image irradiance and back: stored = response(gain · V(α) · ρ G(cos θ)/r²).

The response is inverted first, then the fall-off V is divided out. V gathers everything that depends on the angle
α from the optical axis alone: the light's beam (the light sits at the lens) and the lens's vignetting. All curves are
computed in numpy for numpy arrays.
"""

import abc

import equinox as eqx
from jaxtyping import Float

from jaxsfs._arrays import AnyArray, module_of
from jaxsfs.forms import Scalar, parse_form, power, require

FloatImage = Float[AnyArray, "*shape"]


class AbstractResponse(eqx.Module):
    """The camera's tone curve between linear light and stored value, both in [0, 1]."""

    @abc.abstractmethod
    def encode(self, linear: FloatImage) -> FloatImage:
        """Stored value of linear light."""

    @abc.abstractmethod
    def decode(self, stored: FloatImage) -> FloatImage:
        """Linear light of a stored value."""


class LinearResponse(AbstractResponse):
    """Stored value = linear light (raw, most 16-bit and all float images)."""

    def encode(self, linear: FloatImage) -> FloatImage:
        return linear

    def decode(self, stored: FloatImage) -> FloatImage:
        return stored


class GammaResponse(AbstractResponse):
    """stored = linear^(1/gamma)."""

    gamma: Scalar

    def __check_init__(self):
        require(self.gamma, lambda g: g > 0, "a response's gamma must be positive")

    def encode(self, linear: FloatImage) -> FloatImage:
        return power(linear, 1 / self.gamma)

    def decode(self, stored: FloatImage) -> FloatImage:
        return power(stored, self.gamma)


class SRGBResponse(AbstractResponse):
    """The sRGB curve of IEC 61966-2-1: linear near black, then a power 2.4."""

    def encode(self, linear: FloatImage) -> FloatImage:
        xp = module_of(linear)
        return xp.where(linear <= 0.0031308, 12.92 * linear, 1.055 * power(linear, 1 / 2.4) - 0.055)

    def decode(self, stored: FloatImage) -> FloatImage:
        xp = module_of(stored)
        return xp.where(stored <= 0.04045, stored / 12.92, power((stored + 0.055) / 1.055, 2.4))


class AbstractFalloff(eqx.Module):
    """V(α) with V(0) = 1."""

    @abc.abstractmethod
    def __call__(self, cos_alpha: FloatImage) -> FloatImage:
        """V as a function of cos α (the ray's z component)."""


class NoFalloff(AbstractFalloff):
    """V = 1."""

    def __call__(self, cos_alpha: FloatImage) -> FloatImage:
        return module_of(cos_alpha).ones_like(cos_alpha)


class CosineFalloff(AbstractFalloff):
    """V = cos^μ α, for α < 90°; 0 beyond."""

    mu: Scalar

    def __call__(self, cos_alpha: FloatImage) -> FloatImage:
        return power(cos_alpha, self.mu)


class ExponentialFalloff(AbstractFalloff):
    """V = exp(−μ (1 − cos α)), for any α. EndoMapper's spot light: μ = 2.77."""

    mu: Scalar

    def __call__(self, cos_alpha: FloatImage) -> FloatImage:
        return module_of(cos_alpha, self.mu).exp(-self.mu * (1 - cos_alpha))


class CosineExponentialFalloff(AbstractFalloff):
    """V = cos^a α · exp(−b (1 − cos α)), for α < 90°; 0 beyond. Near the axis V = 1 − (a + b) α²/2.

    Raised to a power and multiplied by a power of cos α it stays of this form, so that it draws the light on white
    paper seen square-on by any power-law response, whichever γ is assumed.
    """

    a: Scalar
    b: Scalar

    def __call__(self, cos_alpha: FloatImage) -> FloatImage:
        beam = module_of(cos_alpha, self.b).exp(-self.b * (1 - cos_alpha))
        return power(cos_alpha, self.a) * beam


def parse_response(text: str) -> AbstractResponse:
    """`srgb`, `linear` or `gamma:G` as a response."""
    forms = {"srgb": (SRGBResponse, ()), "linear": (LinearResponse, ()), "gamma": (GammaResponse, ("G",))}
    return parse_form("response", text, forms)


def parse_falloff(text: str) -> AbstractFalloff:
    """`none`, `cos:MU`, `exp:MU` or `cosexp:A,B` as a fall-off."""
    forms = {
        "none": (NoFalloff, ()),
        "cos": (CosineFalloff, ("MU",)),
        "exp": (ExponentialFalloff, ("MU",)),
        "cosexp": (CosineExponentialFalloff, ("A", "B")),
    }
    return parse_form("falloff", text, forms)
