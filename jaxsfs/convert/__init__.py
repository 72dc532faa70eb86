"""Cameras in the formats of other programs: OpenCV, Kalibr, ROS, COLMAP, nerfstudio."""

from jaxsfs.convert._convert import (
    Exported as Exported,
    Imported as Imported,
    export_camera as export_camera,
    import_camera as import_camera,
)
from jaxsfs.convert._fit import Misfit as Misfit
from jaxsfs.convert._formats import (
    FORMATS as FORMATS,
    WRITABLE as WRITABLE,
    format_of_name as format_of_name,
    format_of_text as format_of_text,
)
