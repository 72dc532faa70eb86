"""Cameras of other programs: read back by their own readers where they install, else by documented examples."""

import json

import cv2
import jax
import jax.numpy as jnp
import numpy as np
import pytest
import yaml

from jaxsfs import files
from jaxsfs.camera import (
    CameraFile,
    Equidistant,
    Equisolid,
    KannalaBrandt,
    Orthographic,
    Perspective,
    Scaramuzza,
    Spherical,
    Stereographic,
)
from jaxsfs.cli import main
from jaxsfs.convert import WRITABLE, export_camera, import_camera

SIZE = {"cx": 127.3, "cy": 101.8, "width": 256, "height": 200}
EXACT = {
    "perspective": Perspective(fx=130.0, fy=132.0, **SIZE),
    "equidistant": Equidistant(f=90.0, aspect=1.01, **SIZE),
    "kannala-brandt": KannalaBrandt(fx=91.0, fy=90.0, k=(-0.05, 0.01, -0.002, 1e-4), **SIZE),
}
FITTED = {
    "spherical": Spherical(f=140.0, aspect=0.99, **SIZE),
    "spherical-k": Spherical(f=130.0, k=-0.2, **SIZE),
    "equisolid": Equisolid(f=95.0, **SIZE),
    "stereographic": Stereographic(f=80.0, **SIZE),
    "scaramuzza": Scaramuzza(a=(100.0, 0.0, -2e-3, 1e-6, -1e-8), c=1.01, **SIZE),
    "scaramuzza skew": Scaramuzza(a=(100.0, 0.0, -2e-3, 1e-6, -1e-8), c=1.01, d=3e-4, e=-2e-4, **SIZE),
}


def rays_and_pixels(camera, step=5):
    """Rays below 85° (OpenCV's fisheye sees forward only) of every `step`-th pixel, and the pixels."""
    pixels = jnp.asarray(camera.pixels()[::step, ::step].reshape(-1, 2))
    rays = np.asarray(jax.vmap(camera.ray)(pixels))
    keep = np.asarray(jax.vmap(camera.is_valid)(pixels)) & (rays[:, 2] > 0.09)
    return rays[keep], np.asarray(pixels)[keep]


def opencv_pixels(text: str, rays: np.ndarray) -> np.ndarray:
    """Where OpenCV, which reads `text` itself, projects `rays`."""
    storage = cv2.FileStorage(text, cv2.FILE_STORAGE_READ | cv2.FILE_STORAGE_MEMORY)
    matrix = storage.getNode("camera_matrix").mat()
    distortion = storage.getNode("distortion_coefficients").mat()
    project = cv2.fisheye.projectPoints if storage.getNode("fisheye_model").real() else None
    points = (rays / rays[:, 2:]).reshape(-1, 1, 3)
    if project is not None:
        return project(points, np.zeros(3), np.zeros(3), matrix, distortion)[0].reshape(-1, 2)
    return cv2.projectPoints(points, np.zeros(3), np.zeros(3), matrix, distortion)[0].reshape(-1, 2)


@pytest.mark.parametrize("name", EXACT)
def test_opencv_projects_as_we_do(name):
    rays, pixels = rays_and_pixels(EXACT[name])
    made = export_camera(EXACT[name], "opencv")
    assert made.misfit is None
    np.testing.assert_allclose(opencv_pixels(made.text, rays), pixels, atol=1e-6)


@pytest.mark.parametrize("name", FITTED)
def test_opencv_projects_within_the_misfit_told(name):
    rays, pixels = rays_and_pixels(FITTED[name])
    made = export_camera(FITTED[name], "opencv")
    distance = np.linalg.norm(opencv_pixels(made.text, rays) - pixels, axis=1)
    assert distance.max() <= 1.02 * made.misfit.largest + 1e-9
    # the skew of an OCamCalib camera is out of a fisheye's reach
    assert made.misfit.largest < (0.06 if "skew" in name else 0.05)
    assert str(made.misfit) in made.text


@pytest.mark.slow
def test_the_papers_camera_fits_better_than_its_taylor_series():
    """k = (−1/6, 1/120, …) misses sin α by 0.0008 px at f = 260; the fit over the image is far nearer."""
    camera = Spherical(f=260.0, cx=255.5, cy=255.5, width=512, height=512)
    made = export_camera(camera, "opencv")
    assert made.misfit.largest < 2e-5
    assert made.misfit.reach_deg > 89
    series = KannalaBrandt(fx=260.0, fy=260.0, cx=255.5, cy=255.5, width=512, height=512)
    series = KannalaBrandt(**{**vars(series), "k": (-1 / 6, 1 / 120, -1 / 5040, 1 / 362880)})
    rays, pixels = rays_and_pixels(camera, step=9)
    misses = np.linalg.norm(np.asarray(jax.vmap(series.project)(jnp.asarray(rays))) - pixels, axis=1)
    assert 3e-4 < misses.max() < 9e-4
    ours = np.linalg.norm(opencv_pixels(made.text, rays) - pixels, axis=1)
    assert ours.max() < 0.05 * misses.max()


