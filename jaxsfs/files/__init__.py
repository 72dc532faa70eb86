"""Reading and writing: with the command line, the only code of the package that touches files."""

from jaxsfs.files._atomic import InputError as InputError
from jaxsfs.files._atomic import output_folder as output_folder
from jaxsfs.files._atomic import write_bytes as write_bytes
from jaxsfs.files._maps import read_map as read_map
from jaxsfs.files._maps import write_png as write_png
from jaxsfs.files._maps import write_tiff as write_tiff
from jaxsfs.files._meshes import write_mesh as write_mesh
from jaxsfs.files._photo import Photo as Photo
from jaxsfs.files._photo import read_image as read_image
from jaxsfs.files._photo import read_mask as read_mask
from jaxsfs.files._records import read_camera as read_camera
from jaxsfs.files._records import read_json as read_json
from jaxsfs.files._records import write_camera as write_camera
from jaxsfs.files._records import write_json as write_json
from jaxsfs.files._surface import write_surface as write_surface
