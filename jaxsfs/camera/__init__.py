"""Cameras: pixel ↔ ray, and the metric that a camera gives to its image (design: one array for the solvers)."""

from jaxsfs.camera._base import AbstractCamera as AbstractCamera
from jaxsfs.camera._base import AbstractCentralCamera as AbstractCentralCamera
from jaxsfs.camera._description import (
    CameraFile as CameraFile,
)
from jaxsfs.camera._description import (
    camera_from_dict as camera_from_dict,
)
from jaxsfs.camera._description import (
    camera_to_dict as camera_to_dict,
)
from jaxsfs.camera._orthographic import Orthographic as Orthographic
from jaxsfs.camera._radial import (
    AbstractRadialCamera as AbstractRadialCamera,
)
from jaxsfs.camera._radial import (
    Equidistant as Equidistant,
)
from jaxsfs.camera._radial import (
    Equisolid as Equisolid,
)
from jaxsfs.camera._radial import (
    KannalaBrandt as KannalaBrandt,
)
from jaxsfs.camera._radial import (
    Perspective as Perspective,
)
from jaxsfs.camera._radial import (
    Spherical as Spherical,
)
from jaxsfs.camera._radial import (
    Stereographic as Stereographic,
)
from jaxsfs.camera._rectify import perspective_like as perspective_like
from jaxsfs.camera._rectify import rectification_map as rectification_map
from jaxsfs.camera._scaramuzza import Scaramuzza as Scaramuzza
