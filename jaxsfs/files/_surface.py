"""A surface as a folder of files."""

from pathlib import Path

import numpy as np
from jaxtyping import Float, UInt8

from jaxsfs.files._formats import Unit
from jaxsfs.files._maps import write_png, write_tiff
from jaxsfs.files._meshes import write_mesh
from jaxsfs.geometry import geometry
from jaxsfs.mesh import mesh_from_surface
from jaxsfs.pictures import depth_picture, shaded_picture
from jaxsfs.surface import Surface


def write_surface(
    folder: Path,
    surface: Surface,
    photo_rgb: UInt8[np.ndarray, "height width 3"] | None,
    unit: Unit,
    sigma: Float[np.ndarray, "height width"] | None = None,
) -> None:
    """Writes what a reconstruction is, in its camera's frame (x right, y down, z forward) and in `unit`, to `folder`.

    range.tiff, depth.tiff (float32, NaN where invalid), normals.tiff (unit, towards the camera, NaN where there is
    none), mask.png (255 where valid), contours.png (255 on occluding contours, if there are any), mesh.ply,
    mesh.glb (coloured by `photo_rgb`), depth.png, shaded.png; with `sigma`, 1σ of the range, range_sigma.tiff too.
    `folder` exists and has none of these: the folder that `output_folder` stages.
    """
    valid = np.asarray(surface.valid)
    space = geometry(surface)
    depth = space.points[..., 2]
    frame = "camera frame x right, y down, z forward"
    write_tiff(
        folder / "range.tiff",
        np.asarray(surface.range),
        valid,
        description=f"range: distance from the projection centre, {unit}, NaN where invalid",
    )
    if sigma is not None:
        write_tiff(
            folder / "range_sigma.tiff",
            sigma,
            valid,
            description=f"1 sigma of range from noise and calibration, without model error, {unit}, NaN where unknown",
        )
    write_tiff(folder / "depth.tiff", depth, valid, description=f"depth: z of the {frame}, {unit}, NaN where invalid")
    write_tiff(
        folder / "normals.tiff",
        space.normals,
        space.has_normal,
        description=f"unit normals towards the camera, {frame}, NaN where there is none",
    )
    write_png(folder / "mask.png", valid)
    if surface.contours is not None and bool(surface.contours.any()):
        write_png(folder / "contours.png", np.asarray(surface.contours))
    mesh = mesh_from_surface(surface, photo_rgb, space=space)
    write_mesh(folder / "mesh.ply", mesh, unit)
    write_mesh(folder / "mesh.glb", mesh, unit)
    write_png(folder / "depth.png", depth_picture(depth, valid))
    write_png(folder / "shaded.png", shaded_picture(surface, space))
