"""Calibration from photographs of printed targets."""

from jaxsfs.calibration._compare import ModelScore as ModelScore
from jaxsfs.calibration._lens import LENSES as LENSES
from jaxsfs.calibration._observations import Observations as Observations, observations as observations
from jaxsfs.calibration._plane import PlanePose as PlanePose, tilted as tilted
from jaxsfs.calibration._result import Calibration as Calibration, ViewResult as ViewResult
from jaxsfs.calibration.circles import calibrate_circles as calibrate_circles
from jaxsfs.calibration.lines import calibrate_grid as calibrate_grid
from jaxsfs.calibration.points import (
    calibrate_checkerboard as calibrate_checkerboard,
    calibrate_dots as calibrate_dots,
    calibrate_points as calibrate_points,
)
from jaxsfs.calibration.white import WhiteCalibration as WhiteCalibration, calibrate_white as calibrate_white
