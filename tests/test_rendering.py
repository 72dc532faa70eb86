"""The forward model: closed forms, second order from range, derivatives; and what a photograph adds."""

import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from data_synth import Ball, HollowBall, Plane, WavyWall, observe, take_photo
from data_synth.effects import TISSUE, add_noise, blur, exposure, quantise
from jaxsfs.camera import Orthographic, Spherical
from jaxsfs.photometry import CosineFalloff, LinearResponse, SRGBResponse
from jaxsfs.reflectance import OrenNayar, Power
from jaxsfs.rendering import photograph, render, render_distant, shade
from jaxsfs.surface import Surface


def scope(size, half_field_deg=50.0):
    middle = (size - 1) / 2
    return Spherical(middle / math.sin(math.radians(half_field_deg)), middle, middle, size, size)


@pytest.mark.parametrize(
    "scene", [Plane(1.2, 0.4, -0.2), Ball(), HollowBall(), WavyWall(k=7.0)], ids=lambda s: type(s).__name__
)
def test_rendering_from_range_converges_with_second_order(scene):
    errors = []
    for size in (49, 97):
        view = observe(scene, scope(size), half_field_deg=50)
        again = render(view.surface)
        cos_alpha = np.asarray(view.surface.depth() / view.surface.range)
        # one-sided differences at the rim have larger constants; the order is judged inside
        inside = np.asarray(again.valid) & (cos_alpha > math.cos(math.radians(42)))
        exact = np.where(inside, np.asarray(view.irradiance.values), 1)
        errors.append(np.sqrt(np.mean((np.asarray(again.values) / exact - 1)[inside] ** 2)))
    assert errors[-1] < 5e-3
    np.testing.assert_allclose(math.log2(errors[0] / errors[1]), 2, atol=0.25)


def test_a_sphere_about_the_camera_is_rendered_exactly():
    camera = scope(17)
    surface = Surface(camera, jnp.full((17, 17), 2.0), camera.field())
    irradiance = render(surface, reflectance=Power(0.65), albedo=3.0)
    np.testing.assert_allclose(irradiance.values[irradiance.valid], 0.75, rtol=1e-12)


def test_distant_light_on_a_tilted_plane():
    camera = Orthographic(10.0, 8.0, 8.0, 17, 17)
    surface = observe(Plane(2.0, 0.75, 0.0), camera).surface
    np.testing.assert_allclose(render_distant(surface).values, 0.8, rtol=1e-12)
    with pytest.raises(ValueError, match="render_distant"):
        render(surface)


@pytest.mark.parametrize("reflectance", [Power(0.65), OrenNayar(0.3)], ids=lambda r: type(r).__name__)
def test_derivatives_of_shade(reflectance):
    step = 1e-6
    at = (jnp.asarray(1.3), jnp.asarray(0.6), jnp.asarray(0.9))

    def bright(distance, cosine, albedo):
        return shade(distance, cosine, reflectance=reflectance, albedo=albedo)

    for argument, slope in enumerate(jax.grad(bright, argnums=(0, 1, 2))(*at)):
        higher = bright(*(x + step if i == argument else x for i, x in enumerate(at)))
        lower = bright(*(x - step if i == argument else x for i, x in enumerate(at)))
        np.testing.assert_allclose(slope, (higher - lower) / (2 * step), rtol=1e-7)


def test_derivative_of_render_and_photograph():
    camera = scope(17)
    surface = observe(WavyWall(), camera, half_field_deg=45).surface
    rng = np.random.default_rng(2)
    direction = jnp.asarray(rng.standard_normal((17, 17)))

    @jax.jit
    def mean_value(change):
        moved = Surface(camera, surface.range + change * direction, surface.valid)
        return jnp.mean(photograph(render(moved), camera, falloff=CosineFalloff(1.6), gain=0.8))

    step = 1e-6
    difference = (mean_value(step) - mean_value(-step)) / (2 * step)
    slope = jax.grad(mean_value)(0.0)
    assert abs(float(slope)) > 1e-3
    np.testing.assert_allclose(slope, difference, rtol=1e-6)


