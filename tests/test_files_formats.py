"""Formats that others read: every file is read back by a program that this package did not write."""

import json

import cv2
import jax.numpy as jnp
import numpy as np
import pytest
import tifffile
import trimesh
from PIL import Image

from jaxsfs import files
from jaxsfs.camera import Perspective, camera_to_dict
from jaxsfs.mesh import mesh_from_surface
from jaxsfs.surface import Surface

RNG = np.random.default_rng(7)
RGB = RNG.integers(0, 256, (12, 16, 3), np.uint8)
CAMERA = Perspective(20.0, 20.0, 7.5, 5.5, 16, 12)
LENGTHS = 30 + np.arange(12 * 16.0).reshape(12, 16) / 20


@pytest.fixture
def surface() -> Surface:
    valid = np.ones((12, 16), bool)
    valid[:2] = False
    return Surface(CAMERA, jnp.asarray(LENGTHS), jnp.asarray(valid))


@pytest.fixture
def distance() -> np.ndarray:
    values = LENGTHS.copy()
    values[:2] = np.nan
    return values


# --- in ---


@pytest.mark.parametrize("dtype", [np.uint8, np.uint16, np.float16, np.float32, np.float64])
def test_tiffs_of_every_kind(tmp_path, dtype):
    stored = RGB.astype(dtype) if np.dtype(dtype).kind == "u" else (RGB / 200).astype(dtype)
    tifffile.imwrite(tmp_path / "a.tiff", stored, photometric="rgb", compression="zlib")
    found = files.read_image(tmp_path / "a.tiff")
    top = np.iinfo(dtype).max if np.dtype(dtype).kind == "u" else 1.0
    np.testing.assert_allclose(found.values, stored.astype(np.float64) / top, rtol=1e-6)


@pytest.mark.parametrize("ending", ["jpg", "webp", "bmp", "png", "tif"])
def test_pictures_that_pillow_wrote(tmp_path, ending):
    smooth = cv2.resize(RGB[:3, :4], (64, 48), interpolation=cv2.INTER_CUBIC)
    Image.fromarray(smooth).save(tmp_path / f"a.{ending}", quality=95)
    found = files.read_image(tmp_path / f"a.{ending}")
    lossy = ending in ("jpg", "webp")
    assert np.abs(255 * found.values - smooth).mean() < (6 if lossy else 1e-4)


def test_sixteen_bit_png_that_pillow_wrote(tmp_path):
    stored = RNG.integers(0, 65536, (6, 5), np.uint16)
    Image.fromarray(stored).save(tmp_path / "a.png")
    np.testing.assert_array_equal(np.round(65535 * files.read_image(tmp_path / "a.png").values), stored)


# --- out ---


@pytest.mark.parametrize("unit", ["mm", "scene units"])
def test_stl_as_trimesh_reads_it(tmp_path, surface, unit):
    mesh = mesh_from_surface(surface)
    files.write_stl(tmp_path / "a.stl", mesh, unit)
    header = (tmp_path / "a.stl").read_bytes()[:80].decode("ascii")
    assert "SPACE=LPS" in header
    assert f"unit={unit}," in header
    again = trimesh.load_mesh(tmp_path / "a.stl", process=False)
    np.testing.assert_allclose(again.triangles, mesh.triangles, rtol=1e-6)
    assert ((again.face_normals * again.triangles_center).sum(axis=1) < 0).all()


def test_obj_and_its_texture_as_trimesh_reads_them(tmp_path, surface):
    mesh = mesh_from_surface(surface)
    files.write_obj(tmp_path / "a.obj", mesh, RGB, "mm")
    assert sorted(p.name for p in tmp_path.iterdir()) == ["a.mtl", "a.obj", "a_texture.png"]
    assert "unit=mm, camera frame" in (tmp_path / "a.obj").read_text().splitlines()[0]
    again = trimesh.load(tmp_path / "a.obj", process=False, force="mesh")
    assert isinstance(again, trimesh.Trimesh)
    np.testing.assert_allclose(again.triangles, mesh.triangles, rtol=1e-6)
    seen = again.visual.material.image
    np.testing.assert_array_equal(np.asarray(seen), RGB)
    # each corner's texture coordinate lands on its pixel; the origin is the lower left corner
    place = again.visual.uv * [16, -12] + [0, 12] - 0.5
    x, y, z = again.vertices.T
    np.testing.assert_allclose(place, np.stack([20 * x / z + 7.5, 20 * y / z + 5.5], axis=1), atol=1e-3)


