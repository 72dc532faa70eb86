"""Cameras in the formats of other programs: OpenCV, Kalibr, ROS, COLMAP, nerfstudio."""

from jaxsfs.convert._convert import Exported as Exported
from jaxsfs.convert._convert import Imported as Imported
from jaxsfs.convert._convert import export_camera as export_camera
from jaxsfs.convert._convert import import_camera as import_camera
from jaxsfs.convert._fit import Misfit as Misfit
from jaxsfs.convert._formats import FORMATS as FORMATS
from jaxsfs.convert._formats import WRITABLE as WRITABLE
from jaxsfs.convert._formats import format_of_name as format_of_name
from jaxsfs.convert._formats import format_of_text as format_of_text
