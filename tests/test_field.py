"""The field of an endoscope picture: synthetic fields of known shape, full-frame pictures, and real photographs."""

import cv2
import numpy as np
import pytest

from jaxsfs.field import find_field
from jaxsfs.files import read_image, read_mask

SIZE = (240, 320)


def disc(radius, centre=(160, 120), size=SIZE):
    v, u = np.indices(size)
    return np.hypot(u - centre[0], v - centre[1]) <= radius


def octagon(margin=10, corner=70, size=SIZE):
    v, u = np.indices(size)
    right, bottom = size[1] - 1 - u, size[0] - 1 - v
    inside = (np.minimum(u, right) >= margin) & (np.minimum(v, bottom) >= 0)
    return inside & (np.minimum(u, right) + np.minimum(v, bottom) >= corner)


def picture(field, *, border=0.0, noise=0.01, seed=0, size=SIZE):
    """A colour picture: a wavy wall, darker to the right, inside `field`."""
    v, u = np.indices(size)
    tissue = 0.45 + 0.25 * np.sin(u / 25) * np.cos(v / 31) - 0.15 * u / size[1]
    grey = np.where(field, tissue, border)
    grey = cv2.GaussianBlur(grey, (0, 0), 1.0)
    noisy = grey[..., None] * [1.0, 0.6, 0.5] + noise * np.random.default_rng(seed).standard_normal((*size, 3))
    return np.clip(np.round(255 * noisy) / 255, 0, 1).astype(np.float32)


def overlap(a, b):
    return (a & b).sum() / (a | b).sum()


@pytest.mark.parametrize("border", [0.0, 16 / 255])
@pytest.mark.parametrize(
    ("field", "shape"),
    [
        (disc(100), "round"),
        (disc(90, (120, 130)), "round"),
        (disc(140), "round"),  # cut by the image at top and bottom
        (octagon(), "straight-sided"),
        (octagon(30, 60), "straight-sided"),
    ],
)
def test_finds_round_and_octagonal_fields(field, shape, border):
    found = find_field(picture(field, border=border))
    assert found.shape == shape
    assert overlap(found.mask, field) > 0.91
    assert (found.mask & ~field).sum() <= 2  # nothing of the border or its blurred edge
    assert found.share == pytest.approx(found.mask.mean())
    assert found.description.startswith(f"{shape} field of")


def test_grey_pictures_too():
    field = disc(100)
    assert overlap(find_field(picture(field).mean(axis=2)).mask, field) > 0.94


def test_says_where_the_image_cuts_the_field():
    found = find_field(picture(disc(140)))
    assert "cut by the image border (top, bottom)" in found.description
    assert found.mask[0].any()
    assert "cut" not in find_field(picture(disc(100))).description


def test_a_notch_stays_as_it_is():
    outward = disc(90) | ((np.abs(np.indices(SIZE)[1] - 160) < 6) & (np.indices(SIZE)[0] >= 200) & disc(104))
    found = find_field(picture(outward))
    assert overlap(found.mask, outward) > 0.93
    assert not (found.mask & ~cv2.dilate(outward.astype(np.uint8), np.ones((3, 3))).astype(bool)).any()


@pytest.mark.parametrize("centre", [(160, 120), (245, 110), (160, 25)])
def test_keeps_a_dark_lumen(centre):
    """A black lumen in the middle, and one at the rim that is connected to the border."""
    field = disc(110)
    photo = picture(field) * ~disc(30, centre)[..., None]
    assert overlap(find_field(photo).mask, field) > 0.93


def test_a_hollow_rim_is_followed():
    """A round field after its distortion was removed: the upper border bends inwards."""
    v, u = np.indices(SIZE)
    field = disc(105) & (v > 60 - ((u - 160) / 20) ** 2)
    found = find_field(picture(field, border=4 / 255, noise=0.002))
    assert (found.mask & ~field).sum() <= 2
    assert overlap(found.mask, field) > 0.91


