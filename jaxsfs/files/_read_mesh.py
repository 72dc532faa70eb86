"""Triangle meshes read back: PLY, OBJ, STL, GLB."""

import io
from pathlib import Path

import trimesh

from jaxsfs.files._atomic import InputError, read_bytes

MESH_SUFFIXES = (".ply", ".obj", ".stl", ".glb")


def read_mesh(path: str | Path) -> trimesh.Trimesh:
    """The triangles in `path`, all parts of a scene as one. Raises InputError for other kinds and damaged files."""
    suffix = Path(path).suffix.lower()
    if suffix not in MESH_SUFFIXES:
        raise InputError(f"{path} is no mesh that can be read; expected a file that ends in {', '.join(MESH_SUFFIXES)}")
    data = read_bytes(path)
    try:
        mesh = trimesh.load(io.BytesIO(data), file_type=suffix[1:], force="mesh", process=False)
    except Exception as error:  # trimesh has no common class for what damaged files raise
        raise InputError(f"cannot read {path}: {error}") from None
    if not isinstance(mesh, trimesh.Trimesh) or len(mesh.faces) == 0:
        raise InputError(f"{path} has no triangles; a point cloud or an empty file cannot be compared as a surface")
    return mesh
