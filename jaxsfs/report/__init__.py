"""Pages to look at: one self-contained HTML file each, no network."""

from jaxsfs.report._calibration import calibration_page as calibration_page
from jaxsfs.report._white import white_page as white_page
from jaxsfs.report._white import white_summary as white_summary
