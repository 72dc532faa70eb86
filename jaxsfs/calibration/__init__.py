"""Calibration from photographs of printed targets.

Names are imported when first used: a calibration by circles does not wait for the libraries of the others.
"""

from typing import TYPE_CHECKING

from jaxsfs._lazy import importer

_HOME = {
    "_compare": ("ModelScore",),
    "_lens": ("LENSES",),
    "_observations": ("Observations", "observations"),
    "_plane": ("PlanePose", "tilted"),
    "_result": ("Calibration", "ViewResult"),
    "circles": ("calibrate_circles",),
    "lines": ("calibrate_grid",),
    "points": ("calibrate_checkerboard", "calibrate_dots", "calibrate_points"),
    "white": ("WhiteCalibration", "calibrate_white"),
}
_MODULE_OF = {name: f"jaxsfs.calibration.{module}" for module, names in _HOME.items() for name in names}

if TYPE_CHECKING:  # what the table says, for editors and type checkers
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


__getattr__ = importer(__name__, _MODULE_OF)
