"""Meshes: which pixels, which way round, and where they are cut open."""

import jax.numpy as jnp
import numpy as np
import pytest
from jax import Array

from jaxsfs.camera import AbstractCamera, Equidistant, Orthographic, Perspective, Spherical
from jaxsfs.mesh import mesh_from_surface
from jaxsfs.surface import Surface

SIZE = 97
CENTRE = (48.0, 48.0, SIZE, SIZE)
CAMERAS = {
    "spherical": Spherical(70.0, *CENTRE),
    "perspective": Perspective(60.0, 61.0, *CENTRE),
    "equidistant": Equidistant(60.0, *CENTRE),
    "orthographic": Orthographic(40.0, *CENTRE),
}


def wavy(camera: AbstractCamera) -> Array:
    pixels = camera.pixels()
    return 2 + 0.1 * jnp.sin(pixels[..., 0] / 9) * jnp.cos(pixels[..., 1] / 7)


def surface_of(camera: AbstractCamera, distance: Array, valid: Array | None = None) -> Surface:
    return Surface(camera, jnp.asarray(distance), camera.field() if valid is None else valid)


def ball_before_wall(camera: AbstractCamera) -> tuple[Array, np.ndarray]:
    """Range of a ball (centre (0.1, 0, 1.2), radius ½) in front of the plane z = 1.4, and the ball's pixels."""
    rays = camera.rays()
    along = rays @ jnp.array([0.1, 0, 1.2])
    discriminant = along**2 - (1.45 - 0.25)
    on_ball = discriminant > 0
    near = along - jnp.sqrt(jnp.maximum(discriminant, 0))
    return jnp.where(on_ball, near, 1.4 / rays[..., 2]), np.asarray(on_ball)


@pytest.mark.parametrize("name", CAMERAS)
def test_a_smooth_surface_is_two_triangles_per_square_facing_the_camera(name):
    camera = CAMERAS[name]
    surface = surface_of(camera, wavy(camera))
    mesh = mesh_from_surface(surface)
    squares = np.asarray(surface.valid)
    squares = squares[:-1, :-1] & squares[1:, :-1] & squares[:-1, 1:] & squares[1:, 1:]
    assert len(mesh.faces) >= 2 * squares.sum()  # squares with three valid corners give one each
    rays = mesh.triangles_center.copy()
    if name == "orthographic":
        rays[:] = [0, 0, 1]
    assert ((mesh.face_normals * rays).sum(axis=-1) < 0).all()
    assert mesh.is_winding_consistent
    np.testing.assert_allclose(mesh.vertices, np.asarray(surface.points())[np.asarray(surface.valid)], rtol=1e-6)


def test_vertices_are_the_used_pixels_with_their_colours():
    camera = CAMERAS["perspective"]
    valid = np.zeros((SIZE, SIZE), bool)
    valid[10:12, 20:23] = True
    valid[50, 50] = True  # belongs to no triangle
    colours = np.random.default_rng(1).integers(0, 256, (SIZE, SIZE, 3), np.uint8)
    mesh = mesh_from_surface(surface_of(camera, wavy(camera), jnp.asarray(valid)), colours)
    assert len(mesh.faces) == 4
    assert len(mesh.vertices) == 6
    np.testing.assert_array_equal(mesh.visual.vertex_colors[:, :3], colours[10:12, 20:23].reshape(-1, 3))


def test_three_valid_corners_make_one_triangle():
    camera = CAMERAS["orthographic"]
    for missing in np.ndindex(2, 2):
        valid = np.zeros((SIZE, SIZE), bool)
        valid[5:7, 5:7] = True
        valid[5 + missing[0], 5 + missing[1]] = False
        mesh = mesh_from_surface(surface_of(camera, wavy(camera), jnp.asarray(valid)))
        assert len(mesh.faces) == 1
        assert mesh.face_normals[0, 2] < 0


@pytest.mark.parametrize("name", ["spherical", "perspective", "equidistant"])
def test_no_triangle_spans_an_occlusion(name):
    camera = CAMERAS[name]
    distance, on_ball = ball_before_wall(camera)
    surface = surface_of(camera, distance)
    mesh = mesh_from_surface(surface)
    vertex_on_ball = np.linalg.norm(mesh.vertices - [0.1, 0, 1.2], axis=-1) < 0.501
    assert vertex_on_ball.any()
    assert not vertex_on_ball.all()
    of_face = vertex_on_ball[mesh.faces]
    assert (of_face.all(axis=1) | ~of_face.any(axis=1)).all()
    # Little else is lost: at most the squares that touch the limb.
    on_ball = on_ball & np.asarray(surface.valid)
    squares = [on_ball[:-1, :-1], on_ball[1:, :-1], on_ball[:-1, 1:], on_ball[1:, 1:]]
    limb = np.logical_or.reduce(squares) & ~np.logical_and.reduce(squares)
    whole = mesh_from_surface(surface_of(camera, wavy(camera), surface.valid))
    assert len(whole.faces) - len(mesh.faces) <= 2 * limb.sum()


def test_a_step_between_parallel_planes_is_cut_also_for_parallel_rays():
    camera = CAMERAS["orthographic"]
    left = jnp.arange(SIZE)[None, :] < 40
    mesh = mesh_from_surface(surface_of(camera, jnp.where(left, 1.0, 1.2) * jnp.ones((SIZE, SIZE))))
    assert len(mesh.faces) == 2 * (SIZE - 1) * (SIZE - 2)
    assert len(mesh.split(only_watertight=False)) == 2


def test_a_steep_slope_is_not_cut():
    camera = CAMERAS["orthographic"]
    slope = 20 + np.tan(np.deg2rad(80)) * (np.arange(SIZE) - 48) / 40
    mesh = mesh_from_surface(surface_of(camera, jnp.asarray(np.broadcast_to(slope, (SIZE, SIZE)))))
    assert len(mesh.faces) == 2 * (SIZE - 1) ** 2


def test_triangles_that_touch_the_cut_are_left_out():
    camera = CAMERAS["perspective"]
    cut = np.zeros((SIZE, SIZE), bool)
    cut[:, 30] = True
    mesh = mesh_from_surface(surface_of(camera, wavy(camera)), cut=cut)
    assert len(mesh.faces) == 2 * (SIZE - 1) * (SIZE - 3)


@pytest.mark.parametrize("shape", [(1, 1), (1, 9), (2, 2)])
def test_too_few_pixels_give_an_empty_mesh(shape):
    height, width = shape
    camera = Perspective(50.0, 50.0, 0.0, 0.0, width, height)
    valid = np.zeros(shape, bool)
    valid[0] = True
    mesh = mesh_from_surface(surface_of(camera, jnp.ones(shape), jnp.asarray(valid)))
    assert mesh.faces.shape == (0, 3)
    assert len(mesh.vertices) == 0


def test_bad_input_says_what_was_expected():
    surface = surface_of(CAMERAS["perspective"], wavy(CAMERAS["perspective"]))
    with pytest.raises(ValueError, match=r"colours must be \(97, 97\) pixels like the surface, got \(5, 97\)"):
        mesh_from_surface(surface, np.zeros((5, 97, 3), np.uint8))
    with pytest.raises(ValueError, match="between 0 and 90 degrees, got 95"):
        mesh_from_surface(surface, max_grazing_deg=95)
