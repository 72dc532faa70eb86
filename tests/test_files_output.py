"""Meshes and folders of results: what they hold, and that they appear whole or not at all."""

import json
import os
import struct
from pathlib import Path

import jax.numpy as jnp
import numpy as np
import pytest
import tifffile
import trimesh

from jaxsfs.camera import Perspective
from jaxsfs.files import (
    InputError,
    output_folder,
    read_json,
    read_map,
    read_mask,
    write_json,
    write_mesh,
    write_surface,
)
from jaxsfs.mesh import mesh_from_surface
from jaxsfs.surface import Surface

RGB8 = np.random.default_rng(5).integers(0, 256, (12, 16, 3), np.uint8)
CAMERA = Perspective(20.0, 20.0, 7.5, 5.5, 16, 12)


def left_over(folder: Path) -> list[str]:
    return sorted(str(path.relative_to(folder)) for path in folder.rglob("*"))


def a_surface() -> Surface:
    valid = np.ones((12, 16), bool)
    valid[:2] = False
    return Surface(CAMERA, jnp.asarray(30 + np.arange(12 * 16.0).reshape(12, 16) / 20), jnp.asarray(valid))


# --- meshes ---


@pytest.mark.parametrize("unit", ["mm", "scene units"])
def test_ply_has_camera_coordinates_colours_and_its_header(tmp_path, unit):
    mesh = mesh_from_surface(a_surface(), RGB8)
    write_mesh(tmp_path / "a.ply", mesh, unit)
    header = (tmp_path / "a.ply").read_bytes().split(b"end_header")[0].decode().splitlines()
    assert "comment SPACE=LPS" in header
    assert f"comment unit {unit}" in header
    again = trimesh.load_mesh(tmp_path / "a.ply", process=False)
    np.testing.assert_allclose(again.vertices, mesh.vertices, rtol=1e-6)
    np.testing.assert_array_equal(again.faces, mesh.faces)
    np.testing.assert_array_equal(again.visual.vertex_colors[:, :3], RGB8[2:].reshape(-1, 3))
    assert ((again.face_normals * again.triangles_center).sum(axis=-1) < 0).all()


@pytest.mark.parametrize(("unit", "factor"), [("mm", 0.001), ("scene units", 1.0)])
def test_glb_is_in_metres_with_y_up_and_linear_colours(tmp_path, unit, factor):
    mesh = mesh_from_surface(a_surface(), RGB8)
    write_mesh(tmp_path / "a.glb", mesh, unit)
    again = trimesh.load_mesh(tmp_path / "a.glb", process=False)
    np.testing.assert_allclose(again.vertices, factor * mesh.vertices * [1, -1, -1], rtol=1e-6)
    np.testing.assert_array_equal(again.faces, mesh.faces)
    # The axes are turned, not mirrored: normals still point to the camera.
    assert ((again.face_normals * again.triangles_center).sum(axis=-1) < 0).all()
    data = (tmp_path / "a.glb").read_bytes()
    length = struct.unpack("<I", data[12:16])[0]
    description = json.loads(data[20 : 20 + length])
    assert struct.unpack("<I", data[8:12])[0] == len(data)
    view = description["bufferViews"][1]
    start = 28 + length + view["byteOffset"]
    colours = np.frombuffer(data[start : start + view["byteLength"]], "<u2").reshape(-1, 4) / 65535
    stored = RGB8[2:].reshape(-1, 3) / 255
    linear = np.where(stored <= 0.04045, stored / 12.92, ((stored + 0.055) / 1.055) ** 2.4)
    np.testing.assert_allclose(colours[:, :3], linear, atol=1e-5)
    np.testing.assert_array_equal(colours[:, 3], 1)


def test_a_mesh_without_colours_and_an_empty_one_are_written(tmp_path):
    mesh = mesh_from_surface(a_surface())
    write_mesh(tmp_path / "grey.ply", mesh, "mm")
    assert (trimesh.load_mesh(tmp_path / "grey.ply").visual.vertex_colors[:, 0] == 200).all()
    empty = mesh_from_surface(Surface(CAMERA, jnp.ones((12, 16)), jnp.zeros((12, 16), bool)))
    for name in ("a.ply", "a.glb"):
        write_mesh(tmp_path / name, empty, "mm")
        assert (tmp_path / name).stat().st_size > 0
    assert b"element face 0\n" in (tmp_path / "a.ply").read_bytes()
    assert not trimesh.load_scene(tmp_path / "a.glb").geometry
    with pytest.raises(InputError, match=r"as .ply or .glb, got 'a.stl'"):
        write_mesh(tmp_path / "a.stl", mesh, "mm")


