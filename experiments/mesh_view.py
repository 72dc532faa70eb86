"""A triangle mesh drawn from the side, in a matplotlib 3-D axis: far triangles first, matte shading."""

import numpy as np
import trimesh


def draw_mesh(axes, mesh: trimesh.Trimesh, *, elevation: float = 25, azimuth: float = -60, colours=None) -> None:
    """Draws `mesh` (camera frame: x right, y down, z forward) with x to the right, depth away, y downwards.

    `colours`: RGB in [0, 1] per face, without them grey by the angle to a light at the upper left.
    """
    from mpl_toolkits.mplot3d.art3d import Poly3DCollection

    vertices = np.asarray(mesh.vertices)[:, [0, 2, 1]] * [1, 1, -1]
    faces = vertices[mesh.faces]
    normals = np.cross(faces[:, 1] - faces[:, 0], faces[:, 2] - faces[:, 0])
    normals /= np.maximum(np.linalg.norm(normals, axis=1, keepdims=True), 1e-30)
    light = np.array([-0.5, -0.6, 0.62])
    shade = 0.25 + 0.75 * np.abs(normals @ light)
    colours = np.ones((len(faces), 3)) if colours is None else np.asarray(colours)
    tint = np.clip(colours * shade[:, None], 0, 1)
    axes.add_collection3d(Poly3DCollection(faces, facecolors=tint, edgecolors=tint, linewidths=0.2))
    low, high = vertices.min(axis=0), vertices.max(axis=0)
    for limits, a, b in zip((axes.set_xlim, axes.set_ylim, axes.set_zlim), low, high, strict=True):
        limits(a, b)
    axes.set_box_aspect(np.maximum(high - low, 0.05 * (high - low).max()))
    axes.view_init(elevation, azimuth)
    axes.set(xticks=[], yticks=[], zticks=[])
    axes.set_xlabel("x", labelpad=-12)
    axes.set_ylabel("z", labelpad=-12)
    axes.set_zlabel("−y", labelpad=-12)


def face_colours(mesh: trimesh.Trimesh, picture: np.ndarray) -> np.ndarray:
    """Mean colour in [0, 1] of each face's corners in `picture` (height, width, 3), 8 bit."""
    u, v = mesh.vertex_attributes["pixel"].T
    return picture[v, u][mesh.faces].mean(axis=1) / 255
