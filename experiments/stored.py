"""From a stored sRGB picture to irradiance, with the defaults of the command line."""

import numpy as np

from jaxsfs import AbstractCamera, Irradiance, SRGBResponse
from jaxsfs.noise import noise_level, smoothing_for
from jaxsfs.photo import parse_channel
from jaxsfs.photometry import NoFalloff
from jaxsfs.preparation import prepare
from jaxsfs.specular import Method


def irradiance_of_stored(
    stored: np.ndarray,
    camera: AbstractCamera,
    valid: np.ndarray,
    *,
    specular: Method = "auto",
    channel: str = "luminance",
    blood: float = 0.0,
    shrink: int | None = None,
) -> Irradiance:
    """`stored`: 8-bit values over 255; smoothed by the noise found in it, highlights and clipping dealt with."""
    return prepare(
        stored,
        camera,
        response=SRGBResponse(),
        falloff=NoFalloff(),
        weights=parse_channel(channel),
        valid=valid,
        specular=specular,
        smooth_px=smoothing_for(noise_level(stored, valid)),
        blood=blood,
        shrink=shrink,
    ).irradiance
