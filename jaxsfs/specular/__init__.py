"""Removal of specular reflection (Section 3 of the paper): dichromatic separation, detection and fill of highlights."""

from jaxsfs.specular._clipped import Restored as Restored
from jaxsfs.specular._clipped import restore_clipped as restore_clipped
from jaxsfs.specular._colour import body_colour as body_colour
from jaxsfs.specular._colour import interface_colour as interface_colour
from jaxsfs.specular._colour import noise_covariance as noise_covariance
from jaxsfs.specular._detection import saturated as saturated
from jaxsfs.specular._dichromatic import LUMINANCE as LUMINANCE
from jaxsfs.specular._dichromatic import RED_MINUS_GREEN as RED_MINUS_GREEN
from jaxsfs.specular._dichromatic import WHITE as WHITE
from jaxsfs.specular._dichromatic import body_strength as body_strength
from jaxsfs.specular._dichromatic import interface_free_vector as interface_free_vector
from jaxsfs.specular._dichromatic import saturation as saturation
from jaxsfs.specular._dichromatic import separate as separate
from jaxsfs.specular._removal import HighlightRemoval as HighlightRemoval
from jaxsfs.specular._removal import Method as Method
from jaxsfs.specular._removal import SpecularReport as SpecularReport
from jaxsfs.specular._removal import remove_highlights as remove_highlights
from jaxsfs.specular._removal import untouched as untouched
