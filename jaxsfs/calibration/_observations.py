"""What a calibration saw: every observation with its residual, ready for pictures and tables."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from jaxsfs.calibration._fit import rays_of
from jaxsfs.calibration._result import Calibration
from jaxsfs.calibration._vectors import photograph_of_rows, residual_vectors


class Observations(NamedTuple):
    """One row per observation: `pixel`, `residual` (seen minus fitted, px), `alpha_deg` (angle of the ray from the
    axis), index `view` into the calibration's views, and whether the fit `used` it."""

    pixel: Float[np.ndarray, "count 2"]
    residual: Float[np.ndarray, "count 2"]
    alpha_deg: Float[np.ndarray, " count"]
    view: Int[np.ndarray, " count"]
    used: Bool[np.ndarray, " count"]


def observations(found: Calibration) -> Observations:
    """Every observation of the calibration, those that the fit culled included."""
    fitted = found.fit
    pixel = fitted.setup.observations.pixel
    lines = [view.figures["lines"] for view in found.views] if fitted.setup.kind == "lines" else []
    alpha = np.degrees(np.arccos(np.clip(rays_of(fitted, pixel)[:, 2], -1, 1)))
    view = photograph_of_rows(fitted, lines)
    return Observations(pixel, residual_vectors(fitted), alpha, view, fitted.weight > 0)
