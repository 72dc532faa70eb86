"""`reconstruct --uncertainty`: the 1σ map of the range."""

from collections.abc import Callable
from typing import Any

import numpy as np
from jaxtyping import Float

from jaxsfs.camera import AbstractCentralCamera
from jaxsfs.cli._reconstruct_input import Input
from jaxsfs.irradiance import Irradiance
from jaxsfs.noise import noise_level
from jaxsfs.preparation import Preparation
from jaxsfs.reconstruction import Reconstruction
from jaxsfs.uncertainty import calibration_sigma, irradiance_sigma, lens_covariance, noise_sigma

NOT_IN_IT = "model error (other light, interreflection, albedo, highlights, response, fall-off) is not in it"

Solution = Callable[[Irradiance, AbstractCentralCamera], Reconstruction]


def range_sigma(
    given: Input, prepared: Preparation, result: Reconstruction, solution: Solution
) -> tuple[Float[np.ndarray, "height width"], dict[str, Any]]:
    """1σ of the range in its own unit, NaN where there is none, and what went into it.

    Pixels whose irradiance is a fill have none: nothing was measured there.
    """
    camera, settings = given.file.camera, given.settings
    assert isinstance(camera, AbstractCentralCamera)
    stored = _stored_sigma(given)
    sigma = irradiance_sigma(
        prepared.irradiance,
        camera,
        stored,
        response=settings.parsed("response"),
        falloff=settings.parsed("falloff"),
    )
    noise = noise_sigma(
        lambda irradiance: solution(irradiance, camera).surface,
        prepared.irradiance,
        sigma,
        smooth_px=given.smooth.value,
    )
    covariance = lens_covariance(given.file)
    lens = np.zeros_like(noise)
    if covariance is not None:
        lens = calibration_sigma(lambda moved: solution(prepared.irradiance, moved).surface, camera, covariance)
    distance = np.asarray(result.surface.range, np.float64)
    known = np.asarray(result.surface.valid) & ~prepared.filled
    total = np.where(known, distance * np.hypot(noise, lens), np.nan)
    record = {
        "stored_noise": stored,
        "from_noise_median": _median(distance * noise, known),
        "from_calibration_median": None if covariance is None else _median(distance * lens, known),
        "median": _median(total, known),
        "relative_median": _median(total / distance, known),
        "statement": f"1 sigma of the range from noise{' and calibration' if covariance is not None else ''}; "
        + NOT_IN_IT,
    }
    return total, record


def _stored_sigma(given: Input) -> float:
    """1σ of the weighted channel's stored value, full scale 1: measured, but at least that of rounding. Noise is
    measured on the mean of the channels, taken to be independent of each other."""
    values = given.photo.values
    scale = max(1.0, float(values.max()))
    measured = noise_level(values / scale, given.valid) * scale
    kind = np.dtype(given.photo.dtype)
    rounding = 1 / np.iinfo(kind).max / np.sqrt(12) if np.issubdtype(kind, np.integer) else 0.0
    if values.ndim == 2 or values.shape[-1] == 1:
        return float(max(measured, rounding))
    weights = np.asarray(given.settings.parsed("channel"), np.float64)
    return float(max(measured * np.sqrt(3), rounding) * np.linalg.norm(weights))


def _median(values: Float[np.ndarray, "height width"], known: np.ndarray) -> float | None:
    found = values[known & np.isfinite(values)]
    return float(np.median(found)) if found.size else None
