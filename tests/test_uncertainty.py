"""1σ of the range from noise and from calibration: against the whole Jacobian, Monte Carlo, and moved cameras."""

import json

import cv2
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from data_synth import default_camera, observe, scene_from_text
from jaxsfs import GammaResponse, Irradiance, NoFalloff, Spherical, Surface, files, log_range
from jaxsfs.calibration._lens import camera_of, start_lens
from jaxsfs.camera import CameraFile, camera_to_dict
from jaxsfs.cli import main
from jaxsfs.photo import gaussian_kernel, smoothed_within
from jaxsfs.uncertainty import calibration_sigma, irradiance_sigma, lens_covariance, moved_lens, noise_sigma


def surface_of(irradiance, camera):
    found, known = log_range(irradiance, camera, tolerance=1e-9)
    return Surface(camera, jnp.exp(found), known)


solved = jax.jit(surface_of)


def view_of(text, size):
    scene = scene_from_text(text)
    view = observe(scene, default_camera(scene, size, size), half_field_deg=45.0)
    return view.camera, view.irradiance


def test_probes_give_the_diagonal_of_the_covariance():
    camera, irradiance = view_of("tilted-plane", 24)
    sigma = 0.001 * irradiance.values
    jacobian = jax.jit(jax.jacfwd(lambda e: jnp.log(solved(Irradiance(e, irradiance.valid), camera).range)))(
        irradiance.values
    )
    exact = np.sqrt(np.sum((np.asarray(jacobian) * np.asarray(sigma)) ** 2, axis=(2, 3)))
    valid = np.asarray(irradiance.valid)
    found = noise_sigma(lambda e: solved(e, camera), irradiance, sigma, probes=256, solves=1)
    assert np.isnan(found[~valid]).all()
    # the shift of a single solution adds noise: compare what most pixels say
    ratio = found[valid] / exact[valid]
    assert 0.85 < np.median(ratio) < 1.35


def test_the_band_holds_the_truth():
    """8-bit photographs with 0.4 % noise, smoothed as `reconstruct` does; the truth is the solution without noise."""
    camera, irradiance = view_of("ball", 97)
    valid, kernel = irradiance.valid, gaussian_kernel(0.7, irradiance.values.dtype)
    clean = 0.9 * irradiance.values / jnp.max(jnp.where(valid, irradiance.values, 0))
    response, rng = GammaResponse(2.2), np.random.default_rng(0)
    truth = np.log(solved(Irradiance(smoothed_within(clean, valid, kernel), valid), camera).range)
    shares = []
    for draw in range(4):
        stored = np.asarray(response.encode(jnp.where(valid, clean, 0))) + 0.004 * rng.standard_normal(valid.shape)
        stored = np.round(np.clip(stored, 0, 1) * 255) / 255
        noisy = Irradiance(smoothed_within(response.decode(jnp.asarray(stored)), valid, kernel), valid)
        sigma = irradiance_sigma(
            noisy, camera, np.hypot(0.004, 1 / 255 / 12**0.5), response=response, falloff=NoFalloff()
        )
        spread = noise_sigma(lambda e: solved(e, camera), noisy, sigma, smooth_px=0.7, seed=draw)
        error = np.abs(np.log(solved(noisy, camera).range) - truth)
        shares.append(np.mean((error < 1.96 * spread)[np.asarray(valid)]))
    assert 0.9 < np.mean(shares) < 0.99


@pytest.mark.parametrize("name", ["spherical-k", "equidistant", "perspective", "kannala-brandt", "scaramuzza"])
def test_moved_lenses_are_the_calibrations(name):
    lens = start_lens(90.0, 30.0, 25.0)
    lens[3:5] = 0.02, (-0.25 if name == "scaramuzza" else 0.03)
    if name not in ("spherical-k", "kannala-brandt", "scaramuzza"):
        lens[4] = 0.0
    change = np.array([0.01, 0.3, -0.2, 0.005, 0.01, 0.0, 0.0, 0.0])
    expected = camera_of(name, lens + change, 64, 48)
    moved = moved_lens(camera_of(name, lens, 64, 48), jnp.asarray(change))
    np.testing.assert_allclose(moved.rays(), expected.rays(), atol=1e-9)


