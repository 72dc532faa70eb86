"""Triangles from a surface: one vertex per pixel, cut open where one thing hides another."""

from typing import NamedTuple

import numpy as np
import trimesh
from jaxtyping import Bool, UInt8
from scipy import ndimage

from jaxsfs.geometry import Geometry, geometry
from jaxsfs.surface import Surface

# An edge below the largest grazing angle is still cut when it is this much steeper than both edges that continue it…
_STEEPER_THAN_NEIGHBOURS = 4.0
# … and steeper than this on its own: a crease between gentle slopes is no occlusion.
_STEEP_DEG = 70.0


class _Grid(NamedTuple):
    points: np.ndarray
    rays: np.ndarray
    usable: np.ndarray
    contours: np.ndarray


def mesh_from_surface(
    surface: Surface,
    colours: UInt8[np.ndarray, "height width 3"] | None = None,
    *,
    cut: Bool[np.ndarray, "height width"] | None = None,
    max_grazing_deg: float | int = 85.0,
    step: int = 1,
    space: Geometry | None = None,
) -> trimesh.Trimesh:
    """The triangle mesh of `surface`: two triangles for each square of four valid pixels, one where three are valid.

    An edge between two pixels is taken for an occlusion, and its triangles are left out, when the straight line
    between their points makes more than `max_grazing_deg` with the image sphere,

        tan θ = |e·m|/|e − (e·m) m|,   e the edge, m the mean ray (central camera: |Δ ln r| ≈ tan θ · pixel angle),

    or when θ > 70° and tan θ is over four times that of both edges that continue it in the same row or column (the
    slope round it does not explain the jump), or when θ > 70° and it leads from one of the surface's `contours` to
    something farther. Triangles that touch a pixel of `cut` are left out as well.

    Vertices: camera frame (x right, y down, z forward), unit of the surface's range, only those that a triangle uses,
    in row order. Faces turn counter-clockwise seen from the camera: normals point towards it. `colours`: RGB per pixel
    (height, width, 3). `step`: only every so many-th row and column, for a lighter mesh. `vertex_attributes["pixel"]`:
    the (u, v) of each vertex. `space`: the surface's geometry, where it is known already. Fewer than three usable
    pixels give a mesh without faces. Raises ValueError for arrays of another size than the surface's, for an angle
    outside (0, 90) and for a step below 1.
    """
    if step < 1:
        raise ValueError(f"step must be 1 or more pixels, got {step}")
    if not 0 < max_grazing_deg < 90:
        raise ValueError(f"max_grazing_deg must lie between 0 and 90 degrees, got {max_grazing_deg}")
    valid = np.asarray(surface.valid)
    for name, array in (("colours", colours), ("cut", cut)):
        if array is not None and array.shape[:2] != valid.shape:
            raise ValueError(f"{name} must be {valid.shape} pixels like the surface, got {array.shape[:2]}")
    space = geometry(surface) if space is None else space
    points = space.points
    usable = valid & np.isfinite(points).all(axis=-1)
    if cut is not None:
        usable &= ~cut
    usable = usable[::step, ::step]
    points = np.where(usable[..., None], points[::step, ::step], 0)
    contours = np.zeros_like(usable)
    if surface.contours is not None:
        contours = ndimage.maximum_filter(np.asarray(surface.contours), size=step)[::step, ::step]
    faces = _faces(points, space.rays[::step, ::step], usable, contours, np.tan(np.deg2rad(max_grazing_deg)))

    used = np.zeros(usable.size, bool)
    used[faces.ravel()] = True
    new_index = np.cumsum(used) - 1
    vertex_colours = None if colours is None else colours[::step, ::step].reshape(-1, 3)[used]
    # `process` would merge and reorder vertices.
    mesh = trimesh.Trimesh(
        points.reshape(-1, 3)[used], new_index[faces], vertex_colors=vertex_colours, process=False, validate=False
    )
    v, u = np.unravel_index(np.flatnonzero(used), usable.shape)
    mesh.vertex_attributes["pixel"] = step * np.stack([u, v], axis=-1)
    return mesh


