"""Printed targets, read back by another PDF implementation: true millimetres, and seen by the calibration."""

import io
import math
import subprocess
import sys

import cv2
import numpy as np
import pypdfium2
import pytest

from jaxsfs import target
from jaxsfs.camera import Spherical
from jaxsfs.cli import main

PX_PER_MM = 20


def raster(page: bytes) -> np.ndarray:
    """Darkness in [0, 1] of the only page, 20 px per mm, row 0 at the top."""
    document = pypdfium2.PdfDocument(io.BytesIO(page))
    assert len(document) == 1
    scale = PX_PER_MM * 25.4 / 72 * (1 - 1e-6)  # pdfium rounds the page up to whole pixels and stretches it
    grey = document[0].render(scale=scale, grayscale=True).to_numpy()
    document.close()
    return 1 - grey.reshape(grey.shape[0], grey.shape[1]).astype(np.float32) / 255


def text(page: bytes) -> str:
    document = pypdfium2.PdfDocument(io.BytesIO(page))
    found = document[0].get_textpage().get_text_bounded()
    document.close()
    return found


def middle(paper="A4") -> tuple[float, float]:
    """Where targets are centred, in px of the raster."""
    width, height = target.PAPERS[paper]
    return width / 2 * PX_PER_MM, (height - 24) / 2 * PX_PER_MM


def target_part(dark: np.ndarray) -> np.ndarray:
    """The page as an 8-bit picture without scale bar and text."""
    return np.rint(255 * (1 - dark[: -30 * PX_PER_MM])).astype(np.uint8)


def ring_profile(dark: np.ndarray, centre: tuple[float, float], radius: float) -> tuple[float, float]:
    """Mean radius and width in mm of the line near `radius` mm, over 360 directions."""
    angle = np.deg2rad(np.arange(360.0))[:, None]
    reach = np.arange(radius - 1.4, radius + 1.4, 0.01)[None, :] * PX_PER_MM
    u, v = centre[0] + reach * np.cos(angle) - 0.5, centre[1] + reach * np.sin(angle) - 0.5
    profile = cv2.remap(dark, u.astype(np.float32), v.astype(np.float32), cv2.INTER_LINEAR)
    own = (profile * reach).sum(axis=1) / profile.sum(axis=1) / PX_PER_MM
    assert np.abs(own - radius).max() < 0.05
    return float(own.mean()), float(profile.sum(axis=1).mean() * 0.01)


@pytest.mark.parametrize("radii", [(5, 10, 15, 20, 25, 30), target.UNEQUAL_RADII, (20, 90)])
def test_circles_have_true_radii(radii):
    dark = raster(target.circles_page(radii, width=0.5))
    for radius in radii:
        measured, width = ring_profile(dark, middle(), radius)
        assert measured == pytest.approx(radius, abs=0.02)
        assert width == pytest.approx(0.5, abs=0.02)


def test_centre_dot_is_there_unless_unwanted():
    u, v = (round(x) for x in middle())
    assert raster(target.circles_page((5, 10)))[v, u] == 1
    assert raster(target.circles_page((5, 10), dot=False))[v, u] == 0


@pytest.mark.parametrize("paper", target.PAPERS)
def test_scale_bar_is_100_mm_and_page_is_the_paper(paper):
    dark = raster(target.circles_page((5, 10), paper=paper))
    width, height = target.PAPERS[paper]
    assert dark.shape == pytest.approx((height * PX_PER_MM, width * PX_PER_MM), abs=1)
    bar = dark[round((height - 23.5) * PX_PER_MM)]
    assert bar.sum() / PX_PER_MM == pytest.approx(100, abs=0.06)  # pdfium fills every pixel that it touches
    assert np.flatnonzero(bar).tolist() == list(range(np.argmax(bar > 0), np.argmax(bar > 0) + np.count_nonzero(bar)))


def test_grid_has_square_cells_of_the_pitch():
    picture = target_part(raster(target.grid_page(5, 0.4)))
    _, _, boxes, centroids = cv2.connectedComponentsWithStats((picture > 127).astype(np.uint8), connectivity=4)
    cells = np.abs(boxes[:, cv2.CC_STAT_WIDTH] - 4.6 * PX_PER_MM) < 2
    places = centroids[cells] / PX_PER_MM
    assert cells.sum() == 38 * 51
    steps = places - places[0]
    np.testing.assert_allclose(steps, 5 * np.rint(steps / 5), atol=0.03)
    assert places.mean(axis=0) == pytest.approx(np.array(middle()) / PX_PER_MM, abs=0.1)


def test_checkerboard_corners_are_found_at_their_pitch():
    picture = target_part(raster(target.checkerboard_page(7, 6, 10)))
    found, corners = cv2.findChessboardCornersSB(picture, (7, 6))
    assert found
    grid = corners.reshape(6, 7, 2) / PX_PER_MM
    np.testing.assert_allclose(np.linalg.norm(np.diff(grid, axis=1), axis=-1), 10, atol=0.03)
    np.testing.assert_allclose(np.linalg.norm(np.diff(grid, axis=0), axis=-1), 10, atol=0.03)


