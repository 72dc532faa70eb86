"""The page that a reconstruction leaves beside its files."""

from collections.abc import Iterator, Mapping
from typing import Any, Literal

import numpy as np
from jaxtyping import Float

from jaxsfs.animation import front_frames
from jaxsfs.cli._reconstruct_input import Input
from jaxsfs.preparation import Preparation
from jaxsfs.reconstruction import Reconstruction, residual_map
from jaxsfs.rendering import render_lights
from jaxsfs.report import reconstruction_page


def report(
    given: Input,
    result: Reconstruction,
    prepared: Preparation,
    record: Mapping[str, Any],
    light: Literal["camera", "distant"],
    uncertainty: Float[np.ndarray, "height width"] | None = None,
) -> str:
    """The HTML page of a result; `record` is result.json, `uncertainty` 1σ of the range where there is one."""
    return reconstruction_page(
        result,
        prepared,
        given.photo.rgb8(),
        record,
        residual=_residual(given, result, light),
        uncertainty=uncertainty,
        usable=given.valid,
    )


def fronts(given: Input, result: Reconstruction, light: Literal["camera", "distant"]) -> Iterator[np.ndarray]:
    """The frames of `--animate`: when the front arrives at each pixel is what the surface's range says."""
    surface = result.surface
    distance = np.where(np.asarray(surface.valid), np.asarray(surface.range, np.float64), np.nan)
    if light == "camera":
        return front_frames(given.photo.rgb8(), np.log(distance), label=f"r = {{:.4g}} {given.settings.unit}")
    return front_frames(given.photo.rgb8(), distance, label="z = {:.4g}", logarithmic=False)


def _residual(given: Input, result: Reconstruction, light: Literal["camera", "distant"]):
    """Under the lights that the surface was made for."""
    reflectance = given.settings.parsed("reflectance")
    if given.lights is None:
        return residual_map(result, reflectance=reflectance, light=light)
    seen = render_lights(result.surface, given.lights, reflectance=reflectance, albedo=result.albedo)
    used = np.asarray(seen.valid & result.irradiance.valid)
    expected, stored = np.asarray(seen.values), np.asarray(result.irradiance.values)
    mean = stored[used].mean() if used.any() else 1.0
    return np.where(used, np.abs(expected - stored) / mean, np.nan)
