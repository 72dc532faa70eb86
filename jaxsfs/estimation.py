"""Response, fall-off and reflectance of a scope from one photograph and a few known ranges in it.

One photograph alone fits any response and fall-off exactly (every image is the image of some surface), so its residual
says nothing. Known ranges do: the reconstruction's ln r must differ from theirs by one constant. Few of them leave
most of it to what is known beforehand, and the less they say, the nearer the estimate stays to that.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float
from scipy.optimize import least_squares

from jaxsfs.camera import AbstractCamera
from jaxsfs.photo import irradiance_of
from jaxsfs.photometry import AbstractFalloff, AbstractResponse, CosineFalloff, GammaResponse
from jaxsfs.reconstruction import reconstruct
from jaxsfs.reflectance import AbstractReflectance, Power

_WIDTH = 200  # px: the size that the repeated solutions are done at
_LOWEST, _HIGHEST = np.array([math.log(1.0), 0.0, 0.3]), np.array([math.log(4.0), 4.0, 1.5])


class Prior(NamedTuple):
    """What is known before any range: γ, μ and a, with the 1σ of ln γ, μ and a (`sd`); the 1σ of ln r at a pixel that
    the photometry does not explain (`range_sd`); and the `least` number of ranges that helped."""

    gamma: float = 2.2
    mu: float = 1.0
    power: float = 0.8
    sd: tuple[float, float, float] = (0.3, 1.0, 0.3)
    range_sd: float = 0.01
    least: int = 5

    def mean(self) -> Float[np.ndarray, "3"]:
        """ln γ, μ, a."""
        return np.array([math.log(self.gamma), self.mu, self.power])


WEAK = Prior()
_FORMS = "a photometry is estimated as gamma:G, cos:MU and power:A; the preset has another form"
# 1σ of a known kind of scope. 0.1 of ln r is about what light between walls and vessels leave. On tubes such as
# `experiments/lumens.py` makes, to believe two ranges within 0.01 gains as much or more in the mean, and loses twice as
# much where it goes wrong.
_SCOPE_SD, _SCOPE_RANGE_SD, _SCOPE_LEAST = (0.15, 0.5, 0.15), 0.1, 2


def prior_about(response: AbstractResponse, falloff: AbstractFalloff, reflectance: AbstractReflectance) -> Prior:
    """The prior that a kind of scope stands for: within 15 % of its γ, 0.5 of its μ and 0.15 of its a.

    Raises ValueError for other forms than gamma, cos^μ and cos^a.
    """
    if not isinstance(response, GammaResponse) or not isinstance(falloff, CosineFalloff):
        raise ValueError(_FORMS)
    if not isinstance(reflectance, Power):
        raise ValueError(_FORMS)
    values = float(response.gamma), float(falloff.mu), float(reflectance.a)
    return Prior(*values, _SCOPE_SD, _SCOPE_RANGE_SD, _SCOPE_LEAST)


class PhotometryEstimate(eqx.Module):
    """stored = light^(1/`gamma`), V = cos^`mu` α, G = cos^`power` θ, with their 1σ, and `gain_albedo` in the unit of
    the known ranges squared. `misfit_before`, `misfit`: rms of ln r − ln r_known after one factor, at the priors' mean
    and at the estimate. `known`: number of ranges used."""

    gamma: float
    mu: float
    power: float
    sd: tuple[float, float, float]
    gain_albedo: float
    misfit_before: float
    misfit: float
    known: int

    def texts(self) -> dict[str, str]:
        """Settings as the command line and camera files write them."""
        return {
            "response": f"gamma:{self.gamma:.5g}",
            "falloff": f"cos:{self.mu:.5g}",
            "reflectance": f"power:{self.power:.5g}",
        }


def estimate_photometry(
    stored: Float[np.ndarray, "height width"],
    camera: AbstractCamera,
    known: Sequence[tuple[int, int, float]],
    valid: Bool[np.ndarray, "height width"],
    prior: Prior = WEAK,
) -> PhotometryEstimate:
    """γ, μ and a (see `PhotometryEstimate`) from `known` ranges (u, v, r), the most probable ones given a `prior`.

    `stored`: grey values as the response left them, highlights and clipping removed. Minimises
    Σ (ln r(u, v) − ln r_known − c)²/σ_r² + ((ln γ − ln γ₀)/σ_γ)² + ((μ − μ₀)/σ_μ)² + ((a − a₀)/σ_a)² over repeated
    solutions at reduced size. Ranges should differ, and lie at different angles from the axis.

    Raises ValueError for fewer usable ranges than the prior asks for. With the weak one these are five: three made a
    tilted plane worse, five made every scene better.
    """
    step = max(1, round(camera.width / _WIDTH))
    small, inside, reduced = _reduced(stored, valid, camera, step)
    points = [(u // step, v // step, r) for u, v, r in known]
    points = [(u, v, r) for u, v, r in points if u < reduced.width and v < reduced.height and inside[v, u]]
    if len(points) < prior.least:
        raise ValueError(
            f"an estimate of the photometry needs at least {prior.least} known ranges at usable pixels, got "
            f"{len(points)} of {len(known)}: give more, at different distances, away from highlights and the border"
        )
    true, start = np.log([r for *_, r in points]), prior.mean()

    def gaps(parameters: Float[np.ndarray, "3"]) -> Float[np.ndarray, " count"]:
        return _log_ranges(small, reduced, inside, points, parameters) - true

    def residuals(parameters: Float[np.ndarray, "3"]) -> Float[np.ndarray, " rows"]:
        gap = gaps(parameters)
        return np.concatenate([(gap - gap.mean()) / prior.range_sd, (parameters - start) / np.array(prior.sd)])

    found = least_squares(
        residuals, start, bounds=(_LOWEST, _HIGHEST), diff_step=0.02, loss="soft_l1", f_scale=3.0, max_nfev=12
    )
    sd = np.sqrt(np.diag(np.linalg.inv(found.jac.T @ found.jac)))
    gap = gaps(found.x)
    return PhotometryEstimate(
        gamma=float(np.exp(found.x[0])),
        mu=float(found.x[1]),
        power=float(found.x[2]),
        sd=(float(np.exp(found.x[0]) * sd[0]), float(sd[1]), float(sd[2])),
        gain_albedo=float(np.exp(-2 * np.median(gap))),
        misfit_before=float(np.std(gaps(start))),
        misfit=float(np.std(gap)),
        known=len(points),
    )


def _reduced(stored, valid, camera: AbstractCamera, step: int):
    """Means over blocks of `step` × `step` px, valid where all of a block is, and the camera of that size."""
    high, wide = stored.shape[0] // step, stored.shape[1] // step
    cut = np.s_[: high * step, : wide * step]
    blocks = (high, step, wide, step)
    small = np.asarray(stored[cut], np.float64).reshape(blocks).mean(axis=(1, 3))
    inside = np.asarray(np.all(valid[cut].reshape(blocks), axis=(1, 3)))
    return small, inside, camera.cropped(0, 0, wide * step, high * step).resized(wide, high)


def _log_ranges(small, camera: AbstractCamera, inside, points, parameters) -> Float[np.ndarray, " count"]:
    """ln r at the points, the median over 3 × 3 px, of the solution with these parameters."""
    gamma, mu, power = float(np.exp(parameters[0])), float(parameters[1]), float(parameters[2])
    irradiance, _ = irradiance_of(
        small.astype(np.float32),
        camera,
        valid=inside,
        response=GammaResponse(jnp.asarray(gamma, float)),
        falloff=CosineFalloff(jnp.asarray(mu, float)),
        clip_limit=None,
    )
    surface = reconstruct(irradiance, camera, reflectance=Power(jnp.asarray(power, float))).surface
    log = np.where(np.asarray(surface.valid), np.log(np.asarray(surface.range, float)), np.nan)
    windows = [log[max(v - 1, 0) : v + 2, max(u - 1, 0) : u + 2] for u, v, _ in points]
    return np.array([np.nanmedian(window) for window in windows])
