"""Scenes: the ranges lie on the surface, the normals are its normals, the views obey the equation."""

import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from data_synth import Ball, HollowBall, Plane, Tube, WavyWall, look, observe
from jaxsfs.camera import Orthographic, Spherical
from jaxsfs.rendering import render

SMOOTH = {
    "plane": Plane(),
    "tilted plane": Plane(1.2, 0.4, -0.2),
    "ball": Ball(),
    "hollow ball": HollowBall(),
    "wavy wall": WavyWall(),
    "tube": Tube(),
}


def scope(size=41, half_field_deg=50.0):
    middle = (size - 1) / 2
    return Spherical(middle / math.sin(math.radians(half_field_deg)), middle, middle, size, size)


@pytest.mark.parametrize("name", SMOOTH)
def test_ranges_satisfy_the_implicit_equation(name):
    scene, camera = SMOOTH[name], scope()
    view = observe(scene, camera, half_field_deg=50)
    misfit = jax.vmap(jax.vmap(scene.clearance))(view.surface.points())
    assert int(view.surface.valid.sum()) > 1200
    np.testing.assert_allclose(np.asarray(misfit)[view.surface.valid], 0, atol=1e-9)


@pytest.mark.parametrize("name", SMOOTH)
def test_normals_are_normal_to_the_surface_of_ranges(name):
    scene = SMOOTH[name]
    camera = scope()

    def point(pixel):
        ray = camera.ray(pixel)
        return scene.distance(jnp.zeros(3), ray) * ray

    rng = np.random.default_rng(3)
    pixels = jnp.asarray(rng.uniform(8, 32, (50, 2)))
    hits = scene.intersect(jax.vmap(camera.ray)(pixels))
    tangents = jax.vmap(jax.jacfwd(point))(pixels)
    slant = jnp.einsum("ni,nij->nj", hits.normal, tangents) / jnp.linalg.norm(tangents, axis=1)
    np.testing.assert_allclose(slant, 0, atol=1e-9)
    np.testing.assert_allclose(jnp.linalg.norm(hits.normal, axis=-1), 1, rtol=1e-12)
    assert bool(jnp.all(jnp.sum(hits.normal * jax.vmap(camera.ray)(pixels), axis=-1) < 0))


@pytest.mark.parametrize("name", [name for name in SMOOTH if name != "tube"])
def test_rendering_from_range_converges_with_second_order(name):
    errors = []
    for size in (65, 129, 257):
        view = observe(SMOOTH[name], scope(size), half_field_deg=50)
        again = render(view.surface)
        # one-sided differences at the rim have larger constants; the order is judged inside
        inside = np.asarray(again.valid & (view.camera.rays()[..., 2] > math.cos(math.radians(45))))
        relative = (np.asarray(again.values) / np.where(inside, np.asarray(view.irradiance.values), 1) - 1)[inside]
        errors.append(np.sqrt(np.mean(relative**2)))
    orders = np.log2(np.array(errors[:-1]) / np.array(errors[1:]))
    np.testing.assert_allclose(orders, 2, atol=0.25)


def test_plane_in_closed_form():
    view = observe(Plane(1.5), scope(), half_field_deg=50)
    cos_alpha = np.asarray(view.camera.rays()[..., 2])
    valid = np.asarray(view.surface.valid)
    np.testing.assert_allclose(np.asarray(view.surface.range)[valid], (1.5 / cos_alpha)[valid], rtol=1e-13)
    np.testing.assert_allclose(np.asarray(view.irradiance.values)[valid], (cos_alpha**3 / 2.25)[valid], rtol=1e-12)


def test_wavy_wall_has_many_nearest_points_and_opens_at_the_rim():
    view = observe(WavyWall(), scope(129), half_field_deg=50)
    values = np.asarray(view.surface.range)
    middle = values[1:-1, 1:-1]
    ring = [values[1 + i : 128 + i, 1 + j : 128 + j] for i in (-1, 0, 1) for j in (-1, 0, 1) if i or j]
    nearest = np.all([middle < other for other in ring], axis=0) & np.asarray(view.surface.valid)[1:-1, 1:-1]
    assert nearest.sum() >= 9
    angle = np.linspace(0, 2 * np.pi, 73)
    rim = lambda a: np.stack([np.sin(a) * np.cos(angle), np.sin(a) * np.sin(angle), np.cos(a) + 0 * angle], -1)  # noqa: E731
    ranges = [np.asarray(WavyWall().intersect(rim(math.radians(a))).range) for a in (49, 50)]
    assert np.all(ranges[1] > ranges[0])


def test_orthographic_camera_reads_depth_and_a_distant_light():
    camera = Orthographic(20.0, 10.0, 10.0, 21, 21)
    view = observe(Plane(2.0, 0.5, 0.0), camera)
    np.testing.assert_allclose(view.surface.points()[..., 2], 2 + 0.5 * view.surface.points()[..., 0], rtol=1e-13)
    np.testing.assert_allclose(view.irradiance.values, 1 / math.sqrt(1.25), rtol=1e-13)
    with pytest.raises(ValueError, match="rays from one centre"):
        look(WavyWall(), camera)


def test_gradient_reaches_scene_parameters():
    camera = scope(9, 30.0)

    def mean_range(radius):
        return jnp.mean(look(HollowBall(radius), camera).range)

    step = 1e-5
    difference = (mean_range(1.6 + step) - mean_range(1.6 - step)) / (2 * step)
    np.testing.assert_allclose(jax.grad(mean_range)(1.6), difference, rtol=1e-8)
