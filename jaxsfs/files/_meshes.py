"""Mesh files, written here byte by byte: each format's header must say things that trimesh's writers do not."""

import json
import struct
from pathlib import Path

import numpy as np
import trimesh
from trimesh.visual.color import ColorVisuals

from jaxsfs.files._atomic import InputError, write_bytes
from jaxsfs.files._formats import Unit

_FLOAT32, _UINT16, _UINT32 = 5126, 5123, 5125  # glTF's component types
_VERTICES, _TRIANGLES = 34962, 34963  # glTF's buffer targets


def write_mesh(path: str | Path, mesh: trimesh.Trimesh, unit: Unit, *, force: bool = False) -> None:
    """`mesh` (camera frame: x right, y down, z forward, in `unit`) as .ply or .glb, with its vertex colours.

    PLY: binary, coordinates as they are; the header says `SPACE=LPS`, which makes 3D Slicer take the camera frame for
    its own (x to the patient's left, y posterior, z superior; any other placement is a rigid motion), and the unit.
    GLB: the standard's metres and y up, (x, −y, −z)/1000 from millimetres; scene units stay 1 : 1.
    A mesh without faces gives a valid file without triangles. Raises InputError for another ending.
    """
    kind = Path(path).suffix.lower()
    if kind == ".ply":
        data = _ply(mesh, unit)
    elif kind == ".glb":
        data = _glb(mesh, unit)
    else:
        raise InputError(f"a mesh is written as .ply or .glb, got {Path(path).name!r}")
    write_bytes(path, data, force=force)


def _colours(mesh: trimesh.Trimesh) -> np.ndarray:
    """(n, 3) uint8; light grey for a mesh without colours."""
    visual = mesh.visual
    if not isinstance(visual, ColorVisuals) or visual.kind != "vertex":
        return np.full((len(mesh.vertices), 3), 200, np.uint8)
    return np.asarray(visual.vertex_colors)[:, :3].astype(np.uint8)


def _ply(mesh: trimesh.Trimesh, unit: Unit) -> bytes:
    vertices = np.zeros(len(mesh.vertices), [("position", "<f4", 3), ("colour", "u1", 3)])
    vertices["position"], vertices["colour"] = mesh.vertices, _colours(mesh)
    faces = np.zeros(len(mesh.faces), [("count", "u1"), ("corner", "<i4", 3)])
    faces["count"], faces["corner"] = 3, mesh.faces
    header = [
        "ply",
        "format binary_little_endian 1.0",
        "comment SPACE=LPS",
        f"comment unit {unit}",
        "comment camera frame: x right, y down, z forward",
        f"element vertex {len(vertices)}",
        *(f"property float {axis}" for axis in "xyz"),
        *(f"property uchar {colour}" for colour in ("red", "green", "blue")),
        f"element face {len(faces)}",
        "property list uchar int vertex_indices",
        "end_header\n",
    ]
    return "\n".join(header).encode("ascii") + vertices.tobytes() + faces.tobytes()


def _glb(mesh: trimesh.Trimesh, unit: Unit) -> bytes:
    description: dict = {"asset": {"version": "2.0", "generator": "jaxsfs"}, "scene": 0, "scenes": [{}]}
    if not len(mesh.faces):  # glTF has no empty accessors
        return _glb_container(description, b"")
    to_metres = 0.001 if unit == "mm" else 1.0
    positions = (mesh.vertices * [to_metres, -to_metres, -to_metres]).astype("<f4")
    # glTF's colours are linear light, photographs are sRGB; 16 bits, because 8 linear ones would band in the dark.
    stored = _colours(mesh) / 255
    linear = np.where(stored <= 0.04045, stored / 12.92, ((stored + 0.055) / 1.055) ** 2.4)
    colours = np.ones((len(linear), 4))
    colours[:, :3] = linear
    colours = np.round(65535 * colours).astype("<u2")
    indices = mesh.faces.astype("<u4").ravel()
    parts = [positions.tobytes(), colours.tobytes(), indices.tobytes()]  # all multiples of 4 bytes
    starts = np.concatenate([[0], np.cumsum([len(part) for part in parts])])
    targets = [_VERTICES, _VERTICES, _TRIANGLES]
    count = len(positions)
    matte = {"baseColorFactor": [1, 1, 1, 1], "metallicFactor": 0, "roughnessFactor": 1}
    primitive = {"attributes": {"POSITION": 0, "COLOR_0": 1}, "indices": 2, "material": 0}
    description |= {
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "name": "surface"}],
        "meshes": [{"primitives": [primitive]}],
        "materials": [{"pbrMetallicRoughness": matte, "doubleSided": True}],
        "accessors": [
            {
                "bufferView": 0,
                "componentType": _FLOAT32,
                "count": count,
                "type": "VEC3",
                "min": positions.min(axis=0).tolist(),
                "max": positions.max(axis=0).tolist(),
            },
            {"bufferView": 1, "componentType": _UINT16, "normalized": True, "count": count, "type": "VEC4"},
            {"bufferView": 2, "componentType": _UINT32, "count": len(indices), "type": "SCALAR"},
        ],
        "bufferViews": [
            {"buffer": 0, "byteOffset": int(start), "byteLength": len(part), "target": target}
            for start, part, target in zip(starts[:-1], parts, targets, strict=True)
        ],
        "buffers": [{"byteLength": int(starts[-1])}],
        "asset": {"version": "2.0", "generator": "jaxsfs", "extras": {"unit": "m" if unit == "mm" else unit}},
    }
    return _glb_container(description, b"".join(parts))


def _glb_container(description: dict, binary: bytes) -> bytes:
    """The two chunks of the GLB container, JSON padded with spaces to 4 bytes."""
    text = json.dumps(description, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text
    if binary:
        chunks += struct.pack("<I4s", len(binary), b"BIN\0") + binary
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks
