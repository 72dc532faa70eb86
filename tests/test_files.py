"""Photographs, masks, maps and records: what is written is read back, what cannot be read says why."""

import json
import struct
from pathlib import Path

import cv2
import jax.numpy as jnp
import numpy as np
import pytest
import tifffile

from jaxsfs.camera import Spherical
from jaxsfs.files import (
    InputError,
    read_camera,
    read_image,
    read_json,
    read_map,
    read_mask,
    write_camera,
    write_json,
    write_png,
    write_tiff,
)

RNG = np.random.default_rng(5)
RGB8 = RNG.integers(0, 256, (12, 16, 3), np.uint8)


def left_over(folder: Path) -> list[str]:
    return sorted(str(path.relative_to(folder)) for path in folder.rglob("*"))


# --- photographs ---


@pytest.mark.parametrize("name", ["a.png", "a.bmp", "a.webp", "a.tiff", "a.npy"])
@pytest.mark.parametrize("grey", [False, True])
def test_eight_bit_photographs_come_back_in_the_order_red_green_blue(tmp_path, name, grey):
    stored, path = RGB8[..., 0] if grey else RGB8, tmp_path / name
    if name == "a.npy":
        np.save(path, stored)
    elif name == "a.tiff":
        tifffile.imwrite(path, stored)
    else:
        cv2.imwrite(str(path), stored if grey else stored[..., ::-1], [cv2.IMWRITE_WEBP_QUALITY, 101])
    photo = read_image(path)
    values = photo.values
    if name == "a.webp" and grey:  # WebP has no grey
        values = values[..., 0]
    np.testing.assert_allclose(values, stored / 255, atol=1e-7)
    assert photo.valid.all()
    assert photo.dtype == "uint8"
    np.testing.assert_array_equal(photo.rgb8(), np.broadcast_to(stored[..., None], RGB8.shape) if grey else RGB8)


@pytest.mark.parametrize("name", ["a.png", "a.tiff", "a.npy"])
def test_sixteen_bits_are_kept(tmp_path, name):
    stored, path = RNG.integers(0, 65536, (6, 5), np.uint16), tmp_path / name
    if name == "a.npy":
        np.save(path, stored)
    elif name == "a.png":
        write_png(path, stored)
    else:
        tifffile.imwrite(path, stored, byteorder=">")
    photo = read_image(path)
    np.testing.assert_array_equal(np.round(photo.values * 65535), stored)
    assert photo.dtype == "uint16"


def test_floats_are_taken_as_they_are_and_unusable_ones_are_reported(tmp_path):
    stored = np.full((4, 5, 3), 2.5, np.float32)
    stored[0, 0, 1], stored[1, 1, 0], stored[2, 2, 2] = np.nan, -0.1, np.inf
    tifffile.imwrite(tmp_path / "a.tiff", stored, photometric="rgb")
    photo = read_image(tmp_path / "a.tiff")
    assert photo.dtype == "float32"
    assert (~photo.valid).sum() == 3
    assert not photo.valid[[0, 1, 2], [0, 1, 2]].any()
    assert (photo.values[photo.valid] == 2.5).all()
    assert (photo.values[~photo.valid] == 0).all()
    assert photo.rgb8().max() == 255


def test_transparent_pixels_are_invalid(tmp_path):
    alpha = np.full((12, 16, 1), 255, np.uint8)
    alpha[3, 4], alpha[5, 6] = 0, 1
    cv2.imwrite(str(tmp_path / "a.png"), np.concatenate([RGB8[..., ::-1], alpha], axis=-1))
    photo = read_image(tmp_path / "a.png")
    assert not photo.valid[3, 4]
    assert (~photo.valid).sum() == 1
    np.testing.assert_allclose(photo.values[photo.valid], RGB8[photo.valid] / 255, atol=1e-7)


def test_exif_orientation_is_ignored(tmp_path):
    jpeg = cv2.imencode(".jpg", RGB8)[1].tobytes()
    # APP1: big-endian TIFF header, one entry: orientation (0x112, SHORT) = 6, "rotate by 90 degrees".
    exif = b"Exif\0\0MM\0*\0\0\0\x08\0\x01" + struct.pack(">HHIHH", 0x112, 3, 1, 6, 0) + bytes(4)
    (tmp_path / "a.jpg").write_bytes(jpeg[:2] + b"\xff\xe1" + struct.pack(">H", len(exif) + 2) + exif + jpeg[2:])
    photo = read_image(tmp_path / "a.jpg")
    assert photo.valid.shape == (12, 16)
    assert photo.format == "jpeg"


def test_tiffs_that_need_another_decoder(tmp_path):
    cv2.imwrite(str(tmp_path / "lzw.tiff"), RGB8[..., ::-1], [cv2.IMWRITE_TIFF_COMPRESSION, 5])
    np.testing.assert_array_equal(read_image(tmp_path / "lzw.tiff").rgb8(), RGB8)
    tifffile.imwrite(tmp_path / "planes.tiff", np.moveaxis(RGB8, -1, 0), photometric="rgb", planarconfig="separate")
    np.testing.assert_array_equal(read_image(tmp_path / "planes.tiff").rgb8(), RGB8)


def test_one_pixel_is_an_image(tmp_path):
    write_png(tmp_path / "a.png", np.full((1, 1), 7, np.uint8))
    assert read_image(tmp_path / "a.png").values.shape == (1, 1)


def save(path: Path, array: np.ndarray) -> Path:
    np.save(path, array, allow_pickle=True)
    return path


def test_unusable_photographs_say_why(tmp_path):
    cases = {
        "there is no file": tmp_path / "nothing.png",
        "is a folder": tmp_path,
        r"shape \(4, 4, 2\)": save(tmp_path / "two.npy", np.ones((4, 4, 2))),
        r"shape \(4,\); expected": save(tmp_path / "row.npy", np.ones(4)),
        "without pixels": save(tmp_path / "none.npy", np.ones((0, 4))),
        "numbers of type complex128": save(tmp_path / "complex.npy", np.ones((4, 4), complex)),
        "cannot read the array": save(tmp_path / "object.npy", np.array([[{}]])),
        "no usable pixel": save(tmp_path / "nan.npy", np.full((4, 4), np.nan)),
    }
    text, empty, cut, cut_png = (tmp_path / name for name in ("text.jpg", "empty.png", "cut.jpg", "cut.png"))
    text.write_text("hello")
    empty.touch()
    jpeg, png = (cv2.imencode(kind, RGB8)[1].tobytes() for kind in (".jpg", ".png"))
    cut.write_bytes(jpeg[:-40])
    cut_png.write_bytes(png[:-60])
    tifffile.imwrite(tmp_path / "pages.tiff", np.ones((3, 8, 8), np.uint8), photometric="minisblack")
    cases |= {
        "is not an image that can be read; expected PNG": text,
        r"is empty \(0 bytes\)": empty,
        "is cut short": cut,
        "cut.png is not an image": cut_png,
        "holds 3 pages": tmp_path / "pages.tiff",
    }
    for message, path in cases.items():
        with pytest.raises(InputError, match=message):
            read_image(path)


def test_masks(tmp_path):
    mask = RNG.random((20, 24)) > 0.5
    write_png(tmp_path / "a.png", mask)
    np.testing.assert_array_equal(read_mask(tmp_path / "a.png"), mask)
    write_png(tmp_path / "ones.png", mask.astype(np.uint8))
    np.testing.assert_array_equal(read_mask(tmp_path / "ones.png"), mask)
    np.save(tmp_path / "a.npy", mask)
    np.testing.assert_array_equal(read_mask(tmp_path / "a.npy"), mask)
    block = np.zeros((32, 32), np.uint8)
    block[8:24, 5:20] = 255
    cv2.imwrite(str(tmp_path / "a.jpg"), block)
    np.testing.assert_array_equal(read_mask(tmp_path / "a.jpg"), block > 0)
    write_png(tmp_path / "black.png", np.zeros((4, 4), np.uint8))
    with pytest.raises(InputError, match="is empty: no pixel is above 0; expected non-zero where valid"):
        read_mask(tmp_path / "black.png")


# --- maps ---


def test_float_maps_come_back(tmp_path):
    values = RNG.random((12, 16)) + 1
    valid = RNG.random((12, 16)) > 0.3
    write_tiff(tmp_path / "a.tiff", values, valid, description="range, mm")
    again = read_map(tmp_path / "a.tiff")
    np.testing.assert_array_equal(np.isfinite(again), valid)
    np.testing.assert_allclose(again[valid], values[valid], rtol=1e-7)
    assert tifffile.imread(tmp_path / "a.tiff").dtype == np.float32
    np.save(tmp_path / "b.npy", np.where(valid, values, 0))
    np.testing.assert_allclose(read_map(tmp_path / "b.npy", 2.0), 2 * np.where(valid, values, np.nan))