@pytest.mark.parametrize("format", WRITABLE)
@pytest.mark.parametrize("name", ["perspective", "kannala-brandt"])
def test_round_trips_are_exact(format, name):
    found = import_camera(export_camera(EXACT[name], format).text)
    assert type(found.camera) is type(EXACT[name])
    assert found.misfit is None
    ours, back = jax.tree.leaves(EXACT[name]), jax.tree.leaves(found.camera)
    np.testing.assert_allclose(back, ours, rtol=1e-14)
    assert (found.camera.width, found.camera.height) == (256, 200)


def test_pixel_origins_are_the_formats_own():
    texts = {format: export_camera(EXACT["perspective"], format).text for format in WRITABLE}
    assert texts["colmap"].splitlines()[-1] == "1 PINHOLE 256 200 130.0 132.0 127.8 102.3"
    assert json.loads(texts["nerfstudio"])["cx"] == 127.8
    assert yaml.safe_load(texts["kalibr"])["cam0"]["intrinsics"] == [130.0, 132.0, 127.3, 101.8]
    assert yaml.safe_load(texts["ros"])["camera_matrix"]["data"][2] == 127.3


def test_what_has_no_place_is_named():
    file = CameraFile(EXACT["equidistant"], {"response": "srgb"}, {"serial": 7})
    assert export_camera(file, "kalibr").lost == ("photometry.response", "serial")


KALIBR = """
cam0:
  camera_model: pinhole
  distortion_coeffs: [-0.01, 0.02, -0.03, 0.004]
  distortion_model: equidistant
  intrinsics: [461.6, 460.3, 363.0, 248.1]
  resolution: [752, 480]
  rostopic: /cam0/image_raw
  timeshift_cam_imu: 0.01
cam1: {camera_model: omni}
"""
ROS = """
image_width: 640
image_height: 480
camera_name: narrow
camera_matrix: {rows: 3, cols: 3, data: [600, 0, 320, 0, 601, 240, 0, 0, 1]}
distortion_model: plumb_bob
distortion_coefficients: {rows: 1, cols: 5, data: [-0.2, 0.05, 0.0003, -0.0002, 0.0]}
rectification_matrix: {rows: 3, cols: 3, data: [1, 0, 0, 0, 1, 0, 0, 0, 1]}
"""
COLMAP = """# Camera list with one line of data per camera:
#   CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]
1 SIMPLE_PINHOLE 3072 2304 2559.81 1536 1152
2 PINHOLE 3072 2304 2560.56 2560.56 1536 1152
"""


def test_a_kalibr_chain():
    found = import_camera(KALIBR)
    assert isinstance(found.camera, KannalaBrandt)
    assert (found.camera.fx, found.camera.cy, found.camera.k) == (461.6, 248.1, (-0.01, 0.02, -0.03, 0.004))
    assert found.unused == ("cam1", "cam0.timeshift_cam_imu")


@pytest.mark.slow
def test_a_ros_camera_with_tangential_distortion():
    found = import_camera(ROS)
    assert found.unused == ("rectification_matrix",)
    assert found.misfit.largest < 0.5
    matrix = np.array([[600.0, 0, 320], [0, 601, 240], [0, 0, 1]])
    rays, pixels = rays_and_pixels(found.camera, step=20)
    truth = cv2.projectPoints(
        rays.reshape(-1, 1, 3), np.zeros(3), np.zeros(3), matrix, np.array([-0.2, 0.05, 3e-4, -2e-4, 0])
    )[0].reshape(-1, 2)
    assert np.linalg.norm(truth - pixels, axis=1).max() < 1.1 * found.misfit.largest
    with pytest.raises(ValueError, match=r"more than 0.01 px; raise the tolerance"):
        import_camera(ROS, tolerance=0.01)


def test_a_colmap_list():
    found = import_camera(COLMAP)
    assert found.camera == Perspective(fx=2559.81, fy=2559.81, cx=1535.5, cy=1151.5, width=3072, height=2304)
    assert found.unused == ("camera 2",)
    radial = import_camera("1 RADIAL_FISHEYE 640 480 300 320 240 -0.1 0.02")
    assert radial.camera.k == (-0.1, 0.02, 0.0, 0.0)


def test_a_published_calibration_in_xml(data):
    """From OpenCV's own calibration sample; the figures are in the folder's SOURCE.txt."""
    text = (data / "endocal_sample_001/calibration_001-010.xml").read_text()
    found = import_camera(text, tolerance=2)
    assert (found.camera.width, found.camera.height) == (768, 710)
    assert "Extrinsic_Parameters" in found.unused
    check_against_brown(found, (649.504721, 649.708188, 420.119666, 361.471512), (-0.488123, 0.347245, 0, 0, -0.144790))
    with pytest.raises(ValueError, match="nearest camera of ours misses this lens by 1"):
        import_camera(text)


def test_a_published_calibration_in_printed_arrays(data):
    text = (data / "endocal_circles/calibration_001-011.yml").read_text()
    with pytest.raises(ValueError, match="--size"):
        import_camera(text)
    found = import_camera(text, size=(1920, 1080))
    check_against_brown(found, (438.079425, 438.363624, 995.831444, 547.805101), (-0.343874, 0.139610, 0, 0, -0.054079))


