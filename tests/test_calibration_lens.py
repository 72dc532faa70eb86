"""The calibration's own lens profiles are those of the cameras."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxsfs.calibration import LENSES, PlanePose, tilted
from jaxsfs.calibration._lens import camera_of, images, rays, start_lens
from jaxsfs.calibration._plane import rotate, rotation_vector

SHAPES = {
    "spherical-k": (0.035,),
    "kannala-brandt-2": (-0.12, 0.004),
    "kannala-brandt": (-0.1389, -0.00124, 0.000913, -4.07e-05),
    "scaramuzza": (-0.48, 0.01, -0.12),
}


def lens_vector(name):
    lens = start_lens(300.0, 318.5, 241.25)
    lens[3] = np.log(0.97)
    shape = SHAPES.get(name, ())
    lens[4 : 4 + len(shape)] = shape
    return lens


@pytest.mark.parametrize("name", LENSES)
def test_profile_and_slope_are_those_of_the_camera(name):
    lens = lens_vector(name)
    camera = camera_of(name, lens, 640, 480)
    pixels = jnp.array([[318.5, 241.26], [400.0, 300.0], [150.0, 90.0], [505.0, 250.0], [320.0, 470.0]])
    seen = rays(LENSES[name].build, lens, np.array(pixels))
    np.testing.assert_allclose(seen.ray, jax.vmap(camera.ray)(pixels), atol=2e-9)
    np.testing.assert_allclose(seen.slope, jax.vmap(jax.jacfwd(camera.ray))(pixels), atol=2e-7)


@pytest.mark.parametrize("name", LENSES)
def test_points_are_seen_where_their_rays_start(name):
    lens, pixels = lens_vector(name), np.array([[400.0, 300.0], [150.0, 90.0], [505.0, 250.0], [320.0, 470.0]])
    ray = rays(LENSES[name].build, lens, pixels).ray
    np.testing.assert_allclose(images(LENSES[name].build, lens, 20.0 * ray).pixel, pixels, atol=1e-7)


@pytest.mark.parametrize("name", LENSES)
def test_derivatives_with_respect_to_the_lens_are_those_of_the_camera(name):
    lens, pixel, step = lens_vector(name), np.array([430.0, 320.0]), 1e-5
    jacobian = rays(LENSES[name].build, lens, pixel[None]).by_lens[0]
    for column in (0, 1, 2, 3, *range(4, 4 + LENSES[name].shapes)):
        change = step * np.eye(8)[column]
        plus = camera_of(name, lens + change, 640, 480).ray(jnp.asarray(pixel))
        minus = camera_of(name, lens - change, 640, 480).ray(jnp.asarray(pixel))
        np.testing.assert_allclose(jacobian[:, column], (plus - minus) / (2 * step), rtol=1e-6, atol=1e-7)


@pytest.mark.parametrize("name", LENSES)
def test_compiled_fits_and_host_use_the_same_profile(name):
    lens, pixels = lens_vector(name), np.array([[400.0, 300.0], [150.0, 90.0]])
    compiled = jax.jit(rays)(LENSES[name].build, lens, pixels)
    for own, other in zip(rays(LENSES[name].build, lens, pixels), compiled, strict=True):
        np.testing.assert_allclose(own, other, rtol=1e-12, atol=1e-14)


def test_a_radius_beyond_the_sine_leads_back_instead_of_failing():
    seen = rays(LENSES["spherical"].build, start_lens(100.0, 0.0, 0.0), np.array([[105.0, 0.0]]))
    assert np.isfinite(seen.ray).all()
    # a larger f turns the ray towards the axis
    assert seen.by_lens[0, :, 0] @ np.cross(np.cross(seen.ray[0], [0.0, 0.0, 1.0]), seen.ray[0]) > 0


def test_pose_maps_target_to_camera_and_back():
    pose = tilted(20.0, 35.0, 18.0, (2.0, -1.0), roll_deg=25.0)
    point = jnp.array([4.0, 7.0])
    seen = pose.to_camera(point)
    np.testing.assert_allclose(pose.on_target(seen / jnp.linalg.norm(seen)), point, atol=1e-9)
    assert float(jnp.rad2deg(pose.tilt())) == pytest.approx(20.0, abs=1e-6)


def test_rotation_vector_inverts_rotate():
    rotation = jnp.array([0.3, -0.5, 0.9])
    matrix = jnp.stack([rotate(rotation, unit) for unit in jnp.eye(3)], axis=1)
    np.testing.assert_allclose(rotation_vector(matrix), rotation, atol=1e-9)
    pose = PlanePose(rotation, jnp.zeros(2), 10.0)
    assert float(pose.facing(jnp.array([0.0, 0.0, 1.0]))) == pytest.approx(float(matrix[2, 2]))