def test_photograph_is_undone_by_its_own_photometry():
    camera = scope(17)
    irradiance = observe(Plane(), camera, half_field_deg=50).irradiance
    stored = photograph(irradiance, camera, falloff=CosineFalloff(2.0), gain=0.5)
    cos_alpha = camera.rays()[..., 2]
    linear = SRGBResponse().decode(stored)
    again = linear / (0.5 * cos_alpha**2)
    np.testing.assert_allclose(again[irradiance.valid], irradiance.values[irradiance.valid], rtol=1e-12)
    np.testing.assert_array_equal(stored[~irradiance.valid], 0)
    np.testing.assert_allclose(photograph(irradiance, camera, gain=100.0)[irradiance.valid], 1, rtol=1e-15)


def test_photo_is_body_plus_interface():
    view = observe(HollowBall(), scope(33), half_field_deg=50)
    dull = take_photo(view, response=LinearResponse(), bits=None)
    shiny = take_photo(view, shine=0.05, response=LinearResponse(), bits=None)
    np.testing.assert_allclose(shiny.stored, shiny.body + shiny.interface, rtol=1e-12)
    np.testing.assert_allclose(shiny.body, dull.stored, rtol=1e-12)
    colours = dull.body[view.surface.valid] / dull.body[view.surface.valid].max(axis=-1, keepdims=True)
    np.testing.assert_allclose(colours, np.broadcast_to(np.array(TISSUE) / max(TISSUE), colours.shape), rtol=1e-12)
    # white highlights vanish from every difference of channels, eq. (8)
    difference = shiny.stored - dull.stored
    assert difference.max() > 0.01
    np.testing.assert_allclose(difference[..., 0], difference[..., 2], atol=1e-12)


def test_highlights_clip_and_exposure_holds():
    view = observe(HollowBall(), scope(33), half_field_deg=50)
    photo = take_photo(view, shine=5.0, bits=8)
    assert photo.stored.dtype == np.uint8
    assert (photo.stored == 255).any()
    brightest = photo.body.max(axis=-1)[view.surface.valid]
    np.testing.assert_allclose(np.percentile(brightest, 99), 0.9, rtol=1e-12)
    assert take_photo(view, bits=16).stored.dtype == np.uint16


def test_noise_is_the_seed_s_and_has_the_stated_variance():
    view = observe(Plane(), scope(33), half_field_deg=50)
    photos = [take_photo(view, read_noise=0.01, shot_noise=0.001, seed=seed).stored for seed in (7, 7, 8)]
    np.testing.assert_array_equal(photos[0], photos[1])
    assert (photos[0] != photos[2]).any()
    np.testing.assert_array_equal(photos[0][~np.asarray(view.surface.valid)], 0)
    noise = add_noise(np.full((100, 100, 3), 0.4), seed=1, read=0.01, shot=0.001) - 0.4
    np.testing.assert_allclose(noise.std(), math.sqrt(0.01**2 + 0.001 * 0.4), rtol=0.02)


def test_blur_keeps_a_flat_field_flat_and_mixes_inside():
    valid = np.hypot(*np.mgrid[-10:11, -10:11]) < 9
    flat = np.where(valid[..., None], np.full((21, 21, 3), 0.3), 0)
    np.testing.assert_allclose(blur(flat, valid, 1.5), flat, rtol=1e-12)
    spot = np.zeros((21, 21, 3))
    spot[10, 10] = 1
    np.testing.assert_allclose(blur(spot, np.ones_like(valid), 1.0)[10, 10], 1 / (2 * math.pi), rtol=0.01)


def test_bad_photographs_say_why():
    with pytest.raises(ValueError, match="nothing to expose for"):
        exposure(np.zeros((2, 2, 3)), np.ones((2, 2), bool))
    with pytest.raises(ValueError, match="8 or 16 bits"):
        quantise(np.zeros((2, 2, 3)), 12)
