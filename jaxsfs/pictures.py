"""Pictures for the eye: 8-bit red, green, blue; pixels without data are neutral grey."""

import cv2
import numpy as np
from jaxtyping import Array, Bool, Float, UInt8

from jaxsfs.geometry import Geometry, geometry
from jaxsfs.surface import Surface

_NO_DATA = 96  # grey level: occurs in neither picture's important range
# The light comes from the upper left of the camera and from somewhat behind it (x right, y down, z forward).
_TO_LIGHT = np.array([-0.55, -0.6, -0.58])


def depth_picture(
    values: Float[Array | np.ndarray, "height width"], valid: Bool[Array | np.ndarray, "height width"]
) -> UInt8[np.ndarray, "height width 3"]:
    """Range or depth in the viridis colours, yellow near to violet far, even steps in ln(value).

    The ends are the 1st and 99th percentile of the valid pixels, so a few wild ones do not flatten the rest.
    """
    values, usable = np.asarray(values, np.float64), np.asarray(valid)
    usable = usable & np.isfinite(values) & (values > 0)
    level = np.full(values.shape, 0.5)
    if usable.any():
        log = np.log(np.where(usable, values, 1))
        near, far = np.percentile(log[usable], [1, 99])
        if far > near:
            level = np.clip((far - log) / (far - near), 0, 1)
    coloured = cv2.applyColorMap(np.round(255 * level).astype(np.uint8), cv2.COLORMAP_VIRIDIS)[..., ::-1]
    return np.where(usable[..., None], coloured, np.uint8(_NO_DATA))


def shaded_picture(surface: Surface, space: Geometry | None = None) -> UInt8[np.ndarray, "height width 3"]:
    """The surface as matte white plaster under a distant oblique light: (½ + ½ n·l)², n the normal, l to the light.

    A light at the camera would repeat the photograph; from the side, relief shows. The halved cosine keeps slopes
    that face away from the light readable. `space`: the surface's geometry, where it is known already.
    """
    space = geometry(surface) if space is None else space
    light = _TO_LIGHT / np.linalg.norm(_TO_LIGHT)
    usable = space.has_normal & np.isfinite(space.normals).all(axis=-1)
    cosine = np.where(usable[..., None], space.normals, 0) @ light
    linear = np.clip(0.5 + 0.5 * cosine, 0, 1) ** 2
    stored = np.round(255 * linear ** (1 / 2.2)).astype(np.uint8)
    return np.repeat(np.where(usable, stored, np.uint8(_NO_DATA))[..., None], 3, axis=-1)
