"""Where the image ends on a wall that comes nearer beyond its rim: how far the wall is there.

State constraints (neighbours outside the image are left out) are exact where range grows towards the rim. Where the
nearest wall lies at the rim, as when a scope looks down a tube, nothing arrives from outside and the rim takes its
deadline, as if it faced the light. But brightness falls inwards there, and its slope says how steep the wall is: for
a surface that is straight along the steepest way, θ grows by one radian per radian of ray, so with κ = d ln G/d ln c

    d ln E/dℓ = −(κ + 2) tan θ,        hence tan θ = |∇ ln E|_g/(κ + 2) and w ≤ bound + ½ ln G(cos θ).

Exact for planes and straight tubes; a hollow wall reads too far by part of what state constraints are off; a wall
that bulges would read too near, so θ ≤ 45°.
"""

import functools
from typing import NamedTuple

import cv2
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int
from scipy import ndimage
from scipy.spatial import KDTree

from jaxsfs.differences import correlated
from jaxsfs.reflectance import AbstractReflectance
from jaxsfs.shading import LightAtCamera

Image = Float[Array, "height width"]

# Chosen on tuning seeds (`experiments/occlusions.py --rim`): texture and noise must not bend the rim.
_HALF = 4  # the slope is that of a window of 2·_HALF + 1 px
_ALONG = 8.0  # σ in px of the mean of slopes along the rim
_STEEPEST = 0.7  # cos θ: where brightness falls faster, a wall that bulges is more likely than a steeper straight one


class Rim(NamedTuple):
    """Pixels at the image's rim, and for each of them (row, column) of the nearest one whose window lies in the image.

    `windows`: the pixels so named.
    """

    pixels: Bool[Array, "height width"]
    row: Int[Array, "height width"]
    column: Int[Array, "height width"]
    windows: Bool[Array, "height width"]


def find_rim(usable: Bool[np.ndarray, "height width"], inside: Bool[np.ndarray, "height width"]) -> Rim:
    """The rim of the picture's `usable` part: its pixels beside the outermost border, not those beside holes.

    `inside`: the pixels that a solver reads, `usable` without those on occluding contours. Pixels near a contour are
    no rim. The frames of a video share their masks: the last few answers are kept.
    """
    kept = _rim_of(np.packbits(usable).tobytes(), np.packbits(inside).tobytes(), (len(inside), inside.shape[1]))
    return Rim(*(jnp.asarray(field) for field in kept))


@functools.lru_cache(maxsize=4)
def _rim_of(usable_bits: bytes, inside_bits: bytes, shape: tuple[int, int]) -> tuple[np.ndarray, ...]:
    bits = (np.unpackbits(np.frombuffer(b, np.uint8), count=shape[0] * shape[1]) for b in (usable_bits, inside_bits))
    usable, inside = (mask.astype(bool).reshape(shape) for mask in bits)
    filled = ndimage.binary_fill_holes(usable)
    assert filled is not None
    rim = inside & ~_eroded(filled, 3) & ~_near(usable & ~inside)
    row, column = np.indices(inside.shape, np.int32)
    windows = np.zeros_like(inside)
    deep = _eroded(inside, 2 * _HALF + 1)
    if not (rim.any() and deep.any()):
        return np.zeros_like(rim), row, column, windows
    border = np.argwhere(deep & ~_eroded(deep, 3))
    away, nearest = KDTree(border).query(np.argwhere(rim), distance_upper_bound=_HALF + 2.5)
    rim[rim] = np.isfinite(away)
    row[rim], column[rim] = border[np.asarray(nearest)[np.isfinite(away)]].T
    windows[row[rim], column[rim]] = True
    return rim, row, column, windows


def _eroded(mask: Bool[np.ndarray, "height width"], size: int) -> Bool[np.ndarray, "height width"]:
    """Pixels whose square of `size` px lies in `mask`, which ends at the image's border."""
    square = np.ones((size, size), np.uint8)
    return cv2.erode(mask.astype(np.uint8), square, borderType=cv2.BORDER_CONSTANT, borderValue=0) > 0