@pytest.mark.parametrize("asymmetric", [False, True])
def test_dots_are_found_at_their_pitch(asymmetric):
    picture = target_part(raster(target.dots_page(4, 11, 10, asymmetric)))
    flags = cv2.CALIB_CB_ASYMMETRIC_GRID if asymmetric else cv2.CALIB_CB_SYMMETRIC_GRID
    options = cv2.SimpleBlobDetector.Params()
    options.maxArea = 1e6
    found, centres = cv2.findCirclesGrid(
        picture, (4, 11), flags=flags, blobDetector=cv2.SimpleBlobDetector.create(options)
    )
    assert found
    grid = centres.reshape(11, 4, 2) / PX_PER_MM
    within = np.linalg.norm(np.diff(grid, axis=1), axis=-1)
    between = np.linalg.norm(np.diff(grid, axis=0), axis=-1)
    np.testing.assert_allclose(within, 20 if asymmetric else 10, atol=0.03)
    np.testing.assert_allclose(between, 10 * math.sqrt(2) if asymmetric else 10, atol=0.03)


@pytest.mark.parametrize(
    ("page", "command"),
    [
        (target.circles_page((5, 10, 15.5)), "jaxsfs calibrate circles PHOTO.png --radii 5 10 15.5 --out camera.json"),
        (target.grid_page(4), "jaxsfs calibrate grid PHOTO.png --out camera.json"),
        (
            target.checkerboard_page(7, 6, 2.5),
            "jaxsfs calibrate checkerboard PHOTO.png --columns 7 --rows 6 --pitch 2.5 --out camera.json",
        ),
        (
            target.dots_page(4, 11, 2, asymmetric=True),
            "jaxsfs calibrate dots PHOTO.png --columns 4 --rows 11 --pitch 2 --asymmetric --out camera.json",
        ),
    ],
)
def test_page_says_how_to_calibrate(page, command):
    assert command in text(page)


@pytest.mark.slow
def test_calibration_reads_the_printed_circles():
    """The page as the texture of a plane 12 mm before a camera whose f the calibration then finds."""
    from jaxsfs.calibration.circles import calibrate_circles

    dark = cv2.GaussianBlur(raster(target.circles_page()), (0, 0), 2)
    camera = Spherical(f=260.0, cx=255.5, cy=255.5, width=512, height=512)
    rays, field = np.asarray(camera.rays()), np.asarray(camera.field())
    place = 12 * rays[..., :2] / np.maximum(rays[..., 2:], 0.05) * PX_PER_MM + np.array(middle()) - 0.5
    u, v = np.moveaxis(place.astype(np.float32), -1, 0)
    paper = cv2.remap(dark, u, v, cv2.INTER_LINEAR, borderMode=cv2.BORDER_CONSTANT)
    photo = np.where(field, np.rint(255 * (0.9 - 0.75 * paper)), 0).astype(np.uint8)
    found = calibrate_circles([photo], target.UNEQUAL_RADII)
    assert float(found.camera.f) == pytest.approx(260, rel=0.005)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: target.circles_page((5, 5)), "increasing radii"),
        (lambda: target.circles_page((5, math.nan)), "increasing radii"),
        (lambda: target.circles_page((-1, 5)), "increasing radii"),
        (lambda: target.circles_page((5,)), "increasing radii"),
        (lambda: target.circles_page((5, 120)), "room for 194 x 257 mm"),
        (lambda: target.circles_page((5, 10), width=3.5), "thinner than 3 mm"),
        (lambda: target.circles_page((5, 10), width=-1), "thinner than 3 mm"),
        (lambda: target.circles_page((5, 10), paper="B9"), "A4, A5, Letter"),
        (lambda: target.grid_page(0.1), "between 1 and 40 mm"),
        (lambda: target.grid_page(5, 2.6), r"thinner than 2.5 mm"),
        (lambda: target.checkerboard_page(1, 6, 2), "at least 2"),
        (lambda: target.checkerboard_page(70, 6, 20), "use a smaller pitch"),
        (lambda: target.dots_page(4, 11, -2), "positive distance"),
    ],
)
def test_bad_input_is_named(make, message):
    with pytest.raises(ValueError, match=message):
        make()


def test_commands_write_the_pages(tmp_path, capsys):
    out = tmp_path / "page.pdf"
    for words, page in (
        (["circles", "--radii", "5", "10", "15"], target.circles_page((5, 10, 15))),
        (["grid", "--pitch", "4", "--paper", "A5"], target.grid_page(4, paper="A5")),
        (["checkerboard", "--columns", "7", "--rows", "6", "--pitch", "2"], target.checkerboard_page(7, 6, 2)),
        (["dots", "--columns", "4", "--rows", "5", "--pitch", "3", "--asymmetric"], target.dots_page(4, 5, 3, True)),
    ):
        assert main(["target", *words, "--out", str(out), "--force"]) == 0
        assert out.read_bytes() == page
    assert main(["target", "circles", "--radii", "5", "4", "--out", str(tmp_path / "no.pdf")]) == 2
    assert "increasing radii in mm, got 5 4" in capsys.readouterr().err
    assert not (tmp_path / "no.pdf").exists()


def test_circles_that_can_be_taken_for_their_neighbours_are_named(tmp_path, capsys):
    words = ["target", "circles", "--force", "--out", str(tmp_path / "page.pdf")]
    assert main([*words, "--radii", "5", "10", "15"]) == 0
    assert "equally spaced" in capsys.readouterr().out
    for radii in (["--radii", "5", "10"], ["--radii", "5", "10", "16"], []):
        assert main([*words, *radii]) == 0
        assert "equally spaced" not in capsys.readouterr().out


def test_targets_do_not_wait_for_jax(tmp_path):
    script = (
        "import sys; from jaxsfs.cli import main; "
        f"code = main(['target', 'circles', '--out', {str(tmp_path / 'page.pdf')!r}]); "
        "sys.exit(code or 'jax' in sys.modules)"
    )
    assert subprocess.run([sys.executable, "-c", script], capture_output=True, check=False).returncode == 0
