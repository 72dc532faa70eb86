"""Straight lines: no sizes, no pose, one photograph."""

import cv2
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from data_synth.target_patterns import BlankSheet, Checkerboard, LineGrid
from data_synth.targets import Studio, photograph
from jaxsfs.calibration import calibrate_grid, tilted
from jaxsfs.calibration._field import photograph_from
from jaxsfs.calibration._line_points import find_lines
from jaxsfs.calibration._line_search import Family, search_lines, widened
from jaxsfs.camera import Spherical

CAMERA = Spherical(320.0, 330.0, 236.0, 640, 480)
POSE = tilted(15.0, 70.0, 20.0, (2.0, 1.0), 10.0)


@pytest.fixture(scope="module")
def picture():
    return photograph(CAMERA, LineGrid(4.0, 0.5, 12), POSE, Studio(), 3)


@pytest.fixture(scope="module")
def line_grid(picture):
    return calibrate_grid([picture])


def test_a_line_grid_of_unknown_size_gives_the_camera(line_grid):
    assert line_grid.camera.f == pytest.approx(320.0, rel=3e-4)
    assert np.hypot(line_grid.camera.cx - 330.0, line_grid.camera.cy - 236.0) < 0.1
    assert line_grid.views[0].figures["source"] == "line grid"
    assert line_grid.views[0].figures["lines"] > 15
    assert line_grid.verdict.startswith("The lens obeys r = f sin α")


def test_lines_carry_the_error_that_blur_may_leave(line_grid):
    systematic = np.abs(line_grid.fit.setup.systematic)
    assert 0.005 < systematic.max() < 0.3
    assert abs(line_grid.camera.f - 320.0) < 3 * line_grid.f_sd


def test_lines_are_found_beyond_those_known_and_lie_on_the_printed_ones(picture, line_grid):
    photo = photograph_from(picture)
    known = find_lines(photo)
    assert known is not None
    few = np.nonzero(np.abs(known.place - np.median(known.place)) <= 2)[0]
    mine = np.isin(known.line, few)
    line = np.searchsorted(few, known.line[mine])
    start = known._replace(
        pixel=known.pixel[mine], line=line, axis=known.axis[few], place=known.place[few], bend=known.bend[mine]
    )
    more = search_lines(photo, line_grid.fit, start)
    assert more is not None
    assert len(more.axis) > len(few) + 4
    rays = np.asarray(jax.vmap(CAMERA.ray)(jnp.asarray(more.pixel)))
    on_sheet = np.asarray(jax.vmap(POSE.on_target)(jnp.asarray(rays))) / 4.0
    along = np.abs(on_sheet - np.round(on_sheet))  # pitches from the nearest printed line of either family
    crossed = more.axis[more.line]
    assert set(crossed.tolist()) == {0, 1}
    assert np.median(along.min(axis=1)) < 0.005
    assert np.mean(along.min(axis=1) < 0.1) > 0.99


def test_a_family_of_lines_goes_on_where_the_plane_says():
    # lines x = i of the plane z = 10, tilted: normals ∝ a + i b
    a, b = np.array([1.0, 0.2, -0.05]), np.array([0.0, 0.04, -0.1])
    normals = a + np.arange(-8, 9)[:, None] * b
    normals = normals / np.linalg.norm(normals, axis=1)[:, None]
    place = np.array([-3, -2, 0, 1, 3])
    wide = widened(Family(place, normals[place + 8]))
    assert wide.place.tolist() == list(range(-7, 8))
    np.testing.assert_allclose(np.abs(np.sum(wide.normal * normals[wide.place + 8], axis=1)), 1, atol=1e-9)
    two = Family(place[:2], normals[place[:2] + 8])
    assert widened(two) is two


def test_the_naive_scores_collapse_and_the_sampson_distance_does_not(line_grid):
    curve = {key: np.array(values) for key, values in line_grid.figures()["straightness"].items()}
    at_best = int(np.argmin(curve["sampson_px"]))
    assert curve["f"][at_best] == pytest.approx(320.0, rel=0.05)
    assert curve["sampson_px"][0] > 3 * curve["sampson_px"][at_best]
    assert curve["sampson_px"][-1] > 3 * curve["sampson_px"][at_best]
    # in units of the picture itself, straightness in the unwarped picture falls towards 0 for f → ∞
    unwarped = curve["unwarped"] / curve["f"]
    assert unwarped[-1] < unwarped[len(unwarped) // 2] < unwarped[0]


def test_a_checkerboard_of_unknown_size_is_lines_too():
    found = calibrate_grid([photograph(CAMERA, Checkerboard(9, 7, 4.0), tilted(15.0, 70.0, 22.0), Studio(), 3)])
    assert found.views[0].figures["source"] == "checkerboard"
    assert found.camera.f == pytest.approx(320.0, rel=1e-3)


def test_a_blank_sheet_has_no_lines():
    with pytest.raises(ValueError, match="no grid found"):
        calibrate_grid([photograph(CAMERA, BlankSheet(), POSE, Studio(), 0)])


def test_endomapper_lines_through_the_dots(data):
    image = cv2.imread(str(data / "endomapper_plane" / "sample_frame.png"))
    assert image is not None
    found = calibrate_grid([image[..., ::-1]])
    assert found.camera.f == pytest.approx(766.0, abs=3.0)
    assert (found.camera.cx, found.camera.cy) == pytest.approx((739.0, 528.0), abs=3.0)
    assert found.fit.rms < 0.1


def test_mirocam_lines(data):
    images = [cv2.imread(str(p))[..., ::-1] for p in sorted((data / "endoslam_calib" / "mirocam").glob("*.jpg"))]
    found = calibrate_grid(images)
    assert abs(found.camera.f - 215.0) < max(3 * found.f_sd, 10.0)
    assert len(found.views) >= 5


def test_pillcam_is_not_a_sine(data):
    folder = data / "endoslam_calib" / "pillcam1"
    found = calibrate_grid([cv2.imread(str(path))[..., ::-1] for path in sorted(folder.iterdir())])
    assert "The lens is not r = f sin α" in found.verdict
    assert any("consider --model" in warning for warning in found.warnings)
