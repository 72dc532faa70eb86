"""Everything that a surface says about space, on the host."""

import equinox as eqx
import numpy as np
from jaxtyping import Bool, Float

from jaxsfs.surface import Surface


class Geometry(eqx.Module):
    """`points`, unit `rays` and unit `normals` towards the camera, in the camera frame (x right, y down, z forward).

    NumPy arrays; points and normals are meaningless where the surface is not valid, and normals where not `has_normal`.
    """

    points: Float[np.ndarray, "height width 3"]
    rays: Float[np.ndarray, "height width 3"]
    normals: Float[np.ndarray, "height width 3"]
    has_normal: Bool[np.ndarray, "height width"]


def geometry(surface: Surface) -> Geometry:
    """The geometry of `surface`."""
    parts = surface.points(), surface.camera.rays(surface.range.dtype), *surface.normals()
    return Geometry(*(np.asarray(part) for part in parts))
