"""Where the printed rings are seen: their images under a lens and pose, as polar curves round the target's centre."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from jaxsfs.calibration._lens import LENS_SIZE, lens_named, rays
from jaxsfs.calibration._plane import points_on_plane, rotate

RAYS = 64
_GRID = 256  # radii of the polar grid on which R(u, v) is inverted


class RingImages(NamedTuple):
    """Images of all rings round the image `centre` of their common middle, over rays × rings: `radius` in px (NaN where
    a ring leaves the image), `base` points, outward unit `normal`, `curvature` in 1/px, `reach`: half the distance in
    px to the neighbouring rings."""

    centre: Float[np.ndarray, "2"]
    radius: Float[np.ndarray, "rays rings"]
    base: Float[np.ndarray, "rays rings 2"]
    normal: Float[np.ndarray, "rays rings 2"]
    curvature: Float[np.ndarray, "rays rings"]
    reach: Float[np.ndarray, "rays rings"]


def ring_images(
    name: str,
    parameters: Float[np.ndarray, " size"],
    view: Float[np.ndarray, "6"],
    radii: Float[np.ndarray, " rings"],
    size: tuple[int, int],
) -> RingImages:
    """Images of printed rings of `radii` (mm) by lens model `name`, pose `view` and picture `size` (width, height)."""
    lens = parameters[:LENS_SIZE]
    centre = target_centre(name, lens, view)
    width, height = size
    far = 1.05 * float(np.hypot(max(centre[0], width - centre[0]), max(centre[1], height - centre[1])))
    grid = np.linspace(0, far, _GRID)
    angle = 2 * np.pi * np.arange(RAYS)[:, None] / RAYS
    towards = np.stack([np.cos(angle), np.sin(angle)], axis=-1)
    on_paper = _paper_radius(name, lens, view, centre + grid[:, None] * towards)
    edges = np.concatenate([[0.0], radii, [2 * radii[-1] - radii[-2]]])
    around = np.full((RAYS, len(edges)), np.nan)
    for ray in range(RAYS):
        falls = np.nonzero(np.diff(on_paper[ray]) <= 1e-9)[0]
        end = falls[0] + 1 if len(falls) else _GRID
        around[ray] = np.interp(edges, on_paper[ray, :end], grid[:end], right=np.nan)
    radius = around[:, 1:-1]
    inner, outer = radius - around[:, :-2], around[:, 2:] - radius
    reach = 0.5 * np.fmin(inner, np.where(np.isfinite(outer), outer, inner))
    slope = _smooth_slope(radius)
    # the curve r(θ) has the normal r·e_r − r'·e_θ
    across = np.stack([-towards[..., 1], towards[..., 0]], axis=-1)
    normal = radius[..., None] * towards - slope[..., None] * across
    normal = normal / np.hypot(radius, slope)[..., None]
    base = centre + radius[..., None] * towards
    return RingImages(centre, radius, base, normal, _curvature(radius, slope), reach)


def target_centre(name: str, lens: Float[np.ndarray, "8"], view: Float[np.ndarray, "6"]) -> Float[np.ndarray, "2"]:
    """The pixel that sees the target point (0, 0): Newton's method on the rays."""
    goal = rotate(view[:3], np.append(view[3:5], np.exp(view[5])))
    goal = goal / np.linalg.norm(goal)
    pixel = lens[1:3] + 1.0
    for _ in range(20):
        seen = rays(lens_named(name).build, lens, pixel[None])
        move = np.linalg.lstsq(seen.slope[0], goal - seen.ray[0], rcond=None)[0]
        pixel = pixel + np.clip(move, -100.0, 100.0)
        if np.max(np.abs(move)) < 1e-9:
            break
    return pixel


def outermost_seen(
    name: str,
    parameters: Float[np.ndarray, " size"],
    view: Float[np.ndarray, "6"],
    field: Bool[np.ndarray, "height width"],
) -> float:
    """The largest distance in mm from the target's centre that the lit `field` of a photograph shows."""
    lit = np.argwhere(field)[:, ::-1].astype(float)
    sample = lit[np.linspace(0, len(lit) - 1, RAYS * _GRID).astype(int)]  # one compiled shape with `ring_images`
    return float(np.max(_paper_radius(name, parameters[:LENS_SIZE], view, sample.reshape(RAYS, _GRID, 2))))


def _paper_radius(name: str, lens, view, pixels: Float[np.ndarray, "rays grid 2"]) -> Float[np.ndarray, "rays grid"]:
    """R(u, v) in mm; −1 where the pixel misses the sheet."""
    seen = rays(lens_named(name).build, lens, pixels.reshape(-1, 2))
    point, facing = points_on_plane(view, np.asarray(seen.ray))
    return np.where(facing > 0.03, np.hypot(*point.T), -1.0).reshape(pixels.shape[:2])


def px_per_mm(radius: Float[np.ndarray, "rays rings"], radii: Float[np.ndarray, " rings"]) -> np.ndarray:
    """∂r/∂R of the predicted rings, from the nearest rings that the picture shows."""
    ahead = np.diff(radius, axis=1) / np.diff(radii)
    inner, outer = np.pad(ahead, ((0, 0), (1, 0)), "edge"), np.pad(ahead, ((0, 0), (0, 1)), "edge")
    return np.where(np.isfinite(outer), np.fmin(inner, outer), inner)


def _curvature(radius: np.ndarray, slope: np.ndarray) -> np.ndarray:
    """κ = (r² + 2r'² − r r″)/(r² + r'²)^(3/2) of the curves r(θ), 1/r where a neighbour is missing."""
    bend = (np.roll(radius, -1, axis=0) - 2 * radius + np.roll(radius, 1, axis=0)) * (RAYS / (2 * np.pi)) ** 2
    bend = np.where(np.isfinite(bend), bend, 0.0)
    return (radius**2 + 2 * slope**2 - radius * bend) / (radius**2 + slope**2) ** 1.5


def _smooth_slope(radius: np.ndarray) -> np.ndarray:
    slope = (np.roll(radius, -1, axis=0) - np.roll(radius, 1, axis=0)) * RAYS / (4 * np.pi)
    return np.where(np.isfinite(slope), slope, 0.0)
