"""`jaxsfs rectify`: a wide-angle photograph as a perspective camera would have taken it."""

import dataclasses
import json
from pathlib import Path
from typing import Annotated

from tyro.conf import Positional

from jaxsfs.cli._options import FLAT, value
from jaxsfs.cli._terminal import jax_session, say


@dataclasses.dataclass(frozen=True)
class RectifyOptions:
    # The photograph.
    image: Annotated[Positional[Path], value("IMAGE")]
    # Camera file of exactly this image size.
    camera: Annotated[Path, value("FILE")]
    # The picture to write; black where the photograph shows nothing.
    out: Annotated[Path, value("PNG")]
    # Half of the new picture's horizontal angle; by default the scale in the middle stays the same.
    half_field_deg: Annotated[float | None, value("DEG", default="none", option="half-field")] = None
    # Replace the picture.
    force: bool = False
    # Print the perspective camera as a camera file instead of a summary.
    json: bool = False


def rectify(options: Annotated[RectifyOptions, FLAT]) -> int:
    """Removes a lens's distortion: the photograph seen by a perspective camera of the same size (eqs. 14 and 15).

    For example:
      jaxsfs render plane --out view
      jaxsfs rectify view/image.png --camera view/camera.json --half-field 45 --out flat.png
    """
    with jax_session(32):
        return _write_rectified(options)


def _write_rectified(options: RectifyOptions) -> int:
    import cv2
    import numpy as np

    from jaxsfs import files
    from jaxsfs.camera import camera_to_dict, perspective_like, rectification_map
    from jaxsfs.photo import size_message

    camera = files.read_camera(options.camera).camera
    photo = files.read_image(options.image)
    height, width = photo.valid.shape
    if (camera.width, camera.height) != (width, height):
        raise files.InputError(size_message(str(options.image), (width, height), camera))
    target = perspective_like(camera, options.half_field_deg)
    seen_at = np.asarray(rectification_map(camera, target), np.float32)
    values = np.asarray(photo.values, np.float32) / max(1.0, float(photo.values.max()))
    # pixels without a source lie outside the photograph, which remap fills with black
    seen_at = np.where(np.isfinite(seen_at), seen_at, -2)
    rectified = cv2.remap(values, seen_at[..., 0], seen_at[..., 1], cv2.INTER_CUBIC, borderMode=cv2.BORDER_CONSTANT)
    kind = np.uint8 if photo.dtype == "uint8" else np.uint16
    files.write_png(
        options.out, np.rint(np.clip(rectified, 0, 1) * np.iinfo(kind).max).astype(kind), force=options.force
    )
    if options.json:
        print(json.dumps(camera_to_dict(target), indent=2))
    else:
        say(f"{options.out}: {width} x {height} px, perspective, focal length {float(target.fx):.6g} px")
    return 0
