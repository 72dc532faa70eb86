"""The calibration's own lens profiles are those of the cameras."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxsfs.calibration import LENSES, PlanePose, tilted
from jaxsfs.calibration._lens import camera_of, ray_and_slope, start_lens
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
    build = jnp.asarray(LENSES[name].build)
    rays, slopes = jax.vmap(lambda p: ray_and_slope(build, jnp.asarray(lens), p))(pixels)
    np.testing.assert_allclose(rays, jax.vmap(camera.ray)(pixels), atol=2e-9)
    np.testing.assert_allclose(slopes, jax.vmap(jax.jacfwd(camera.ray))(pixels), atol=2e-7)


@pytest.mark.parametrize("name", LENSES)
def test_derivatives_with_respect_to_the_lens_are_those_of_the_camera(name):
    lens = jnp.asarray(lens_vector(name))
    build, pixel, step = jnp.asarray(LENSES[name].build), jnp.array([430.0, 320.0]), 1e-5
    jacobian = jax.jacfwd(lambda q: ray_and_slope(build, q, pixel)[0])(lens)
    for column in (0, 1, 2, 3, *range(4, 4 + LENSES[name].shapes)):
        change = jnp.zeros(8).at[column].set(step)
        plus = camera_of(name, np.array(lens + change), 640, 480).ray(pixel)
        minus = camera_of(name, np.array(lens - change), 640, 480).ray(pixel)
        np.testing.assert_allclose(jacobian[:, column], (plus - minus) / (2 * step), rtol=1e-6, atol=1e-7)


def test_a_radius_beyond_the_sine_leads_back_instead_of_failing():
    lens, build = jnp.asarray(start_lens(100.0, 0.0, 0.0)), jnp.asarray(LENSES["spherical"].build)
    value, slope = jax.value_and_grad(lambda q: ray_and_slope(build, q, jnp.array([130.0, 0.0]))[0][2])(lens)
    assert jnp.isfinite(value)
    assert slope[0] > 0  # a larger f turns the ray towards the axis


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
