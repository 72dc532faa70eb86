"""A surface in the formats that are written when asked for."""

import io
import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float, UInt8

from jaxsfs.files._atomic import InputError, write_bytes
from jaxsfs.files._formats import Format
from jaxsfs.files._more_maps import exr_library, write_exr, write_pfm, write_png16
from jaxsfs.files._more_meshes import write_obj, write_stl
from jaxsfs.files._records import plain
from jaxsfs.geometry import geometry
from jaxsfs.mesh import mesh_from_surface
from jaxsfs.surface import Surface


def check_formats(formats: Sequence[Format]) -> None:
    """Raises InputError, before any work, where a format needs an extra that is not installed."""
    if "exr" in formats:
        exr_library()


def write_also(
    folder: Path,
    surface: Surface,
    photo_rgb: UInt8[np.ndarray, "height width 3"],
    record: Mapping[str, Any],
    formats: Sequence[Format],
    sigma: Float[np.ndarray, "height width"] | None = None,
) -> None:
    """Writes `surface` to `folder` in each of `formats`; `record` is result.json (unit, camera, status).

    stl: mesh.stl. obj: mesh.obj, mesh.mtl, mesh_texture.png. pfm: range.pfm, depth.pfm. png16: range.png and range.json
    with its scale. npz: surface.npz with range, depth, normals, range_sigma if `sigma` is given (float32, NaN
    where there is none), contours if they are known, and the record as JSON; `read_result` reads it. exr: range.exr.
    """
    if not formats:
        return
    unit = record["unit"]
    valid, space = np.asarray(surface.valid), geometry(surface)
    distance = np.where(valid, np.asarray(surface.range), np.nan).astype(np.float32)
    depth = np.where(valid, space.points[..., 2], np.nan).astype(np.float32)
    if "stl" in formats or "obj" in formats:
        mesh = mesh_from_surface(surface, space=space)
        if "stl" in formats:
            write_stl(folder / "mesh.stl", mesh, unit)
        if "obj" in formats:
            write_obj(folder / "mesh.obj", mesh, photo_rgb, unit)
    if "pfm" in formats:
        write_pfm(folder / "range.pfm", distance)
        write_pfm(folder / "depth.pfm", depth)
    if "png16" in formats:
        _refuse_nothing_above(distance)
        write_png16(folder / "range.png", distance, "range", unit)
    if "exr" in formats:
        write_exr(folder / "range.exr", distance, "range", unit)
    if "npz" in formats:
        normals = np.where(space.has_normal[..., None], space.normals, np.nan).astype(np.float32)
        buffer = io.BytesIO()
        text = json.dumps(plain(record), sort_keys=True)
        maps: dict[str, Any] = {"range": distance, "depth": depth, "normals": normals}
        if sigma is not None:
            maps["range_sigma"] = np.where(valid, sigma, np.nan).astype(np.float32)
        if surface.contours is not None:
            maps["contours"] = np.asarray(surface.contours)
        np.savez_compressed(buffer, allow_pickle=False, **maps, record=np.array(text))
        write_bytes(folder / "surface.npz", buffer.getvalue())


def _refuse_nothing_above(distance: np.ndarray) -> None:
    if (distance[np.isfinite(distance)] <= 0).any():
        raise InputError("png16 holds lengths above 0, but z of a distant light has none; leave png16 out of --also")
