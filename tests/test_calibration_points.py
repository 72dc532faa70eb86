"""Checkerboards and dots: synthetic photographs with known truth, real ones with published calibrations."""

import cv2
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from data_synth.target_patterns import BlankSheet, Checkerboard, DotGrid
from data_synth.targets import Studio, photograph
from jaxsfs.calibration import calibrate_checkerboard, calibrate_dots, calibrate_points, tilted
from jaxsfs.calibration._blobs import _centroid, blobs
from jaxsfs.calibration._field import photograph_from
from jaxsfs.calibration._lattice import grow_lattice
from jaxsfs.camera import Spherical

CAMERA = Spherical(320.0, 330.0, 236.0, 640, 480)
POSES = (tilted(15.0, 70.0, 22.0, (2.0, 1.0), 10.0), tilted(18.0, 320.0, 24.0, (0.0, 1.0), 30.0))


def colour(path):
    image = cv2.imread(str(path))
    assert image is not None, path
    return image[..., ::-1]


def project(pose, points):
    return np.array(jax.vmap(lambda point: CAMERA.project(pose.to_camera(point)))(jnp.asarray(points)))


@pytest.mark.parametrize("asymmetric", [pytest.param(False, marks=pytest.mark.slow), True])
def test_dots_recover_the_camera(asymmetric):
    pattern = DotGrid(7, 11, 3.0, 0.7, True) if asymmetric else DotGrid(9, 8, 4.0, 0.7)
    images = [photograph(CAMERA, pattern, pose, Studio(), i) for i, pose in enumerate(POSES)]
    columns, rows, pitch = (7, 11, 3.0) if asymmetric else (9, 8, 4.0)
    found = calibrate_dots(images, columns, rows, pitch, asymmetric)
    assert found.camera.f == pytest.approx(320.0, rel=3e-3)
    assert np.hypot(found.camera.cx - 330.0, found.camera.cy - 236.0) < 0.5
    assert found.figures()["photographs"][0]["tilt_deg"] == pytest.approx(15.0, abs=0.3)
    assert found.figures()["photographs"][0]["height_mm"] == pytest.approx(22.0, rel=0.01)


@pytest.mark.parametrize("blur", [0.8, 2.0])
def test_the_middle_of_a_dot_is_found_where_light_falls_off(blur):
    # light that falls by 0.6 to 1.2 % a pixel moves the centroid of what it lacks, and of its share otherwise
    middles = np.array([[40.3, 40.1], [110.6, 41.7], [40.8, 110.2], [111.1, 110.9]])
    fine = np.stack(np.meshgrid(*(np.arange(600) / 4 - 0.375,) * 2), axis=-1)
    away = np.linalg.norm(fine[:, :, None] - middles, axis=-1).min(axis=-1)
    light = np.where(away < 7, 0.1, 0.8) * (1 - 0.005 * fine[..., 0] - 0.001 * fine[..., 1])
    light = cv2.GaussianBlur(light, (0, 0), 4 * blur).reshape(150, 4, 150, 4).mean(axis=(1, 3))
    found = blobs(photograph_from(light.astype(np.float32)))
    nearest = np.linalg.norm(found[:, None] - middles, axis=-1).argmin(axis=0)
    assert len(found) == 4
    np.testing.assert_allclose(found[nearest], middles, atol=0.025)


def test_a_spot_that_is_no_ink_on_paper_has_the_middle_of_its_region():
    region = np.zeros((21, 25), bool)
    region[6:13, 9:16] = True
    middle = _centroid(np.where(region, 0.9, 0.5), region, ~region)
    np.testing.assert_allclose(middle, [12.0, 9.0])


def test_checkerboard_recovers_the_camera():
    images = [photograph(CAMERA, Checkerboard(7, 6, 3.5), pose, Studio(), i) for i, pose in enumerate(POSES)]
    found = calibrate_checkerboard(images, 7, 6, 3.5, model="auto")
    assert found.fit.name == "spherical"
    assert found.camera.f == pytest.approx(320.0, rel=5e-3)
    assert len(found.views) == 2


def test_points_without_noise_give_the_camera_exactly():
    grid = np.stack(np.meshgrid(np.arange(-4.0, 5.0), np.arange(-3.0, 4.0)), axis=-1).reshape(-1, 2) * 3
    pixels = [project(pose, grid) for pose in POSES]
    found = calibrate_points(pixels, [grid, grid], (640, 480))
    assert found.camera.f == pytest.approx(320.0, abs=1e-3)
    assert found.fit.rms < 1e-3


def test_lattice_is_indexed_across_strong_distortion_and_clutter():
    grid = np.stack(np.meshgrid(np.arange(-5.0, 6.0), np.arange(-4.0, 5.0)), axis=-1).reshape(-1, 2)
    pixels = project(POSES[0], 3.0 * grid)
    clutter = np.array([[20.0, 30.0], [600.0, 20.0], [35.0, 440.0]])
    rows, index = grow_lattice(np.concatenate([pixels, clutter]))
    true = grid[rows[rows < len(grid)]]
    assert len(true) == len(rows) == len(grid)
    steps = np.linalg.lstsq(np.column_stack([true, np.ones(len(true))]), index.astype(float), rcond=None)
    assert steps[1].size == 0 or steps[1].max() < 1e-9