def test_a_surface_s_folder(tmp_path):
    surface = a_surface()
    with output_folder(tmp_path / "out") as staged:
        write_surface(staged, surface, RGB8, "mm")
    out = tmp_path / "out"
    names = "depth.png depth.tiff mask.png mesh.glb mesh.ply normals.tiff range.tiff shaded.png"
    assert left_over(out) == names.split()
    np.testing.assert_allclose(read_map(out / "range.tiff")[2:], np.asarray(surface.range)[2:], rtol=1e-6)
    np.testing.assert_allclose(read_map(out / "depth.tiff")[2:], np.asarray(surface.depth())[2:], rtol=1e-6)
    np.testing.assert_array_equal(read_mask(out / "mask.png"), np.asarray(surface.valid))
    normals = tifffile.imread(out / "normals.tiff")
    assert normals.shape == (12, 16, 3)
    assert np.isnan(normals[:2]).all()
    np.testing.assert_allclose(np.linalg.norm(normals[2:], axis=-1), 1, rtol=1e-5)


# --- whole or not at all ---


@pytest.mark.parametrize("error", [RuntimeError, KeyboardInterrupt, SystemExit])
def test_an_interrupted_folder_leaves_nothing(tmp_path, error):
    def write():
        with output_folder(tmp_path / "new" / "deep" / "out") as staged:
            write_json(staged / "result.json", {})
            raise error

    with pytest.raises(error):
        write()
    assert left_over(tmp_path) == []


@pytest.mark.parametrize("error", [OSError, KeyboardInterrupt])
@pytest.mark.parametrize("call", [1, 2, 3, 4])
def test_an_interrupted_replacement_keeps_the_old_folder(tmp_path, monkeypatch, error, call):
    out = tmp_path / "out"
    with output_folder(out) as staged:
        for name in "ab":
            write_json(staged / name, {"old": name})
    calls, replace = [], os.replace

    def failing(source, target):
        calls.append(source)
        if len(calls) == call:
            raise error
        replace(source, target)

    def overwrite():
        with output_folder(out, force=True) as staged:
            for name in "abc":
                (staged / name).write_text("new")
            monkeypatch.setattr("os.replace", failing)

    with pytest.raises((InputError, KeyboardInterrupt)):
        overwrite()
    monkeypatch.undo()
    assert left_over(tmp_path) == ["out", "out/a", "out/b"]
    assert read_json(out / "a") == {"old": "a"}
    assert read_json(out / "b") == {"old": "b"}


@pytest.mark.parametrize("error", [OSError(28, "No space left on device"), KeyboardInterrupt()])
def test_an_interrupted_file_leaves_the_old_one(tmp_path, monkeypatch, error):
    write_json(tmp_path / "a.json", {"old": 1})

    def failing(_):
        raise error

    monkeypatch.setattr("os.fsync", failing)
    with pytest.raises((InputError, KeyboardInterrupt)):
        write_json(tmp_path / "a.json", {"new": 1}, force=True)
    assert left_over(tmp_path) == ["a.json"]
    assert read_json(tmp_path / "a.json") == {"old": 1}


def test_results_are_not_overwritten_unasked(tmp_path):
    out = tmp_path / "out"
    out.mkdir()  # an empty folder is nobody's result
    with output_folder(out) as staged:
        write_json(staged / "a.json", {"first": 1})
    with pytest.raises(InputError, match=r"exists already and is not empty; .*--force"), output_folder(out):
        pytest.fail("the block must not run")
    with pytest.raises(InputError, match=r"exists already; .*--force"):
        write_json(out / "a.json", {})
    (out / "notes.txt").write_text("the user's own")
    with output_folder(out, force=True) as staged:
        write_json(staged / "a.json", {"second": 2})
    assert read_json(out / "a.json") == {"second": 2}
    assert left_over(tmp_path) == ["out", "out/a.json", "out/notes.txt"]


def test_places_that_cannot_be_written_to_say_so(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(InputError, match="is a file"), output_folder(tmp_path / "file"):
        pytest.fail("the block must not run")
    with pytest.raises(InputError, match="cannot write"), output_folder(tmp_path / "file" / "out"):
        pytest.fail("the block must not run")
    for path in (tmp_path / "file" / "a.json", tmp_path / "none" / "a.json"):
        with pytest.raises(InputError, match="cannot write"):
            write_json(path, {})
    with pytest.raises(InputError, match="is a folder"):
        write_json(tmp_path, {})
    assert left_over(tmp_path) == ["file"]
