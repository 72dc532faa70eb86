"""Pictures of `data_synth` scenes for methods with the light at the lens, and how their answers are judged."""

from typing import NamedTuple

import cv2
import jax
import numpy as np

from data_synth import AbstractScene, View, default_camera, observe, scene_from_text
from jaxsfs import AbstractCamera, evaluate, perspective_like, rectification_map

HALF_FIELD = 50
OPEN = ("plane", "tilted-plane", "ball", "hollow-ball", "wavy-wall", "tube")
OCCLUDED = ("polyps", "ball-in-bowl", "colon")


class NearImage(NamedTuple):
    """E, valid pixels, camera (spherical) and the truth."""

    values: np.ndarray
    mask: np.ndarray
    camera: AbstractCamera
    view: View

    @property
    def truth(self) -> np.ndarray:
        return np.asarray(self.view.surface.range, float)


class Errors(NamedTuple):
    """AbsRel of range after median alignment, mean angle of the normals in degrees, share of pixels with an answer."""

    abs_rel: float
    normals_deg: float
    share: float


def near_image(scene: str | AbstractScene, size: int, camera: AbstractCamera | None = None) -> NearImage:
    """The exact view of a scene in a round field of 50°, computed in double precision."""
    shape = scene_from_text(scene) if isinstance(scene, str) else scene
    camera = default_camera(shape, size, size, HALF_FIELD) if camera is None else camera
    with jax.enable_x64(True):
        view = observe(shape, camera, half_field_deg=HALF_FIELD)
        view = jax.tree.map(np.asarray, view)
    return NearImage(np.asarray(view.irradiance.values), np.asarray(view.surface.valid), camera, view)


def errors(image: NearImage, found: np.ndarray) -> Errors:
    """Of a range map, NaN where there is no answer."""
    usable = image.mask & np.isfinite(found)
    result = evaluate(
        np.where(usable, found, np.nan),
        np.where(image.mask, image.truth, np.nan),
        align="median",
        camera=image.camera,
        truth_normals=np.asarray(image.view.normals),
    )
    angle = np.nan if result.normals is None else result.normals.mean_deg
    return Errors(result.abs_rel, angle, result.fraction)


class Rectified(NamedTuple):
    """The picture as a pinhole with the same field would have taken it, and the way back."""

    values: np.ndarray
    mask: np.ndarray
    focal_length: float
    back: np.ndarray

    def returned(self, found: np.ndarray) -> np.ndarray:
        """A range map of the pinhole at the pixels of the original picture: range belongs to rays, so it stays."""
        known = np.isfinite(found)
        filled = np.where(known, found, np.nanmedian(found)).astype(np.float32)
        share = _remapped(known.astype(np.float32), self.back)
        return np.where(share > 0.99, _remapped(filled, self.back), np.nan)


def rectified(image: NearImage) -> Rectified:
    """Section 5's other way: warp the picture by eq. (15), E kept, then treat it as a pinhole's."""
    pinhole = perspective_like(image.camera, HALF_FIELD)
    there = np.asarray(rectification_map(image.camera, pinhole), np.float32)
    back = np.asarray(rectification_map(pinhole, image.camera), np.float32)
    # linear interpolation reads E only where all four neighbours have data
    inside = _remapped(image.mask.astype(np.float32), there) > 0.999
    values = np.where(inside, _remapped(image.values.astype(np.float32), there), 0)
    return Rectified(values.astype(float), inside, float(pinhole.fx), back)


def _remapped(picture: np.ndarray, where: np.ndarray) -> np.ndarray:
    where = np.nan_to_num(where, nan=-10.0)
    return cv2.remap(picture, where[..., 0], where[..., 1], cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT)
