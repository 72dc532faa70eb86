"""Removal of specular reflection (Section 3 of the paper): dichromatic separation, detection and fill of highlights."""

from jaxsfs.specular._clipped import Restored as Restored, restore_clipped as restore_clipped
from jaxsfs.specular._colour import (
    body_colour as body_colour,
    interface_colour as interface_colour,
    noise_covariance as noise_covariance,
)
from jaxsfs.specular._compliance import Compliance as Compliance, dichromatic_compliance as dichromatic_compliance
from jaxsfs.specular._detection import saturated as saturated
from jaxsfs.specular._dichromatic import (
    LUMINANCE as LUMINANCE,
    RED_MINUS_GREEN as RED_MINUS_GREEN,
    WHITE as WHITE,
    body_strength as body_strength,
    interface_free_vector as interface_free_vector,
    saturation as saturation,
    separate as separate,
)
from jaxsfs.specular._removal import (
    HighlightRemoval as HighlightRemoval,
    Method as Method,
    SpecularReport as SpecularReport,
    remove_highlights as remove_highlights,
    untouched as untouched,
)
from jaxsfs.specular._sharpened import lost_edges as lost_edges
from jaxsfs.specular._split import ESTIMATED as ESTIMATED
