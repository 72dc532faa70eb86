"""Axioms that every camera obeys, and published values."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from jaxsfs.camera import (
    AbstractCamera,
    Equidistant,
    Equisolid,
    KannalaBrandt,
    Orthographic,
    Perspective,
    Scaramuzza,
    Spherical,
    Stereographic,
    camera_from_dict,
    camera_to_dict,
    perspective_like,
    rectification_map,
)

CENTRE = (318.5, 241.25, 640, 480)
C3VD_A = (769.243600037458, 0.0, -0.000812770624150226, 6.25674244578925e-07, -1.19662182144280e-09)
C3VD_CENTRE = (678.544839263292, 542.975887548343, 1350, 1080)
CENTRAL = {
    "spherical": Spherical(460.0, *CENTRE),
    "spherical-k": Spherical(440.0, *CENTRE, 1.02, 0.035),
    "perspective": Perspective(400.0, 410.0, *CENTRE),
    "equidistant": Equidistant(260.0, *CENTRE, 0.97),
    "equisolid": Equisolid(290.0, *CENTRE, 0.98),
    "stereographic": Stereographic(250.0, *CENTRE),
    "kannala-brandt": KannalaBrandt(300.0, 301.0, *CENTRE, (-0.1389, -0.00124, 0.000913, -4.07e-05)),
    "scaramuzza": Scaramuzza(C3VD_A, *C3VD_CENTRE, 0.99998688, 0.00288274, -0.00296317),
}
ALL = CENTRAL | {"orthographic": Orthographic(55.0, *CENTRE, 1.01)}
# compiled once for each camera class and image size
point_at = jax.jit(lambda camera, pixel, distance: camera.point(pixel, distance))
rays_at = jax.jit(lambda camera, pixels: jax.vmap(camera.ray)(pixels))
valid_at = jax.jit(lambda camera, pixels: jax.vmap(camera.is_valid)(pixels))
metrics_at = jax.jit(lambda camera, pixels: jax.vmap(camera.inverse_metric)(pixels))
project_all = jax.jit(lambda camera, points: jax.vmap(camera.project)(points))
pixel_in_cut = st.tuples(st.floats(60, 580), st.floats(40, 440))


def sample(camera: AbstractCamera):
    """Pixels of a coarse grid that have a ray, the principal point among them."""
    grid = camera.pixels()[::37, ::41].reshape(-1, 2)
    pixels = jnp.concatenate([grid, jnp.array([[camera.cx, camera.cy]])])
    return pixels[np.asarray(valid_at(camera, pixels))]


@pytest.mark.parametrize("name", ALL)
def test_project_inverts_ray(name):
    camera, pixels = ALL[name], sample(ALL[name])
    points = jax.vmap(camera.point)(pixels, jnp.full(len(pixels), 7.0))
    assert jnp.abs(project_all(camera, points) - pixels).max() < 1e-6
    assert jax.vmap(camera.sees)(points).all()


@pytest.mark.parametrize("name", CENTRAL)
def test_rays_have_unit_length_and_inverse_metric_inverts_their_metric(name):
    camera, pixels = CENTRAL[name], sample(CENTRAL[name])
    rays = rays_at(camera, pixels)
    np.testing.assert_allclose(jnp.linalg.norm(rays, axis=-1), 1, atol=1e-12)
    jacobian = jax.vmap(jax.jacfwd(camera.ray))(pixels)
    metric = jnp.einsum("nki,nkj->nij", jacobian, jacobian)
    product = metrics_at(camera, pixels) @ metric
    np.testing.assert_allclose(product, jnp.broadcast_to(jnp.eye(2), product.shape), atol=2e-6)


@pytest.mark.parametrize("name", ["spherical", "spherical-k", "perspective"])
def test_closed_form_metric_agrees_with_jacfwd(name):
    camera, pixels = CENTRAL[name], sample(CENTRAL[name])
    closed = metrics_at(camera, pixels)
    general = jax.vmap(super(type(camera), camera).inverse_metric)(pixels)
    np.testing.assert_allclose(closed, general, rtol=1e-7, atol=1e-6 * float(jnp.abs(general).max()))


def test_metric_of_the_spherical_camera_is_section_5():
    """Eqs. (16)-(18) put into the last equation of Section 5, with z_pi = 1, against g^{ij}."""
    f = 460.0
    camera = Spherical(f, *CENTRE)
    pixels = sample(camera)
    covector = jnp.array([0.7, -0.3])

    def section_5(pixel):
        u, v = pixel[0] - camera.cx, pixel[1] - camera.cy
        z = jnp.sqrt(f**2 - u**2 - v**2)
        x, y = u / z, v / z  # eq. (14)
        n2 = 1 + x**2 + y**2
        ux = f / jnp.sqrt(n2) - x**2 * f * n2**-1.5  # eqs. (18)
        uy = -x * y * f * n2**-1.5
        vy = f / jnp.sqrt(n2) - y**2 * f * n2**-1.5
        px, py = ux * covector[0] + uy * covector[1], uy * covector[0] + vy * covector[1]  # eqs. (17)
        return n2 * ((x**2 + 1) * px**2 + 2 * x * y * px * py + (y**2 + 1) * py**2)

    ours = jax.vmap(lambda p: covector @ camera.inverse_metric(p) @ covector)(pixels)
    np.testing.assert_allclose(jax.vmap(section_5)(pixels), ours, rtol=2e-12)


def test_c3vd_olympus_is_a_sine_to_two_pixels():
    """The published polynomial against r = f sin α, sampled evenly in radius to 600 px (design §7)."""
    camera = Scaramuzza(C3VD_A, *C3VD_CENTRE)
    radius = jnp.linspace(1, 600, 600)
    pixels = jnp.stack([camera.cx + radius, jnp.full_like(radius, camera.cy)], axis=-1)
    sine = jnp.hypot(*rays_at(camera, pixels)[:, :2].T)
    rms = jnp.sqrt(jnp.mean((radius - 759.3 * sine) ** 2))
    assert 1.75 < rms < 1.9


def test_kannala_brandt_is_opencv_fisheye():
    import cv2

    camera = CENTRAL["kannala-brandt"]
    points = 3 * jax.vmap(camera.ray)(sample(camera))
    points = np.asarray(points[points[:, 2] > 0.05])  # OpenCV projects what lies in front
    matrix = np.array([[camera.fx, 0, camera.cx], [0, camera.fy, camera.cy], [0, 0, 1]])
    theirs, _ = cv2.fisheye.projectPoints(points[:, None], np.zeros(3), np.zeros(3), matrix, np.array(camera.k))
    np.testing.assert_allclose(jax.vmap(camera.project)(jnp.asarray(points)), theirs[:, 0], atol=1e-9)


@pytest.mark.parametrize("name", CENTRAL)
def test_pixels_outside_the_model_are_invalid_and_finite(name):
    camera = CENTRAL[name]
    far = jnp.array([[-9000.0, 7.0], [5e4, 5e4], [camera.cx, -2e4]])
    rays, slopes = jax.vmap(camera.ray)(far), jax.vmap(jax.jacfwd(camera.ray))(far)
    assert jnp.isfinite(rays).all()
    assert jnp.isfinite(slopes).all()
    if name not in ("perspective", "stereographic"):
        assert not jax.vmap(camera.is_valid)(far).any()


def test_sees_only_what_lies_in_front():
    assert not CENTRAL["perspective"].sees(jnp.array([0.1, 0.2, -1.0]))
    assert not CENTRAL["spherical"].sees(jnp.array([0.1, 0.2, -1.0]))
    assert CENTRAL["stereographic"].sees(jnp.array([1.0, 0.2, -0.5]))


@pytest.mark.parametrize("name", ALL)
@settings(max_examples=5, deadline=None)
@given(pixel=pixel_in_cut, size=st.sampled_from([(320, 240), (701, 333)]))
def test_resizing_and_cropping_keep_the_rays(name, pixel, size):
    camera = ALL[name]
    before = jnp.array(pixel)
    scale = jnp.array([size[0] / camera.width, size[1] / camera.height])
    resized = camera.resized(*size)
    at = jnp.array([1.3])[0]
    expected = point_at(camera, before, at)
    np.testing.assert_allclose(point_at(resized, (before + 0.5) * scale - 0.5, at), expected, atol=1e-7)
    cut = camera.cropped(30, 20, 560, 430)
    np.testing.assert_allclose(point_at(cut, before - jnp.array([30.0, 20.0]), at), expected, atol=1e-9)
    assert (cut.width, cut.height) == (560, 430)


@pytest.mark.parametrize("name", ALL)
def test_camera_files_round_trip(name):
    description = camera_to_dict(ALL[name]) | {"scope": "borrowed", "photometry": {"response": "gamma:2.2"}}
    file = camera_from_dict(description)
    assert file.other == {"scope": "borrowed"}
    assert camera_to_dict(file) == description


def test_pixel_origin_is_shifted_to_zero():
    description = camera_to_dict(CENTRAL["spherical"]) | {"pixel_origin": 0.5}
    assert camera_from_dict(description).camera.cx == CENTRE[0] - 0.5


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"model": "pinhole"}, "must be one of: spherical, perspective"),
        ({"f": None}, "'f' must be a finite number"),
        ({"f": -3.0}, "'f' must be positive"),
        ({"width": 2.5}, "'width' must be a whole number"),
        ({"photometry": "srgb"}, "'photometry' must be an object"),
    ],
)
def test_bad_camera_files_are_named(change, message):
    with pytest.raises(ValueError, match=message):
        camera_from_dict(camera_to_dict(CENTRAL["spherical"]) | change)


def test_missing_key_is_named():
    description = camera_to_dict(CENTRAL["spherical"])
    del description["cy"]
    with pytest.raises(ValueError, match="missing: 'cy'"):
        camera_from_dict(description)


def test_derivatives_reach_the_parameters():
    """∂ray/∂f by autodiff against differences: roots carry implicit derivatives."""
    pixel = jnp.array([500.0, 130.0])

    def height(f, k):
        return Spherical(f, *CENTRE, 1.0, k).ray(pixel)[2]

    for argument in (0, 1):
        args, step = [460.0, 0.035], [1e-3, 1e-6][argument]
        high, low = list(args), list(args)
        high[argument] += step
        low[argument] -= step
        difference = (height(*high) - height(*low)) / (2 * step)
        np.testing.assert_allclose(jax.grad(height, argument)(*args), difference, rtol=1e-6)


def test_rectification_of_the_spherical_camera_is_equation_15():
    camera = CENTRAL["spherical"]
    target = perspective_like(camera, half_field_deg=30)
    z = target.fx
    x, y = 100.0, -60.0
    got = rectification_map(camera, target)[int(target.cy + y - 0.25), int(target.cx + x - 0.5)]
    x, y = int(target.cx + x - 0.5) - target.cx, int(target.cy + y - 0.25) - target.cy
    expected = camera.f * jnp.array([x, y]) / jnp.sqrt(z**2 + x**2 + y**2)
    np.testing.assert_allclose(got, expected + jnp.array([camera.cx, camera.cy]), atol=1e-9)
