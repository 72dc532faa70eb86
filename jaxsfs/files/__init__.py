"""Reading and writing: with the command line, the only code of the package that touches files.

Names are imported when first used: a command that only writes bytes does not wait for JAX.
"""

from typing import TYPE_CHECKING

from jaxsfs._lazy import importer

_HOME = {
    "_also": ("check_formats", "write_also"),
    "_animations": ("write_animation",),
    "_atomic": ("InputError", "output_folder", "read_bytes", "write_bytes"),
    "_maps": ("read_map", "write_png", "write_tiff"),
    "_meshes": ("write_mesh",),
    "_formats": ("Format",),
    "_more_maps": ("write_exr", "write_pfm", "write_png16"),
    "_more_meshes": ("write_obj", "write_stl"),
    "_photo": ("Photo", "read_image", "read_mask"),
    "_read_mesh": ("MESH_SUFFIXES", "read_mesh"),
    "_records": ("read_camera", "read_json", "read_lights", "write_camera", "write_json"),
    "_result": ("StoredResult", "read_result"),
    "_surface": ("write_surface",),
}
_MODULE_OF = {name: f"jaxsfs.files.{module}" for module, names in _HOME.items() for name in names}

if TYPE_CHECKING:  # what the table says, for editors and type checkers
    from jaxsfs.files._also import check_formats as check_formats, write_also as write_also
    from jaxsfs.files._animations import write_animation as write_animation
    from jaxsfs.files._atomic import (
        InputError as InputError,
        output_folder as output_folder,
        read_bytes as read_bytes,
        write_bytes as write_bytes,
    )
    from jaxsfs.files._formats import Format as Format
    from jaxsfs.files._maps import read_map as read_map, write_png as write_png, write_tiff as write_tiff
    from jaxsfs.files._meshes import write_mesh as write_mesh
    from jaxsfs.files._more_maps import write_exr as write_exr, write_pfm as write_pfm, write_png16 as write_png16
    from jaxsfs.files._more_meshes import write_obj as write_obj, write_stl as write_stl
    from jaxsfs.files._photo import Photo as Photo, read_image as read_image, read_mask as read_mask
    from jaxsfs.files._read_mesh import MESH_SUFFIXES as MESH_SUFFIXES, read_mesh as read_mesh
    from jaxsfs.files._records import (
        read_camera as read_camera,
        read_json as read_json,
        read_lights as read_lights,
        write_camera as write_camera,
        write_json as write_json,
    )
    from jaxsfs.files._result import StoredResult as StoredResult, read_result as read_result
    from jaxsfs.files._surface import write_surface as write_surface


__getattr__ = importer(__name__, _MODULE_OF)
