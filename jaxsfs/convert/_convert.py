"""A camera to and from another program's text."""

from typing import NamedTuple

from jaxsfs.camera import AbstractCamera, CameraFile
from jaxsfs.convert._fit import Misfit
from jaxsfs.convert._formats import FORMATS, WRITABLE, format_of_text
from jaxsfs.convert._standard import Standard, camera_of, standard_of
from jaxsfs.forms import Scalar


class Exported(NamedTuple):
    """`text` of the file; `misfit` where the format has no such lens and the file approximates it; `lost`: keys of the
    camera file that the format has no place for."""

    text: str
    misfit: Misfit | None
    lost: tuple[str, ...]


class Imported(NamedTuple):
    """`camera`; `misfit` where we have no such lens and the camera approximates it; `unused`: keys of the source that
    were not read."""

    camera: AbstractCamera
    misfit: Misfit | None
    unused: tuple[str, ...]


def export_camera(camera: AbstractCamera | CameraFile, format: str, remark: str = "") -> Exported:
    """`camera` as text for another program: "opencv", "kalibr", "ros", "colmap" or "nerfstudio".

    Perspective cameras become pinholes, all others Kannala–Brandt fisheyes |q| = θ + k₁θ³ + … + k₄θ⁹: exact for
    equidistant and Kannala–Brandt cameras, else fitted to the pixels that the image shows. Pixel origins are the
    format's own. `remark`: written as a comment too. Raises ValueError for an unknown format and an orthographic
    camera.
    """
    write = FORMATS[format].write if format in FORMATS else None
    if write is None:
        raise ValueError(f"format {format!r} cannot be written; write one of: {', '.join(WRITABLE)}")
    file = camera if isinstance(camera, CameraFile) else CameraFile(camera, {}, {})
    lens, misfit = standard_of(file.camera)
    lost = (*(f"photometry.{key}" for key in file.photometry), *file.other)
    comment = f"written by jaxsfs from a camera of model {type(file.camera).__name__}"
    if misfit is not None:
        comment += f"\nan approximation of it: {misfit}"
    if remark:
        comment += f"\n{remark}"
    return Exported(write(lens, comment), misfit, lost)


def import_camera(
    text: str, format: str | None = None, size: tuple[int, int] | None = None, tolerance: Scalar = 0.5
) -> Imported:
    """The camera that `text`, a file of another program, describes; `format` None: told from the content.

    `size`: width and height in px where the file lacks them. A pinhole with radial and tangential distortion becomes
    the Kannala–Brandt camera fitted to it over the image. Raises ValueError when that misses by more than `tolerance`
    px, when the size is unknown or contradicts the file, and for what the file's own reader cannot read.
    """
    name = format_of_text(text) if format is None else format
    if name not in FORMATS:
        raise ValueError(f"format {name!r} is unknown; write one of: {', '.join(FORMATS)}")
    found = FORMATS[name].read(text)
    camera, misfit = camera_of(_sized(found.standard, size), tolerance)
    return Imported(camera, misfit, found.unused)


def _sized(lens: Standard, size: tuple[int, int] | None) -> Standard:
    own = (lens.width, lens.height)
    if own == (0, 0):
        if size is None:
            raise ValueError("the file does not say how large the image is; give it (--size WIDTH HEIGHT)")
        if min(size) < 1:
            raise ValueError(f"width and height must be at least 1 px, got {size[0]} x {size[1]}")
        return lens._replace(width=size[0], height=size[1])
    if size is not None and size != own:
        raise ValueError(
            f"the file is for images of {own[0]} x {own[1]} px, but {size[0]} x {size[1]} px are asked for; convert "
            "it as it is, then resize the camera"
        )
    return lens