def _near(mask: Bool[np.ndarray, "height width"]) -> Bool[np.ndarray, "height width"]:
    return cv2.dilate(mask.astype(np.uint8), np.ones((5, 5), np.uint8)) > 0


@jax.jit
def limited_at_rim(shading: LightAtCamera, inverse_metric: Float[Array, "height width 2 2"], rim: Rim) -> LightAtCamera:
    """`shading` with earlier deadlines at the rim where the wall comes nearer outwards."""
    slope_u, slope_v, mean = _window_fits(shading.bound)
    slope_u, slope_v = _smoothed_along(slope_u, rim.windows), _smoothed_along(slope_v, rim.windows)
    slope_u, slope_v, mean, g = (field[rim.row, rim.column] for field in (slope_u, slope_v, mean, inverse_metric))
    height, width = rim.pixels.shape
    inward_v = (rim.row - jnp.arange(height, dtype=rim.row.dtype)[:, None]).astype(slope_u.dtype)
    inward_u = (rim.column - jnp.arange(width, dtype=rim.column.dtype)[None]).astype(slope_u.dtype)
    up_u = g[..., 0, 0] * slope_u + g[..., 0, 1] * slope_v  # the way w grows, in pixels
    up_v = g[..., 0, 1] * slope_u + g[..., 1, 1] * slope_v
    steepness = jnp.sqrt(jnp.maximum(up_u * slope_u + up_v * slope_v, 1e-12))
    bound = mean - slope_u * inward_u - slope_v * inward_v
    cosine = _straight_wall(steepness, shading.reflectance)
    limit = bound + 0.5 * jnp.log(shading.reflectance(cosine))
    inflow = rim.pixels & (up_u * inward_u + up_v * inward_v > 0)
    limit = jnp.where(inflow, jnp.minimum(shading.limit, limit), shading.limit)
    return LightAtCamera(shading.bound, limit, shading.reflectance, shading.albedo, shading.unit)


def _straight_wall(steepness: Image, reflectance: AbstractReflectance) -> Image:
    """cos θ of tan θ = 2 |∇bound|/(κ(cos θ) + 2)."""
    cosine = jnp.ones_like(steepness)
    for _ in range(4):  # κ changes little with θ, not at all for cos^a
        value, slope = jax.jvp(reflectance, (cosine,), (jnp.ones_like(cosine),))
        tangent = 2 * steepness / (slope * cosine / value + 2)
        cosine = 1 / jnp.sqrt(1 + tangent**2)
    return jnp.maximum(cosine, _STEEPEST)


def _window_fits(field: Image) -> tuple[Image, Image, Image]:
    """Slopes along u and v and the mean of the plane that fits the window about each pixel best."""
    offsets = jnp.arange(-_HALF, _HALF + 1, dtype=field.dtype)
    count, spread = 2 * _HALF + 1, float(np.sum(np.arange(-_HALF, _HALF + 1) ** 2))
    ramp, box = offsets / spread, jnp.ones(count, field.dtype) / count
    return (
        correlated(correlated(field, ramp, 1), box, 0),
        correlated(correlated(field, box, 1), ramp, 0),
        correlated(correlated(field, box, 1), box, 0),
    )


def _smoothed_along(field: Image, where: Bool[Array, "height width"]) -> Image:
    """Gaussian mean over the pixels of `where`."""
    reach = int(2 * _ALONG)
    kernel = jnp.exp(-0.5 * (jnp.arange(-reach, reach + 1, dtype=field.dtype) / _ALONG) ** 2)

    def spread(x):
        return correlated(correlated(x, kernel, 1), kernel, 0)

    weight = spread(where.astype(field.dtype))
    return spread(jnp.where(where, field, 0)) / jnp.maximum(weight, 1e-6)
