"""Bare paper in a photograph of a sheet at known pose: cells of it, with their geometry."""

import dataclasses
from collections.abc import Callable

import cv2
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Shaped
from scipy import ndimage

from jaxsfs.calibration._field import Photograph, photograph_from
from jaxsfs.calibration._plane import PlanePose
from jaxsfs.camera import AbstractCentralCamera
from jaxsfs.photometry import LinearResponse

_DARKEST, _BRIGHTEST = 0.06, 0.97  # stored values between which noise and clipping leave the mean alone
_LEAST_CELLS = 100
_INK = 0.85  # of the paper's stored value
_SMOOTH = 1.5  # px
_UNEVEN = 0.02  # of the stored value: paper alone
_WIDEST = 21  # px: wider print is dark enough to be found by its value
_GRAINS = 2.5  # of the median depth: Gaussian noise reaches it once in some 10⁴ px


@dataclasses.dataclass(frozen=True)
class PaperView:
    """One photograph: `stored` values in [0, 1], ln of exposure·(n·d)³/h² (−inf off the sheet), cos α, and `bare`:
    pixels of unprinted, unclipped paper. `what` names it in messages."""

    photo: Photograph
    stored: Float[np.ndarray, "height width channels"]
    geometry: Float[np.ndarray, "height width"]
    cosine: Float[np.ndarray, "height width"]
    bare: Bool[np.ndarray, "height width"]
    what: str

    def cells(
        self,
    ) -> tuple[Float[np.ndarray, "cells channels"], Float[np.ndarray, " cells"], Float[np.ndarray, " cells"]]:
        """Mean stored value over 5 × 5 px of bare paper, geometry and cos α at their middles. Raises ValueError for
        too few of them."""
        rows, columns = self._middles()
        if len(rows) < _LEAST_CELLS:
            raise ValueError(
                f"{self.what} shows too little white paper ({len(rows)} cells, at least {_LEAST_CELLS} are needed): "
                "ink, glare and clipped values are left out; lower the exposure, or use a sheet with less print"
            )
        mean = np.stack([ndimage.uniform_filter(c, 5) for c in np.moveaxis(self.stored, 2, 0)], axis=-1)
        return mean[rows, columns], self.geometry[rows, columns], self.cosine[rows, columns]

    def _middles(self) -> tuple[np.ndarray, np.ndarray]:
        step = max(6, self.photo.size[0] // 100)
        whole = ndimage.binary_erosion(self.bare, np.ones((5, 5)))
        grid = np.zeros_like(whole)
        grid[4::step, 4::step] = True
        rows, columns = np.nonzero(np.logical_and(whole, grid))
        return rows, columns

    def chosen_by(self, paper_value: Callable[..., np.ndarray]) -> "PaperView":
        """The same view with paper told from ink by its stored value, `paper_value` of (geometry, cos α)."""
        seen = np.isfinite(self.geometry)
        predicted = np.ones(self.geometry.shape)
        predicted[seen] = np.maximum(paper_value(self.geometry[seen], self.cosine[seen]), 1e-6)
        smooth = ndimage.gaussian_filter(self.photo.grey, 1.0)
        scale = np.median((smooth / predicted)[self.bare])  # of grey against the channel that was fitted
        ink = (smooth < _INK * scale * predicted) | _fine_print(self.photo, scale * predicted)
        return dataclasses.replace(self, bare=_bare(self.photo, self.stored, ink) & seen)


def paper_view(
    image: Shaped[np.ndarray, "..."], camera: AbstractCentralCamera, pose: PlanePose, exposure: float, what: str
) -> PaperView:
    """One photograph with the bare paper that is clearly brighter than what lies about it. Raises ValueError for
    another size than the camera's."""
    photo = photograph_from(image, LinearResponse())
    if photo.size != (camera.width, camera.height):
        raise ValueError(
            f"{what} has {photo.size[0]} x {photo.size[1]} px, the camera {camera.width} x {camera.height}: use the "
            "camera calibrated in the same mode"
        )
    scale = float(np.iinfo(image.dtype).max) if np.issubdtype(image.dtype, np.integer) else 1.0
    values = np.atleast_3d(image.astype(float) / scale)
    facing, cosine = (np.array(part) for part in _angles(camera, pose))
    seen = (facing > 0.1) & (cosine > 0.05)
    geometry = np.full(facing.shape, -np.inf)
    geometry[seen] = 3 * np.log(facing[seen]) - 2 * np.log(float(pose.height)) + np.log(exposure)
    bare = _bare(photo, values, _darker_than_about(photo)) & seen
    return PaperView(photo, values, geometry, cosine, bare, what)


@jax.jit  # numbers of camera and pose are arguments: compiled once for all of a size
def _angles(camera: AbstractCentralCamera, pose: PlanePose) -> tuple[Float[Array, "h w"], Float[Array, "h w"]]:
    """n·d and cos α of every pixel; −1 where the camera has no ray."""

    def one(pixel):
        ray = camera.ray(pixel)
        valid = camera.is_valid(pixel)
        return jnp.where(valid, pose.facing(ray), -1.0), jnp.where(valid, ray[2], -1.0)

    return jax.vmap(jax.vmap(one))(camera.pixels())


def _bare(photo: Photograph, stored, ink: Bool[np.ndarray, "height width"]) -> Bool[np.ndarray, "height width"]:
    """Usable pixels clear of ink by 3 px and of saturation by 10 px, neither nearly black nor nearly clipped."""
    clear = np.logical_not(ndimage.binary_dilation(ink & photo.field, iterations=3))
    brightest = stored.max(axis=2)
    glare = ndimage.binary_dilation(ndimage.binary_opening(brightest >= 0.995), iterations=10)
    return photo.usable & clear & np.logical_not(glare) & (stored.min(axis=2) > _DARKEST) & (brightest < _BRIGHTEST)


def _fine_print(photo: Photograph, paper: Float[np.ndarray, "height width"]) -> Bool[np.ndarray, "height width"]:
    """Dark lines deeper than the grain of picture and paper: far out and blurred they are pale.

    `paper`: the predicted stored value, which flattens the light. A line's depth is what a closing fills; grain is even
    in stored values, and most of the sheet is bare.
    """
    paper = np.maximum(paper, _DARKEST)
    flat = ndimage.gaussian_filter(photo.grey / paper, _SMOOTH).astype(np.float32)
    depth = cv2.morphologyEx(flat, cv2.MORPH_CLOSE, np.ones((_WIDEST, _WIDEST), np.uint8)) - flat
    grain = float(np.median((depth * paper)[photo.usable])) if photo.usable.any() else 0.0
    return depth > np.minimum(_UNEVEN + _GRAINS * grain / paper, 1 - _INK)


def _darker_than_about(photo: Photograph) -> Bool[np.ndarray, "height width"]:
    """Darker than 80 % of a high percentile of the surroundings."""
    size = max(21, photo.size[0] // 16) | 1
    smooth = ndimage.gaussian_filter(photo.grey, 1.0)
    ceiling = ndimage.gaussian_filter(ndimage.percentile_filter(smooth[::4, ::4], 80, size // 4), 1.0)
    ceiling = ceiling.repeat(4, axis=0).repeat(4, axis=1)[: photo.size[1], : photo.size[0]]
    return smooth < 0.8 * ceiling