def test_wrong_counts_and_missing_targets_are_refused():
    blank = photograph(CAMERA, BlankSheet(), POSES[0], Studio(), 0)
    with pytest.raises(ValueError, match="count corners between squares"):
        calibrate_checkerboard([blank], 7, 6, 2.0)
    with pytest.raises(ValueError, match="no grid of 9 x 8 dots"):
        calibrate_dots([blank], 9, 8, 2.0)
    with pytest.raises(ValueError, match="columns must be at least 2"):
        calibrate_dots([blank], 1, 8, 2.0)
    with pytest.raises(ValueError, match="pitch"):
        calibrate_dots([blank], 9, 8, -2.0)


@pytest.mark.slow
def test_points_that_no_flat_sheet_explains_are_refused():
    rng = np.random.default_rng(0)
    grid = np.stack(np.meshgrid(np.arange(6.0), np.arange(5.0)), axis=-1).reshape(-1, 2)
    with pytest.raises(ValueError, match="miscounted"):
        calibrate_points([rng.uniform(50, 430, (30, 2))], [grid], (640, 480))


def test_endomapper_dots(data):
    image = colour(data / "endomapper_plane" / "sample_frame.png")
    found = calibrate_dots([image], 19, 10, 5.2797, two_scales=True)
    assert found.views[0].matched >= 180
    assert found.camera.f == pytest.approx(766.0, abs=3.0)
    assert (found.camera.cx, found.camera.cy) == pytest.approx((739.0, 528.0), abs=3.0)
    assert found.fit.rms <= 0.15
    rms = {score.name: score.rms for score in found.comparison}
    assert rms["spherical"] < min(rms["equisolid"], rms["equidistant"], rms["stereographic"])
    assert found.verdict.startswith("The lens obeys r = f sin α") or "describes the lens" in found.verdict


@pytest.mark.slow
def test_endocal_published_points(data):
    table = np.loadtxt(data / "endocal_sample_001" / "sample_001_points_from_xml.csv", delimiter=",")
    views = [table[table[:, 0] == view] for view in np.unique(table[:, 0])]
    found = calibrate_points([v[:, 4:6] for v in views], [v[:, 2:4] for v in views], (768, 710))
    assert found.camera.f == pytest.approx(661.0, abs=10.0)
    assert found.fit.rms <= 0.30


@pytest.mark.slow
def test_endocal_frames_are_detected(data):
    frames = sorted((data / "endocal_sample_001").glob("frame_*.jpg"))
    found = calibrate_dots([colour(frame) for frame in frames], 3, 11, 1.0, asymmetric=True)
    assert len(found.views) >= 5
    assert abs(found.camera.f - 661.0) < 3 * found.f_sd + 10


@pytest.mark.slow
def test_mirocam_boards_are_detected_and_the_fit_is_sane(data):
    frames = sorted((data / "endoslam_calib" / "mirocam").glob("*.jpg"))
    found = calibrate_checkerboard([colour(frame) for frame in frames], 7, 6, 2.0)
    assert len(found.views) >= 5
    assert found.camera.f == pytest.approx(215.0, rel=0.08)
    assert found.fit.rms < 1.0


@pytest.mark.slow
def test_endocal_rays_agree_with_the_published_calibration(data):
    """Two frames of eleven; the published camera is OpenCV's with radial terms. This scope is equisolid."""
    frames = [colour(data / "endocal_circles" / name) for name in ("frame_001.jpg", "frame_003.jpg")]
    found = calibrate_dots(frames, 3, 11, 1.0, asymmetric=True, model="auto", stretch=1.5)
    assert found.fit.name == "equisolid"
    matrix = np.array([[438.08, 0, 995.83], [0, 438.36, 547.81], [0, 0, 1]])
    distortion = np.array([-0.34387447, 0.13960969, 0, 0, -0.05407863])
    u, v = np.meshgrid(np.arange(740.0, 1260, 20), np.arange(290.0, 810, 20))
    pixel = np.stack([u.ravel(), v.ravel()], axis=1)
    pixel = pixel[np.hypot(*(pixel - [995.83, 547.81]).T) < 250]
    published = np.column_stack([cv2.undistortPoints(pixel[:, None], matrix, distortion)[:, 0], np.ones(len(pixel))])
    published /= np.linalg.norm(published, axis=1, keepdims=True)
    ours = np.array(jax.vmap(found.camera.ray)(jnp.asarray(pixel)))
    # a common turn belongs to the pose
    u_, _, vt = np.linalg.svd(published.T @ ours)
    angle = np.degrees(np.arccos(np.clip(np.sum(published * (ours @ (u_ @ vt).T), axis=1), -1, 1)))
    assert angle.max() < 0.15


@pytest.mark.slow
def test_a_photograph_whose_points_do_not_fit_is_left_out():
    grid = np.stack(np.meshgrid(np.arange(-4.0, 5.0), np.arange(-3.0, 4.0)), axis=-1).reshape(-1, 2) * 3
    pixels = [project(pose, grid) for pose in (*POSES, tilted(5.0, 10.0, 20.0))]
    miscounted = np.random.default_rng(0).permutation(grid)
    found = calibrate_points(pixels, [grid, miscounted, grid], (640, 480))
    assert [view.photograph for view in found.views] == [0, 2]
    assert found.rejected[0][0] == 1
    assert found.camera.f == pytest.approx(320.0, abs=1e-2)
