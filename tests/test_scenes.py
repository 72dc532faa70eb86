"""Scenes: the ranges lie on the surface, the normals are its normals, the views obey the equation."""

import json
import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from data_synth import (
    REPORT_SEEDS,
    SCENES,
    TUNING_SEEDS,
    Ball,
    BallInBowl,
    FoldedColon,
    HollowBall,
    Plane,
    PolypWall,
    Tube,
    Vase,
    WavyWall,
    default_camera,
    look,
    observe,
    random_scene,
    render_scene,
    scene_from_dict,
    scene_from_text,
    scene_to_dict,
)
from jaxsfs.camera import Orthographic, Spherical
from jaxsfs.photometry import parse_response

SMOOTH = {
    "plane": Plane(),
    "tilted plane": Plane(1.2, 0.4, -0.2),
    "ball": Ball(),
    "hollow ball": HollowBall(),
    "wavy wall": WavyWall(),
    "tube": Tube(),
}
OCCLUDING = {"ball in bowl": BallInBowl(), "vase": Vase(), "polyps": PolypWall(), "colon": FoldedColon()}
ALL = SMOOTH | OCCLUDING


def scope(size=41, half_field_deg=50.0):
    middle = (size - 1) / 2
    return Spherical(middle / math.sin(math.radians(half_field_deg)), middle, middle, size, size)


@pytest.mark.parametrize("name", ALL)
def test_ranges_satisfy_the_implicit_equation(name):
    scene, camera = ALL[name], scope()
    view = observe(scene, camera, half_field_deg=50)
    misfit = jax.jit(jax.vmap(jax.vmap(scene.clearance)))(view.surface.points())
    assert int(view.surface.valid.sum()) > 1200
    np.testing.assert_allclose(np.asarray(misfit)[view.surface.valid], 0, atol=1e-9)


@pytest.mark.parametrize("name", ALL)
def test_normals_are_normal_to_the_surface_of_ranges(name):
    scene, camera = ALL[name], scope()

    def point(pixel):
        ray = camera.ray(pixel)
        return scene.distance(jnp.zeros(3), ray) * ray

    rng = np.random.default_rng(3)
    pixels = jnp.asarray(rng.uniform(8, 32, (50, 2)))
    hits = scene.intersect(jax.vmap(camera.ray)(pixels))
    tangents = jax.jit(jax.vmap(jax.jacfwd(point)))(pixels)
    slant = jnp.einsum("ni,nij->nj", hits.normal, tangents) / jnp.linalg.norm(tangents, axis=1)
    np.testing.assert_allclose(slant, 0, atol=1e-9)
    np.testing.assert_allclose(jnp.linalg.norm(hits.normal, axis=-1), 1, rtol=1e-12)
    assert bool(jnp.all(jnp.sum(hits.normal * jax.vmap(camera.ray)(pixels), axis=-1) < 0))


def test_plane_in_closed_form():
    view = observe(Plane(1.5), scope(), half_field_deg=50)
    cos_alpha = np.asarray(view.camera.rays()[..., 2])
    valid = np.asarray(view.surface.valid)
    np.testing.assert_allclose(np.asarray(view.surface.range)[valid], (1.5 / cos_alpha)[valid], rtol=1e-13)
    np.testing.assert_allclose(np.asarray(view.irradiance.values)[valid], (cos_alpha**3 / 2.25)[valid], rtol=1e-12)


def test_wavy_wall_has_many_nearest_points_and_opens_at_the_rim():
    view = observe(WavyWall(), scope(97), half_field_deg=50)
    values = np.asarray(view.surface.range)
    middle = values[1:-1, 1:-1]
    ring = [values[1 + i : 96 + i, 1 + j : 96 + j] for i in (-1, 0, 1) for j in (-1, 0, 1) if i or j]
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


@pytest.mark.parametrize("name", OCCLUDING)
def test_no_ray_passes_through_a_wall(name):
    """Points sampled densely along each ray up to its range all lie in free space."""
    scene, camera = OCCLUDING[name], scope()
    view = observe(scene, camera, half_field_deg=50)
    ends = np.asarray(view.surface.points())[view.surface.valid]
    points = np.linspace(0, 1, 401)[:-1, None, None] * ends
    clearance = jax.jit(jax.vmap(scene.clearance))(jnp.asarray(points.reshape(-1, 3)))
    assert float(clearance.min()) > -1e-8


@pytest.mark.parametrize("scene", [Vase(), PolypWall(), FoldedColon()], ids=lambda scene: type(scene).__name__)
def test_clearance_is_never_steeper_than_one(scene):
    """What sphere tracing relies on: a step of `clearance` does not cross the surface."""
    rng = np.random.default_rng(5)
    points = jnp.asarray(rng.uniform((-1.2, -1.2, 0), (1.2, 1.2, 5), (20000, 3)))
    clearance, gradient = jax.jit(jax.vmap(jax.value_and_grad(scene.clearance)))(points)
    slope = jnp.linalg.norm(gradient, axis=-1)[clearance > 0]
    assert slope.size > 500
    assert float(slope.max()) <= 1 + 1e-9