def _faces(points: np.ndarray, rays: np.ndarray, usable: np.ndarray, contours: np.ndarray, limit: float) -> np.ndarray:
    """(n, 3) pixel indices v·width + u. The corners of a square are a b in its upper row, c d in the lower one."""
    height, width = usable.shape
    if height < 2 or width < 2:
        return np.zeros((0, 3), np.int64)
    grid = _Grid(points, rays, usable, contours)
    across = _open_edges(_steepness(grid, 0, 1), limit, axis=1)
    down = _open_edges(_steepness(grid, 1, 0), limit, axis=0)
    a_d = _steepness(grid, 1, 1)
    b_c = _steepness(_Grid(*(field[:, ::-1] for field in grid)), 1, 1)[:, ::-1]
    upper, lower, left, right = across[:-1], across[1:], down[:, :-1], down[:, 1:]
    a = np.arange(height * width).reshape(height, width)[:-1, :-1]
    b, c, d = a + 1, a + width, a + width + 1
    # The gentler diagonal: along an occlusion, not over it. A diagonal with an unusable end has steepness ∞.
    falling = a_d <= b_c
    falling_ok, rising_ok = falling & (a_d < limit), ~falling & (b_c < limit)
    kinds = [
        (falling_ok & left & lower, (a, c, d)),
        (falling_ok & upper & right, (a, d, b)),
        (rising_ok & left & upper, (a, c, b)),
        (rising_ok & lower & right, (b, c, d)),
    ]
    faces = np.concatenate([np.stack([corner[keep] for corner in corners], axis=-1) for keep, corners in kinds])
    return faces


def _steepness(grid: _Grid, dv: int, du: int) -> np.ndarray:
    """tan θ of the edges from pixel (u, v) to (u + du, v + dv); ∞ where an end is unusable, and where a steep edge
    leaves a contour for something farther."""
    points, rays, usable, contours = grid
    height, width = usable.shape
    near, far = (slice(0, height - dv), slice(0, width - du)), (slice(dv, height), slice(du, width))
    edge, ray = points[far] - points[near], rays[far] + rays[near]
    ok = usable[far] & usable[near]
    along = np.einsum("...i,...i", edge, ray)
    length2 = np.einsum("...i,...i", edge, edge) * np.einsum("...i,...i", ray, ray)
    aside2 = np.maximum(length2 - along**2, np.finfo(edge.dtype).tiny)
    with np.errstate(over="ignore"):  # an edge along the ray is infinitely steep
        steepness = np.sqrt(along**2 / aside2)
    leaves = np.where(along > 0, contours[near] & ~contours[far], contours[far] & ~contours[near])
    return np.where(ok & ~(leaves & (steepness > np.tan(np.deg2rad(_STEEP_DEG)))), steepness, np.inf)


def _open_edges(steepness: np.ndarray, limit: float, axis: int) -> np.ndarray:
    """Edges that are no occlusion."""
    # A neighbour that does not exist explains nothing; when both are missing, nothing is known against the edge.
    known = np.isfinite(steepness)
    pad = [(1, 1) if i == axis else (0, 0) for i in range(2)]
    count = steepness.shape[axis]

    def neighbours(array: np.ndarray) -> list[np.ndarray]:
        padded = np.pad(array, pad)
        return [np.take(padded, np.arange(i, i + count), axis) for i in (0, 2)]

    judged = np.logical_or(*neighbours(known))
    explained = _STEEPER_THAN_NEIGHBOURS * np.maximum(*neighbours(np.where(known, steepness, 0)))
    jump = judged & (steepness > explained) & (steepness > np.tan(np.deg2rad(_STEEP_DEG)))
    return (steepness < limit) & ~jump
