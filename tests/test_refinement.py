"""The solution for a light at the lens, refined for lights beside it."""

import math

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from data_synth import Plane, WavyWall, default_camera, observe
from jaxsfs.camera import Orthographic
from jaxsfs.irradiance import Irradiance
from jaxsfs.lights import Light, Lights, shade_lights
from jaxsfs.reconstruction import reconstruct, scaled_to
from jaxsfs.refinement import RefinementStatus, light_ratio, refine
from jaxsfs.refinement._cells import Model, box, cells_of, log_irradiance, residual
from jaxsfs.reflectance import Lambertian, Phong, Power
from jaxsfs.rendering import render_lights

ONE = Lights((Light((3.5, 0.0, 0.0)),))
THREE = Lights(tuple(Light((3.5 * math.cos(a), 3.5 * math.sin(a), 0.0)) for a in (0.0, 2.0944, 4.1888)))


def picture(scene, lights, size=64, noise=0.0, reflectance=Lambertian()):  # noqa: B008 (frozen)
    """(image in single precision, camera, exact range, disc)."""
    camera = default_camera(scene, size, size, 60.0)
    view = observe(scene, camera, half_field_deg=60.0)
    values = np.asarray(shade_lights(view.surface.points(), view.normals, lights, reflectance=reflectance))
    values = values * (1 + noise * np.random.default_rng(0).standard_normal(values.shape))
    valid = view.surface.valid
    image = Irradiance(jnp.where(valid, jnp.asarray(values, jnp.float32), 0), valid)
    return image, camera, np.asarray(view.surface.range), np.asarray(valid)


def error(result, truth, valid):
    assert np.asarray(result.surface.valid)[valid].all()
    return np.abs(np.asarray(result.surface.range, float) / truth - 1)[valid].mean()


@pytest.mark.parametrize(
    ("scene", "lights", "start", "fixed", "refined"),
    [
        (Plane(20.0), ONE, (0.055, 0.065), 4e-3, 2e-4),
        (Plane(10.0), THREE, (0.03, 0.045), 4e-3, 2e-4),
        (WavyWall(15.0), ONE, (0.07, 0.1), 6e-3, 3e-3),
    ],
    ids=["plane, one guide", "plane, three guides", "wavy wall"],
)
def test_refinement_reaches_its_figures(scene, lights, start, fixed, refined):
    image, camera, truth, valid = picture(scene, lights)
    colocated = reconstruct(image, camera)
    assert start[0] < error(colocated, truth, valid) < start[1]
    solved = refine(colocated, lights, polish_steps=0)
    assert error(solved.result, truth, valid) < fixed
    done = refine(colocated, lights)
    assert done.status is RefinementStatus.SETTLED
    assert error(done.result, truth, valid) < refined
    assert error(done.result, truth, valid) < error(solved.result, truth, valid)
    assert done.residual_after < 0.1 * done.residual_before
    assert done.result.irradiance.values is image.values
    assert done.result.surface.camera == camera
    assert done.as_dict()["status"] == "settled"


def test_noise_is_not_amplified():
    image, camera, truth, valid = picture(Plane(20.0), ONE, noise=0.01)
    done = refine(reconstruct(image, camera), ONE, solves=8)
    assert done.status is RefinementStatus.SETTLED
    assert error(done.result, truth, valid) < 0.002


@pytest.mark.slow
def test_minnaert_surfaces_are_refined_too():
    image, camera, truth, valid = picture(Plane(20.0), ONE, reflectance=Power(0.65))
    start = reconstruct(image, camera, reflectance=Power(0.65))
    done = refine(start, ONE, reflectance=Power(0.65))
    assert error(start, truth, valid) > 0.04
    assert error(done.result, truth, valid) < 5e-4


@pytest.mark.slow
def test_a_known_range_keeps_the_scale():
    """The image in arbitrary units; the range at one pixel, not the albedo, makes millimetres."""
    image, camera, truth, valid = picture(Plane(20.0), ONE)
    image = eqx.tree_at(lambda e: e.values, image, 7 * image.values)
    pixel = (32, 40)
    distance = float(truth[40, 32])

    def solve(irradiance):
        return scaled_to(reconstruct(irradiance, camera), pixel, distance)

    done = refine(solve(image), ONE, again=solve)
    assert error(done.result, truth, valid) < 1e-3
    np.testing.assert_allclose(float(done.result.albedo), 7, rtol=5e-3)