def test_letters_in_the_border_are_no_field():
    letters = cv2.putText(np.zeros(SIZE, np.uint8), "12:30 Dr", (2, 20), cv2.FONT_HERSHEY_SIMPLEX, 0.4, 255, 1)
    photo = np.maximum(picture(disc(90, (200, 120))), letters[..., None] / np.float32(255))
    assert not find_field(photo).mask[:40, :90].any()


def test_a_glowing_border_is_no_field():
    """Light scattered into the border, brighter than its far parts."""
    field = disc(80)
    glow = cv2.GaussianBlur(field.astype(np.float32), (0, 0), 12)[..., None] * np.float32(0.09)
    found = find_field(np.maximum(picture(field, border=16 / 255, noise=0.004), 16 / 255 + glow))
    assert not (found.mask & ~disc(83)).any()
    assert overlap(found.mask, field) > 0.91


@pytest.mark.parametrize("strength", [0.0, 2.0, 6.0])
def test_a_full_frame_is_kept_whole(strength):
    """Vignetting darkens the corners gradually; that is no border."""
    v, u = np.indices(SIZE)
    vignette = np.exp(-strength * ((u - 160) ** 2 + (v - 120) ** 2) / 200**2)
    photo = picture(np.ones(SIZE, bool), noise=0.005) * vignette[..., None].astype(np.float32)
    found = find_field(photo)
    assert found.mask.all()
    assert found.shape == "whole image"
    assert found.description == "no dark border: the whole image"


def test_a_dark_lumen_in_a_full_frame_is_kept():
    photo = picture(np.ones(SIZE, bool)) * ~disc(70, (60, 120))[..., None]
    assert find_field(photo).mask.all()


@pytest.mark.parametrize("photo", [np.zeros((50, 60)), np.ones((50, 60, 3)), np.full((1, 1), 0.3), np.zeros((3, 200))])
def test_pictures_without_a_field(photo):
    assert find_field(photo).mask.all()


def test_two_images_of_one_picture_agree():
    photo = picture(octagon(30, 60))
    flipped = find_field(photo[:, ::-1]).mask[:, ::-1]
    assert overlap(find_field(photo).mask, flipped) > 0.99


REAL = {
    "endocal_circles/frame_001.jpg": ("round", 0.15, 0.17),
    "endocal_circles/frame_003.jpg": ("round", 0.15, 0.17),
    "endocal_sample_001/frame_001.jpg": ("round", 0.58, 0.63),
    "endocal_sample_001/frame_011.jpg": ("round", 0.58, 0.63),  # a dark wedge at the rim
    "endomapper_plane/sample_frame.png": ("straight-sided", 0.85, 0.89),
    "sinus_endoscope/00004584.jpg": ("round", 0.39, 0.41),
    "sinus_endoscope/00004600.jpg": ("round", 0.39, 0.41),
    "simcol3d/FrameBuffer_0000.png": ("whole image", 1.0, 1.0),
    "simcol3d/FrameBuffer_0004.png": ("whole image", 1.0, 1.0),
    "endoslam_calib/mirocam/pad_Mirocam_calib_2mm__2.jpg": ("round", 0.75, 0.9),
    "specular_endoscope/235.bmp": ("whole image", 1.0, 1.0),
    "specular_endoscope/fig1_a.bmp": ("whole image", 1.0, 1.0),
    "specular_endoscope/fig5_a.bmp": ("straight-sided", 0.95, 0.99),
}


@pytest.mark.parametrize("name", REAL)
def test_real_photographs(data, name):
    if not (data / name).is_file():
        pytest.skip(f"no {name} in {data}")
    shape, least, most = REAL[name]
    found = find_field(read_image(data / name).values)
    assert found.shape == shape
    assert least <= found.share <= most


def test_agrees_with_a_published_mask(data):
    folder = data / "endomapper_plane"
    if not folder.is_dir():
        pytest.skip(f"no endomapper_plane in {data}")
    found = find_field(read_image(folder / "sample_frame.png").values)
    assert overlap(found.mask, read_mask(folder / "mask.png")) > 0.98