def test_sixteen_bit_maps_need_their_scale(tmp_path):
    stored = np.array([[0, 1000], [65535, 2]], np.uint16)
    path = tmp_path / "depth.png"
    write_png(path, stored)
    expected = np.array([[np.nan, 2.0], [131.07, 0.004]])
    np.testing.assert_allclose(read_map(path, 0.002), expected)
    with pytest.raises(InputError, match=r"whole numbers \(uint16\).*depth.json"):
        read_map(path)
    write_json(tmp_path / "depth.json", {"scale": 0.002})
    np.testing.assert_allclose(read_map(path), expected)
    np.testing.assert_allclose(read_map(path, 0.02), 10 * expected)
    write_json(tmp_path / "depth.json", {"scale": "2 mm"}, force=True)
    with pytest.raises(InputError, match="must be a number, got '2 mm'"):
        read_map(path)
    with pytest.raises(InputError, match="positive and finite, got -1"):
        read_map(path, -1)


def test_unusable_maps_say_why(tmp_path):
    with pytest.raises(InputError, match=r"shape \(4, 4, 3\); expected a map"):
        read_map(save(tmp_path / "a.npy", np.ones((4, 4, 3))))
    with pytest.raises(InputError, match="no data"):
        read_map(save(tmp_path / "b.npy", np.zeros((4, 4))))
    with pytest.raises(InputError, match="there is no file"):
        read_map(tmp_path / "c.tiff")


def test_png_pictures(tmp_path):
    write_png(tmp_path / "a.png", RGB8)
    np.testing.assert_array_equal(cv2.imread(str(tmp_path / "a.png"))[..., ::-1], RGB8)
    with pytest.raises(ValueError, match="uint8, uint16 or bool, got float64"):
        write_png(tmp_path / "b.png", np.ones((4, 4)))


# --- records ---


def test_json_is_stable_and_has_null_for_nan(tmp_path):
    record = {
        "b": np.float32(0.5),
        "a": [jnp.nan, np.inf, 1],
        "c": np.arange(2),
        "d": jnp.ones(()),
        "e": None,
        "f": True,
    }
    write_json(tmp_path / "a.json", record)
    text = (tmp_path / "a.json").read_text()
    assert json.loads(text) == {"a": [None, None, 1], "b": 0.5, "c": [0, 1], "d": 1.0, "e": None, "f": True}
    assert list(json.loads(text)) == sorted(record)
    write_json(tmp_path / "b.json", dict(reversed(record.items())))
    assert (tmp_path / "b.json").read_text() == text
    with pytest.raises(ValueError, match="cannot write a set"):
        write_json(tmp_path / "c.json", {"a": {1}})
    assert left_over(tmp_path) == ["a.json", "b.json"]


def test_camera_files_come_back_with_all_their_keys(tmp_path):
    description = {
        "model": "spherical",
        "width": 640,
        "height": 480,
        "cx": 320.5,
        "cy": 240,
        "f": 400,
        "photometry": {"response": "gamma:2.2"},
        "lights": [{"position_mm": [0, 0, 0]}],
    }
    (tmp_path / "camera.json").write_text("\ufeff" + json.dumps(description))
    file = read_camera(tmp_path / "camera.json")
    assert isinstance(file.camera, Spherical)
    write_camera(tmp_path / "again.json", file)
    again = read_camera(tmp_path / "again.json")
    assert again.camera == file.camera
    assert (again.photometry, again.other) == (file.photometry, file.other)


def test_unusable_records_say_where(tmp_path):
    path = tmp_path / "camera.json"
    for content, message in {
        b'{\n"f": }': "is not JSON: .* line 2, column 6",
        b"[1]": "holds a JSON list; expected an object",
        b"\xff\xfe\x00": "is not a text file",
        b'{"model": "pinhole"}': r"camera.json: camera model 'pinhole' is unknown; .*perspective",
        b'{"model": "spherical", "width": 4, "height": 4, "cx": 1, "cy": 1}': "missing: 'f'",
    }.items():
        path.write_bytes(content)
        with pytest.raises(InputError, match=message):
            read_camera(path)
    with pytest.raises(InputError, match="there is no file"):
        read_json(tmp_path / "none.json")