def test_a_wrong_scale_is_not_in_the_residual():
    """Why the scale is not estimated from the lights: each scale has a surface that explains the image."""
    image, camera, truth, valid = picture(Plane(20.0), ONE)
    right, wrong = (refine(reconstruct(image, camera, albedo=rho), ONE) for rho in (1.0, 2.0))
    assert error(wrong.result, math.sqrt(2) * truth, valid) > 50 * error(right.result, truth, valid)
    assert wrong.residual_after < 2 * right.residual_after


def test_light_at_the_lens_leaves_the_surface():
    image, camera, _, _ = picture(Plane(20.0), Lights((Light((0.0, 0.0, 0.0)),)))
    start = reconstruct(image, camera)
    ratio = light_ratio(start.surface, Lights((Light((0.0, 0.0, 0.0)),)), Lambertian())
    np.testing.assert_allclose(ratio, 1, atol=1e-5)
    done = refine(start, Lights((Light((0.0, 0.0, 0.0)),)), polish_steps=0)
    np.testing.assert_allclose(done.result.surface.range, start.surface.range, rtol=1e-4)


def test_worse_gives_the_input_back():
    """Lights far outside the scene explain nothing."""
    image, camera, _, _ = picture(Plane(20.0), ONE)
    start = reconstruct(image, camera)
    done = refine(start, Lights((Light((0.0, 0.0, 40.0)),)), solves=2)
    assert done.status is RefinementStatus.WORSE
    assert not done.status.trustworthy
    assert done.result is start


def test_a_wall_at_the_guide_is_out_of_reach_and_said_to_be():
    image, camera, truth, valid = picture(Plane(3.5), ONE)
    done = refine(reconstruct(image, camera), ONE)
    assert error(done.result, truth, valid) > 0.1
    assert done.status is RefinementStatus.NOT_SETTLED


@pytest.mark.slow
def test_cells_see_the_model_of_the_renderer():
    """ln E between the pixels is that of the exact surface, to second order, and its derivatives are the true ones."""
    errors = []
    for size in (33, 65):
        image, camera, _, _ = picture(WavyWall(15.0, k=5.0), ONE, size)
        view = observe(WavyWall(15.0, k=5.0), camera, half_field_deg=60.0)
        cells = jax.jit(cells_of)(view.surface, Irradiance(image.values.astype(float), image.valid))
        misfit = jax.jit(residual)(jnp.log(view.surface.range), cells, Model(ONE, Lambertian(), 1.0))
        errors.append(float(jnp.mean(jnp.abs(misfit), where=cells.used)))
    assert 1.7 < math.log2(errors[0] / errors[1]) < 2.3

    w = jnp.log(view.surface.range)
    model = Model(ONE, Lambertian(), 1.0)
    moves = jnp.asarray(np.random.default_rng(1).standard_normal(w.shape))
    _, along = jax.jvp(lambda x: residual(x, cells, model), (w,), (moves,))
    numeric = (residual(w + 1e-6 * moves, cells, model) - residual(w - 1e-6 * moves, cells, model)) / 2e-6
    np.testing.assert_allclose(along, numeric, atol=1e-5)
    assert log_irradiance(*box(w), cells, model).shape == (64, 64)


def test_invalid_pixels_are_never_read():
    image, camera, truth, valid = picture(Plane(20.0), ONE)
    hole = np.zeros((64, 64), bool)
    hole[20:26, 30:40] = True
    holed = Irradiance(jnp.where(jnp.asarray(hole), jnp.nan, image.values), image.valid & ~jnp.asarray(hole))
    done = refine(reconstruct(holed, camera), ONE)
    assert not np.asarray(done.result.surface.valid)[hole].any()
    assert error(done.result, truth, valid & ~hole) < 5e-3


def test_refined_surface_renders_the_image():
    image, camera, _, _ = picture(WavyWall(15.0), ONE)
    done = refine(reconstruct(image, camera), ONE)
    drawn = render_lights(done.result.surface, ONE)
    misfit = jnp.abs(drawn.values - image.values) / jnp.mean(image.values, where=drawn.valid)
    np.testing.assert_allclose(float(jnp.mean(misfit, where=drawn.valid)), done.residual_after, rtol=1e-3)


def test_refusals():
    image, camera, _, _ = picture(Plane(20.0), ONE)
    start = reconstruct(image, camera)
    with pytest.raises(ValueError, match="only known for a light at the lens"):
        refine(start, ONE, reflectance=Phong(0.1, 5))
    with pytest.raises(ValueError, match="at least one solve, got solves=0"):
        refine(start, ONE, solves=0)
    flat = Orthographic(scale=64.0, cx=31.5, cy=31.5, width=64, height=64)
    distant = eqx.tree_at(lambda r: r.surface.camera, start, flat)
    with pytest.raises(ValueError, match="central camera, got Orthographic"):
        refine(distant, ONE)
