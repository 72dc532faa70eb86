"""Cameras: pixel ↔ ray, and the metric that a camera gives to its image (design: one array for the solvers)."""

from jaxsfs.camera._base import AbstractCamera as AbstractCamera, AbstractCentralCamera as AbstractCentralCamera
from jaxsfs.camera._description import (
    CameraFile as CameraFile,
    camera_from_dict as camera_from_dict,
    camera_to_dict as camera_to_dict,
)
from jaxsfs.camera._orthographic import Orthographic as Orthographic
from jaxsfs.camera._radial import (
    AbstractRadialCamera as AbstractRadialCamera,
    Equidistant as Equidistant,
    Equisolid as Equisolid,
    KannalaBrandt as KannalaBrandt,
    Perspective as Perspective,
    Spherical as Spherical,
    Stereographic as Stereographic,
)
from jaxsfs.camera._rectify import perspective_like as perspective_like, rectification_map as rectification_map
from jaxsfs.camera._scaramuzza import Scaramuzza as Scaramuzza