def check_against_brown(found, intrinsics, distortion):
    """Rays up to 40° land where OpenCV's Brown model puts them."""
    fx, fy, cx, cy = intrinsics
    slope = np.stack(np.meshgrid(*[np.linspace(-0.55, 0.55, 23)] * 2), axis=-1).reshape(-1, 2)
    points = np.concatenate([slope, np.ones((len(slope), 1))], axis=1)
    matrix = np.array([[fx, 0, cx], [0, fy, cy], [0, 0, 1]])
    brown = cv2.projectPoints(points.reshape(-1, 1, 3), np.zeros(3), np.zeros(3), matrix, np.array(distortion, float))
    ours = np.asarray(jax.vmap(found.camera.project)(jnp.asarray(points)))
    distance = np.linalg.norm(ours - brown[0].reshape(-1, 2), axis=1)
    assert distance.max() < min(found.misfit.largest, 0.3)


@pytest.mark.parametrize(
    ("text", "format", "message"),
    [
        ("nothing here", None, "format cannot be told"),
        ("cam0: {camera_model: omni}", None, "camera_model 'omni'"),
        ("1 FOV 640 480 1 2 3 4 5", None, "'FOV' is unknown"),
        ("1 PINHOLE 640 480 500 320 240", None, "parameters fx, fy, cx, cy, got 3 numbers"),
        ("1 PINHOLE 640 480 500 -3 320 240", None, "must be positive"),
        ("%YAML:1.0\n---\nimage_width: 4\n", None, "expected a camera matrix"),
        ("%YAML:1.0\n---\ncamera_matrix: [", None, "OpenCV cannot read"),
        ("cam0: [", "kalibr", "not readable as YAML"),
        ('{"camera_model": "PINHOLE"}', None, "needs numbers for fx, fy, cx, cy"),
        ("{", "nerfstudio", "line 1, column 2"),
        (ROS.replace("plumb_bob", "mystery"), None, "'mystery' is unknown"),
        (ROS.replace("[600, 0", "[600, 9"), None, r"expected the camera matrix \[fx 0 cx"),
        (ROS, "pix4d", "format 'pix4d' is unknown"),
    ],
)
def test_unusable_sources_are_named(text, format, message):
    with pytest.raises(ValueError, match=message):
        import_camera(text, format)


def test_four_coefficients_of_unknown_meaning_are_asked_about():
    text = export_camera(EXACT["kannala-brandt"], "opencv").text.replace("fisheye_model: 1", "made: 1")
    with pytest.raises(ValueError, match="--from opencv-fisheye"):
        import_camera(text)
    assert isinstance(import_camera(text, "opencv-fisheye").camera, KannalaBrandt)


def test_cameras_without_a_format():
    with pytest.raises(ValueError, match="orthographic"):
        export_camera(Orthographic(scale=10.0, **SIZE), "opencv")
    with pytest.raises(ValueError, match="cannot be written; write one of: opencv, kalibr"):
        export_camera(EXACT["perspective"], "opencv-fisheye")
    with pytest.raises(ValueError, match="256 x 200 px, but 25 x 20"):
        import_camera(export_camera(EXACT["perspective"], "colmap").text, size=(25, 20))


def test_command(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    files.write_camera("camera.json", CameraFile(FITTED["spherical"], {"response": "srgb"}, {}))
    for name in ("camera.yaml", "camchain.yaml", "camera_info.yaml", "cameras.txt", "transforms.json"):
        assert main(["convert", "camera.json", name]) == 0
        shown = capsys.readouterr()
        assert "exported as the nearest fisheye: rms" in shown.out
        assert "no place for it: photometry.response" in shown.err
        assert main(["convert", name, "back.json", "--force"]) == 0
        assert isinstance(files.read_camera("back.json").camera, KannalaBrandt)
        capsys.readouterr()
    assert main(["convert", "camera.json", "camera.yaml"]) == 2
    assert "exists already" in capsys.readouterr().err
    assert main(["convert", "camera.json", "camera.bin"]) == 2
    assert "name it (--to)" in capsys.readouterr().err


def test_command_keeps_the_misfit_of_an_import(tmp_path, capsys):
    (tmp_path / "ros.yaml").write_text(ROS)
    assert main(["convert", str(tmp_path / "ros.yaml"), str(tmp_path / "camera.json"), "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert (said["from"], said["to"]) == ("ros", "jaxsfs")
    assert json.loads((tmp_path / "camera.json").read_text())["import_misfit_px"] == said["imported"]["misfit"]
    assert main(["convert", str(tmp_path / "ros.yaml"), str(tmp_path / "cameras.txt")]) == 0
    assert "# imported as the nearest fisheye: rms" in (tmp_path / "cameras.txt").read_text()
    assert main(["convert", str(tmp_path / "ros.yaml"), str(tmp_path / "c.json"), "--tolerance", "0.01"]) == 2
    assert not (tmp_path / "c.json").exists()
