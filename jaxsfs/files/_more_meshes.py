"""STL, and OBJ with the photograph as its texture."""

from pathlib import Path

import cv2
import numpy as np
import trimesh
from jaxtyping import UInt8

from jaxsfs.files._atomic import write_bytes
from jaxsfs.files._meshes import Unit

_FRAME = "camera frame x right, y down, z forward"


def write_stl(path: str | Path, mesh: trimesh.Trimesh, unit: Unit, *, force: bool = False) -> None:
    """`mesh` (camera frame, in `unit`) as binary STL, coordinates as they are; colours are lost.

    The header says `SPACE=LPS`, which makes 3D Slicer take the camera frame for its own, and the unit.
    """
    corners = np.asarray(mesh.vertices)[mesh.faces]
    outward = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    length = np.linalg.norm(outward, axis=1, keepdims=True)
    triangles = np.zeros(len(corners), [("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
    triangles["normal"], triangles["corners"] = outward / np.where(length > 0, length, 1), corners
    # readers take a header that begins with "solid" for the text form
    header = f"jaxsfs SPACE=LPS unit={unit}, {_FRAME}".encode("ascii").ljust(80)[:80]
    write_bytes(path, header + np.uint32(len(corners)).tobytes() + triangles.tobytes(), force=force)


def write_obj(
    path: str | Path,
    mesh: trimesh.Trimesh,
    photograph: UInt8[np.ndarray, "height width 3"],
    unit: Unit,
    *,
    force: bool = False,
) -> None:
    """`mesh` (camera frame, in `unit`) as PATH.obj with PATH.mtl and PATH_texture.png, the photograph as its texture.

    `mesh` as `mesh_from_surface` gives it: it knows the pixel of each vertex. Texture coordinates have their origin in
    the lower left corner of the picture, pixel centres at halves.
    """
    path = Path(path)
    height, width = photograph.shape[:2]
    material, texture = path.with_suffix(".mtl"), path.with_name(f"{path.stem}_texture.png")
    place = (np.asarray(mesh.vertex_attributes["pixel"]) + 0.5) / [width, height]
    place[:, 1] = 1 - place[:, 1]
    corners = np.repeat(np.asarray(mesh.faces).ravel() + 1, 2)  # v/vt, both counted from 1
    text = [
        f"# jaxsfs SPACE=LPS unit={unit}, {_FRAME}\nmtllib {material.name}\no surface\nusemtl photograph\n",
        _lines("v %.7g %.7g %.7g\n", np.asarray(mesh.vertices)),
        _lines("vt %.6f %.6f\n", place),
        _lines("f %d/%d %d/%d %d/%d\n", corners.reshape(-1, 6)),
    ]
    lit_from_everywhere = "Ka 1 1 1\nKd 1 1 1\nKs 0 0 0\nillum 1\n"
    done, picture = cv2.imencode(".png", photograph[..., ::-1])
    if not done:
        raise ValueError(f"cannot encode a texture of shape {photograph.shape}")
    write_bytes(texture, picture.tobytes(), force=force)
    write_bytes(material, f"newmtl photograph\n{lit_from_everywhere}map_Kd {texture.name}\n".encode(), force=force)
    write_bytes(path, "".join(text).encode(), force=force)


def _lines(form: str, rows: np.ndarray) -> str:
    return form * len(rows) % tuple(rows.ravel().tolist())