def test_calibration_covariance_moves_ranges_as_moved_cameras_do():
    camera, irradiance = view_of("wavy-wall", 33)
    covariance = np.zeros((8, 8))
    covariance[:2, :2] = [[1e-6, 2e-5], [2e-5, 1e-2]]  # ln f and cx, correlated
    found = calibration_sigma(lambda c: solved(irradiance, c), camera, covariance)
    step = 1e-5
    rows = []
    for axis in (0, 1):
        ends = [
            np.log(solved(irradiance, moved_lens(camera, jnp.zeros(8).at[axis].set(sign * step))).range)
            for sign in (1, -1)
        ]
        rows.append((ends[0] - ends[1]) / (2 * step))
    expected = np.sqrt(np.einsum("ivu,ij,jvu->vu", rows, covariance[:2, :2], rows))
    valid = np.asarray(irradiance.valid)
    # a pixel that faces the light stays at its deadline, whatever the camera: 0
    # on the wall's lines of symmetry, where fronts meet, there is no derivative by cx
    assert np.percentile(np.abs(found - expected)[valid], 90) < 1e-3 * np.median(expected[valid])
    assert np.isnan(found[~valid]).all()


def test_covariances_in_camera_files():
    camera = Spherical(90.0, 30.0, 25.0, 64, 48)
    assert lens_covariance(CameraFile(camera, {}, {})) is None
    record = {"uncertainty": {"covariance": np.eye(8).tolist()}}
    found = lens_covariance(CameraFile(camera, {}, {"calibration": record}))
    assert found is not None
    assert found.shape == (8, 8)
    with pytest.raises(ValueError, match=r"finite 8 x 8 covariance .* got shape \(2, 2\)"):
        lens_covariance(CameraFile(camera, {}, {"calibration": {"uncertainty": {"covariance": [[1, 0], [0, 1]]}}}))


@pytest.mark.slow
def test_reconstruct_writes_the_map(tmp_path, capsys):
    camera, irradiance = view_of("tilted-plane", 64)
    values = np.asarray(irradiance.values / jnp.max(jnp.where(irradiance.valid, irradiance.values, 0)))
    noisy = values ** (1 / 2.2) * 0.9 + 0.004 * np.random.default_rng(0).standard_normal(values.shape)
    cv2.imwrite(f"{tmp_path}/photo.png", np.round(255 * np.clip(noisy, 0, 1)).astype(np.uint8))
    cv2.imwrite(f"{tmp_path}/mask.png", np.asarray(irradiance.valid).astype(np.uint8) * 255)
    lens = {"covariance": np.diag([1e-6, 0.01, 0.01, 0, 0, 0, 0, 0]).tolist()}
    files.write_json(tmp_path / "camera.json", camera_to_dict(camera) | {"calibration": {"uncertainty": lens}})
    words = ["reconstruct", f"{tmp_path}/photo.png", "--camera", f"{tmp_path}/camera.json", "--mask"]
    words += [
        f"{tmp_path}/mask.png",
        "--response",
        "gamma:2.2",
        "--out",
        f"{tmp_path}/out",
        "--known-range",
        "32,32,20",
    ]
    assert main([*words, "--uncertainty"]) == 0
    assert "is not in it" in capsys.readouterr().out
    sigma = files.read_map(tmp_path / "out" / "range_sigma.tiff")
    record = json.loads((tmp_path / "out" / "result.json").read_text(encoding="utf-8"))["uncertainty"]
    assert np.nanmedian(sigma) == pytest.approx(record["median"], rel=1e-5)
    assert 0.0005 < record["relative_median"] < 0.02
    assert 0 < record["from_calibration_median"] < record["median"]
    # the known range is where the scale comes from: there the error is least
    assert np.nanmin(sigma[29:36, 29:36]) < 0.8 * record["median"]
    assert main([*words, "--uncertainty", "--force", "--light", "distant"]) == 2
