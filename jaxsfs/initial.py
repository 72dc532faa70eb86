"""Initial curves: where the front starts, as pixels of known w (= ln r, or z for a distant light).

They add to the deadline rule, they do not replace it: near the light c ≤ 1 bounds the range at every pixel, whatever
curve the front started from.
"""

import abc

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from jaxsfs.forms import Scalar
from jaxsfs.shading import AbstractShading, DistantLight, LightAtCamera

Image = Float[Array, "height width"]
Mask = Bool[Array, "height width"]


class AbstractInitial(eqx.Module):
    """A choice of initial curve."""

    @abc.abstractmethod
    def known(self, shading: AbstractShading, inside: Mask) -> Image:
        """w on the initial curve and behind it, +inf elsewhere. Raises ValueError if it does not fit the image."""


class Deadline(AbstractInitial):
    """No curve: every pixel that faces the light becomes a source by itself. Light at the camera only."""

    def known(self, shading: AbstractShading, inside: Mask) -> Image:
        _near_light_only(shading, "the deadline rule")
        return jnp.full(inside.shape, jnp.inf, shading.deadline().dtype)


class SingularPoint(AbstractInitial):
    """A cone at one singular point (Kimmel & Bruckstein 1995a).

    `pixel` (u, v): without it, the valid pixel that needs the nearest surface. `range`: without it, the one at which
    the pixel faces the light (z = 0 for a distant light).
    """

    pixel: tuple[Scalar, Scalar] | None = None
    range: Scalar | None = None

    def known(self, shading: AbstractShading, inside: Mask) -> Image:
        facing = jnp.where(inside, shading.darkness(), jnp.inf)
        v, u = np.unravel_index(int(jnp.argmin(facing)), inside.shape)
        if self.pixel is not None:
            u, v = _nearest_pixel(self.pixel, inside, "the singular point")
        if self.range is not None:
            w = shading.from_range(self.range)
        else:
            w = 0.0 if isinstance(shading, DistantLight) else facing[v, u]
        known = jnp.full(inside.shape, jnp.inf, facing.dtype).at[v, u].set(w)
        _require_possible(known, shading, inside, "the range of the singular point")
        return known


class Threshold(AbstractInitial):
    """The curve at which the irradiance falls to `irradiance`; what is brighter faces the light (the paper's choice
    by a threshold to the intensity image)."""

    irradiance: Scalar

    def known(self, shading: AbstractShading, inside: Mask) -> Image:
        _near_light_only(shading, "a threshold")
        bound = shading.deadline()
        assert isinstance(shading, LightAtCamera)
        known = jnp.where(inside & (bound <= shading.bound_of(self.irradiance)), bound, jnp.inf)
        if not bool(jnp.any(jnp.isfinite(known))):
            brightest = float(shading.irradiance_of(jnp.min(jnp.where(inside, bound, jnp.inf))))
            raise ValueError(
                f"no valid pixel reaches the threshold {float(self.irradiance):.4g}; the brightest has irradiance "
                f"{brightest:.4g} (linear light): choose a lower threshold"
            )
        return known


class Curve(AbstractInitial):
    """Pixels of known range: an initial curve, or any region (Dirichlet values)."""

    mask: Mask
    range: Scalar

    def known(self, shading: AbstractShading, inside: Mask) -> Image:
        if self.mask.shape != inside.shape:
            raise ValueError(f"the curve's mask has shape {self.mask.shape}, the image {inside.shape}")
        on = self.mask & inside
        if not bool(jnp.any(on)):
            raise ValueError("the curve's mask has no pixel in the valid part of the image")
        known = jnp.where(on, shading.from_range(self.range), jnp.inf).astype(shading.deadline().dtype)
        _require_possible(known, shading, inside, "the curve's range")
        return known


class SummitHeights(AbstractInitial):
    """Singular points of known z for a distant light: rows (u, v, z), z along the optical axis (a summit that points
    at the camera has a small z). Local solutions merge by the pointwise minimum (Oliensis & Dupuis 1994)."""

    points: Float[Array, "points 3"]

    def known(self, shading: AbstractShading, inside: Mask) -> Image:
        if self.points.shape[0] == 0:
            raise ValueError("no singular point given: a distant light needs at least one row u,v,z")
        known = jnp.full(inside.shape, jnp.inf, shading.deadline().dtype)
        for u, v, z in np.asarray(self.points, float):
            column, row = _nearest_pixel((u, v), inside, "a singular point")
            known = known.at[row, column].min(float(shading.from_range(z)))
        return known


def _nearest_pixel(pixel: tuple[Scalar, Scalar], inside: Mask, what: str) -> tuple[int, int]:
    u, v = round(float(pixel[0])), round(float(pixel[1]))
    height, width = inside.shape
    if not (0 <= u < width and 0 <= v < height):
        raise ValueError(f"{what} ({u}, {v}) lies outside the image of {width} x {height} px")
    if not bool(inside[v, u]):
        raise ValueError(f"{what} ({u}, {v}) lies on a pixel without data (masked, clipped or too dark)")
    return u, v


def _near_light_only(shading: AbstractShading, what: str) -> None:
    if isinstance(shading, DistantLight):
        raise ValueError(
            f"{what} needs the 1/r² of a light at the camera; with a distant light give heights at singular points"
        )


def _require_possible(known: Image, shading: AbstractShading, inside: Mask, what: str) -> None:
    """A known range may not lie beyond the range at which the pixel would face the light."""
    excess = np.asarray(jax.lax.stop_gradient(known - shading.deadline()))[np.asarray(inside & jnp.isfinite(known))]
    typical = float(np.median(excess))
    if typical > 0.02:
        raise ValueError(
            f"{what} is {np.exp(typical):.3g} times the largest range that the brightness there allows "
            f"(r² ≤ ρ/E): give a smaller range, or a larger albedo"
        )