def test_pfm_as_opencv_reads_it(tmp_path, distance):
    files.write_pfm(tmp_path / "a.pfm", distance)
    np.testing.assert_array_equal(
        cv2.imread(str(tmp_path / "a.pfm"), cv2.IMREAD_UNCHANGED), distance.astype(np.float32)
    )


def test_png16_as_pillow_reads_it_and_as_read_map_does(tmp_path, distance):
    files.write_png16(tmp_path / "a.png", distance, "range", "mm")
    record = json.loads((tmp_path / "a.json").read_text())
    assert (record["unit"], record["quantity"], record["no_data"]) == ("mm", "range", 0)
    with Image.open(tmp_path / "a.png") as picture:
        stored = np.asarray(picture)
    assert stored.dtype == np.uint16
    assert stored.max() == 65535
    assert (stored[:2] == 0).all()
    np.testing.assert_allclose(stored[2:] * record["scale"], distance[2:], atol=record["scale"] / 2)
    np.testing.assert_allclose(files.read_map(tmp_path / "a.png"), distance, atol=record["scale"] / 2)
    with pytest.raises(ValueError, match="holds lengths above 0, got -1"):
        files.write_png16(tmp_path / "b.png", np.full((3, 3), -1.0), "range", "mm")


def test_exr_as_its_own_library_reads_it(tmp_path, distance):
    openexr = pytest.importorskip("OpenEXR", reason="the extra exr is not installed")
    files.write_exr(tmp_path / "a.exr", distance, "range", "mm")
    with openexr.File(str(tmp_path / "a.exr"), separate_channels=True) as picture:
        assert picture.header()["comments"] == "range, mm"
        np.testing.assert_array_equal(picture.channels()["Z"].pixels, distance.astype(np.float32))


def test_exr_without_its_extra(monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "OpenEXR", None)
    with pytest.raises(files.InputError, match=r"pip install 'jaxsfs\[exr\]'"):
        files.check_formats(["npz", "exr"])
    files.check_formats(["npz"])


class TestAll:
    @pytest.fixture
    def record(self) -> dict:
        status = {"trustworthy": False, "message": "It did not settle."}
        return {"unit": "mm", "camera": camera_to_dict(CAMERA), "status": status, "figures": {"x": np.nan}}

    def test_npz_is_a_whole_result(self, tmp_path, surface, distance, record):
        files.write_also(tmp_path, surface, RGB, record, ["npz"])
        with np.load(tmp_path / "surface.npz") as arrays:
            np.testing.assert_allclose(arrays["range"], distance, rtol=1e-6)
            depth = distance * np.asarray(CAMERA.rays())[..., 2]
            np.testing.assert_allclose(arrays["depth"], depth, rtol=1e-6)
            np.testing.assert_allclose(np.linalg.norm(arrays["normals"][4:], axis=-1), 1, rtol=1e-5)
        again = files.read_result(tmp_path / "surface.npz")
        np.testing.assert_array_equal(again.surface.valid, surface.valid)
        assert (again.unit, again.trustworthy, again.message) == ("mm", False, "It did not settle.")
        assert again.surface.camera.fx == 20

    def test_files_of_every_format(self, tmp_path, surface, record):
        files.write_also(tmp_path, surface, RGB, record, ["stl", "obj", "pfm", "png16", "npz"])
        expected = {"mesh.stl", "mesh.obj", "mesh.mtl", "mesh_texture.png", "range.pfm", "depth.pfm", "range.png"}
        assert {p.name for p in tmp_path.iterdir()} == expected | {"range.json", "surface.npz"}

    def test_not_an_npz(self, tmp_path):
        (tmp_path / "a.npz").write_bytes(b"PK nonsense")
        with pytest.raises(files.InputError, match=r"cannot read a result from .*a\.npz"):
            files.read_result(tmp_path / "a.npz")
        np.savez(tmp_path / "b.npz", depth=np.ones((2, 2)))
        with pytest.raises(files.InputError, match="give what jaxsfs reconstruct wrote"):
            files.read_result(tmp_path / "b.npz")
