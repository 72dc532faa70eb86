"""Pages to look at: one self-contained HTML file each, no network.

Names are imported when first used: the page of a reconstruction does not wait for the calibrations' libraries.
"""

from typing import TYPE_CHECKING

from jaxsfs._lazy import importer

_MODULE_OF = {
    "calibration_page": "jaxsfs.report._calibration",
    "error_figure": "jaxsfs.report._errors",
    "reconstruction_page": "jaxsfs.report._reconstruction",
    "white_page": "jaxsfs.report._white",
    "white_summary": "jaxsfs.report._white",
}

if TYPE_CHECKING:  # what the table says, for editors and type checkers
    from jaxsfs.report._calibration import calibration_page as calibration_page
    from jaxsfs.report._errors import error_figure as error_figure
    from jaxsfs.report._reconstruction import reconstruction_page as reconstruction_page
    from jaxsfs.report._white import white_page as white_page, white_summary as white_summary


__getattr__ = importer(__name__, _MODULE_OF)