def test_cuts_lie_on_the_ball_s_silhouette():
    """A pair of neighbours is cut exactly when one ray lies inside the cone of the ball and the other outside."""
    scene, camera = BallInBowl(), scope()
    view = observe(scene, camera, half_field_deg=50)
    centre = np.array([scene.x, scene.y, scene.z])
    distance = np.linalg.norm(centre)
    inside = np.asarray(camera.rays()) @ centre / distance > math.cos(math.asin(scene.radius / distance))
    valid = np.asarray(view.surface.valid)
    right = (inside[:, 1:] != inside[:, :-1]) & valid[:, 1:] & valid[:, :-1]
    below = (inside[1:] != inside[:-1]) & valid[1:] & valid[:-1]
    cuts = np.asarray(view.cuts)
    assert right.sum() > 25
    np.testing.assert_array_equal(cuts[:, :-1, 0], right)
    np.testing.assert_array_equal(cuts[:-1, :, 1], below)
    expected = np.zeros_like(valid)
    expected[:, :-1] |= right
    expected[:, 1:] |= right
    expected[:-1] |= below
    expected[1:] |= below
    np.testing.assert_array_equal(view.discontinuities(), expected)


def test_steep_continuous_walls_are_not_cut():
    # centres behind the wall: bumps that hide nothing
    scene = PolypWall(((0.3, 0.0, -0.4, 0.5), (-0.4, 0.2, -0.4, 0.45)), blend=0.3)
    assert not bool(observe(scene, scope(), half_field_deg=50).cuts.any())


def test_vase_is_the_survey_s():
    camera = default_camera(Vase(), 41, 41)
    view = observe(Vase(z=1.0), camera)
    points = np.asarray(camera.pixels())
    x, y = (points[..., 0] - 20) / 41, 0.5 - (points[..., 1] - 20) / 41
    f = 0.15 - 0.1 * y * (6 * y + 1) ** 2 * (y - 1) ** 2 * (3 * y - 2)
    height = np.sqrt(np.maximum(f**2 - x**2, 0))
    np.testing.assert_allclose(view.surface.depth(), 1 - height, atol=1e-9)
    np.testing.assert_array_equal(view.cuts, False)  # the body touches its background: no jump along parallel rays


def test_gradient_reaches_traced_scenes():
    camera = scope(5, 20.0)

    def mean_range(blend):
        return jnp.mean(look(PolypWall(((0.1, 0.0, 0.2, 0.3),), blend=blend), camera).range)

    step = 1e-5
    difference = (mean_range(0.1 + step) - mean_range(0.1 - step)) / (2 * step)
    np.testing.assert_allclose(jax.grad(mean_range)(0.1), difference, rtol=1e-6)


@pytest.mark.parametrize("name", SCENES)
def test_scenes_survive_json(name):
    scene = scene_from_text(name)
    again = scene_from_dict(json.loads(json.dumps(scene_to_dict(scene))))
    assert jax.tree.map(float, again) == jax.tree.map(float, scene)


def test_random_scenes_are_the_same_for_the_same_seed():
    kinds = set()
    for seed in TUNING_SEEDS[:40]:
        scene = random_scene(seed)
        kinds.add(type(scene))
        assert scene_to_dict(scene) == scene_to_dict(scene_from_text(f"random:{seed}"))
        assert scene_from_dict(scene_to_dict(scene)) == scene
        assert float(scene.clearance(jnp.array([0.0, 0.0, 0.02]))) > 0.05  # the camera is in free space
    assert len(kinds) == 8
    assert not set(TUNING_SEEDS) & set(REPORT_SEEDS)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: scene_from_text("kolon"), "ball, ball-in-bowl, colon"),
        (lambda: scene_from_text("random:x"), "random:SEED"),
        (lambda: scene_from_dict({"kind": "cone"}), "'kind' must be one of: plane"),
        (lambda: scene_from_dict({"kind": "ball", "parameters": {"raduis": 1}}), "'raduis'.*radius, x, y, z"),
        (lambda: scene_from_dict({"kind": "ball", "parameters": {"radius": "1"}}), "'radius' must be a finite number"),
        (lambda: scene_from_dict({"kind": "polyps", "parameters": {"polyps": [[1, 2]]}}), "x, y, lift, radius"),
        (lambda: default_camera(Plane(), half_field_deg=90), "between 0 and 90"),
        (lambda: random_scene(-1), "from 0 on"),
    ],
)
def test_bad_descriptions_say_what_to_write(make, message):
    with pytest.raises(ValueError, match=message):
        make()


def test_default_camera_reaches_the_half_field_at_the_middle_of_the_short_side():
    camera = default_camera(Plane(), 64, 48, 50)
    ray = camera.ray(jnp.array([31.5, -0.5]))
    np.testing.assert_allclose(math.degrees(math.acos(ray[2])), 50, rtol=1e-9)


def test_sample_says_how_bright_it_is():
    """gain_albedo of the camera file predicts the linear luminance of the photograph."""
    sample = render_scene("plane", width=32, height=24, falloff="cos:1.6", bits=16)
    photometry = sample.camera_file.photometry
    linear = parse_response(photometry["response"]).decode(jnp.asarray(sample.photo.stored / 65535))
    luminance = np.asarray(linear) @ (0.2126, 0.7152, 0.0722)
    cos_alpha = 1 / sample.range  # a plane at unit distance
    expected = photometry["gain_albedo"] * cos_alpha**1.6 * cos_alpha**3
    np.testing.assert_allclose(luminance[sample.valid], expected[sample.valid], atol=2e-5)
    assert np.all(np.isnan(sample.range[~sample.valid]))
    again = scene_from_dict(json.loads(json.dumps(sample.description)))
    assert scene_to_dict(again) == scene_to_dict(Plane())
