"""Calibration from photographs of printed targets."""

from jaxsfs.calibration._compare import ModelScore as ModelScore
from jaxsfs.calibration._lens import LENSES as LENSES
from jaxsfs.calibration._observations import Observations as Observations
from jaxsfs.calibration._observations import observations as observations
from jaxsfs.calibration._plane import PlanePose as PlanePose
from jaxsfs.calibration._plane import tilted as tilted
from jaxsfs.calibration._result import Calibration as Calibration
from jaxsfs.calibration._result import ViewResult as ViewResult
from jaxsfs.calibration.circles import calibrate_circles as calibrate_circles
from jaxsfs.calibration.lines import calibrate_grid as calibrate_grid
from jaxsfs.calibration.points import calibrate_checkerboard as calibrate_checkerboard
from jaxsfs.calibration.points import calibrate_dots as calibrate_dots
from jaxsfs.calibration.points import calibrate_points as calibrate_points
from jaxsfs.calibration.white import WhiteCalibration as WhiteCalibration
from jaxsfs.calibration.white import calibrate_white as calibrate_white
