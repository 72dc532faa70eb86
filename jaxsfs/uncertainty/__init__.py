"""How far noise and calibration let the range of a solution be wrong. That the model itself is wrong (other lights,
interreflection, albedo that varies, highlights, the response) is not in it."""

from jaxsfs.uncertainty._calibration import (
    LensCovariance as LensCovariance,
    calibration_sigma as calibration_sigma,
    lens_covariance as lens_covariance,
    moved_lens as moved_lens,
)
from jaxsfs.uncertainty._noise import irradiance_sigma as irradiance_sigma, noise_sigma as noise_sigma
