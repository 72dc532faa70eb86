"""The rim of the picture: what is assumed where the nearest wall is cut off."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from analytic import SURFACES, as_image, disc, disc_camera, rays

from jaxsfs import Irradiance, OrenNayar, Power, reconstruct
from jaxsfs.rim import find_rim, limited_at_rim
from jaxsfs.shading import light_at_camera

SIZE = 129


def tube(half_field_deg: float, size: int = SIZE, exponent: float = 1.0, sideways: float = 0.0):
    """Inside of a cylinder of radius 1 about the direction (sin t, 0, cos t): r = 1/sin α, cos θ = sin α; the field
    leaves out what is near its axis."""
    camera = disc_camera(size, half_field_deg)
    axis = np.array([np.sin(sideways), 0, np.cos(sideways)])
    d = rays(camera)
    sine = np.sqrt(np.maximum(1 - (d @ axis) ** 2, 1e-9))
    inside = disc(size) & (sine > 0.35)
    return camera, 1 / sine, as_image(sine**exponent * sine**2, inside), inside


def mean_error(result, truth, inside) -> float:
    return float(np.mean(np.abs(np.asarray(result.surface.range) / truth - 1)[inside]))


@pytest.mark.parametrize("half_field", [50.0, 60.0])
@pytest.mark.parametrize("sideways", [0.0, 0.15])
def test_straight_tube(half_field, sideways):
    camera, truth, values, inside = tube(half_field, sideways=sideways)
    image = Irradiance(values, jnp.asarray(inside))
    closed, straight = (
        mean_error(reconstruct(image, camera, rim=rim), truth, inside) for rim in ("closed", "straight")
    )
    assert straight < 0.02 < closed
    assert straight < 0.7 * closed


@pytest.mark.parametrize("reflectance", [Power(0.65), OrenNayar(0.3)], ids=["power", "oren-nayar"])
def test_other_reflectances(reflectance):
    camera, truth, _, inside = tube(60.0)
    sine = 1 / truth
    image = Irradiance(as_image(np.asarray(reflectance(jnp.asarray(sine))) * sine**2, inside), jnp.asarray(inside))
    errors = [
        mean_error(reconstruct(image, camera, reflectance=reflectance, rim=rim), truth, inside)
        for rim in ("closed", "straight")
    ]
    assert errors[1] < 0.75 * errors[0]


@pytest.mark.parametrize("name", sorted(SURFACES))
def test_rim_that_range_grows_towards_is_left_alone(name):
    camera, mask = disc_camera(SIZE), disc(SIZE)
    truth, cosine = SURFACES[name](rays(camera))
    image = Irradiance(as_image(cosine / truth**2, mask), jnp.asarray(mask))
    closed, straight = (reconstruct(image, camera, rim=rim) for rim in ("closed", "straight"))
    assert mean_error(straight, truth, mask) <= 1.01 * mean_error(closed, truth, mask)


def test_holes_are_no_rim():
    mask = disc(65)
    holed = mask.copy()
    holed[20:30, 20:30] = False
    rim = np.asarray(find_rim(holed, holed).pixels)
    assert not rim[15:35, 15:35].any()
    np.testing.assert_array_equal(rim, np.asarray(find_rim(mask, mask).pixels))
    assert rim.sum() > 150


def test_rim_beside_a_contour_is_left_alone():
    mask = disc(65)
    cut = mask.copy()
    cut[30:33] = False
    rim = np.asarray(find_rim(mask, cut).pixels)
    assert not rim[28:35].any()
    assert rim[10:20].any()


@pytest.mark.parametrize("size", [1, 2, 7, 9, 12])
def test_small_masks(size):
    mask = np.ones((size, size), bool)
    shading = light_at_camera(jnp.ones((size, size)), jnp.asarray(mask), 1.0, Power(1.0))
    metric = jnp.broadcast_to(jnp.eye(2), (size, size, 2, 2))
    limited = limited_at_rim(shading, metric, find_rim(mask, mask))
    assert bool(jnp.all(limited.deadline() <= shading.deadline()))
    assert bool(jnp.all(jnp.isfinite(limited.deadline())))


def test_slope_of_the_brightness_decides():
    """Flat metric, bound = b·u: tan θ = 2b/3, capped at 45°; range grows to the right, so only the left rim moves."""
    size, slope = 33, 0.6
    bound = slope * jnp.broadcast_to(jnp.arange(size, dtype=float), (size, size))
    shading = light_at_camera(jnp.exp(-2 * bound), jnp.ones((size, size), bool), 1.0, Power(1.0))
    mask = np.ones((size, size), bool)
    metric = jnp.broadcast_to(jnp.eye(2), (size, size, 2, 2))
    moved = np.asarray(shading.deadline() - limited_at_rim(shading, metric, find_rim(mask, mask)).deadline())
    expected = 0.25 * np.log(1 + (2 * slope / 3) ** 2)
    np.testing.assert_allclose(moved[8:-8, 0], expected, rtol=1e-9)
    assert not moved[8:-8, 1:].any()
    steep = light_at_camera(jnp.exp(-20 * bound), jnp.ones((size, size), bool), 1.0, Power(1.0))
    moved = np.asarray(steep.deadline() - limited_at_rim(steep, metric, find_rim(mask, mask)).deadline())
    np.testing.assert_allclose(moved[8:-8, 0], -0.5 * np.log(0.7), rtol=1e-9)


def test_range_at_the_rim_can_be_differentiated():
    camera, _, values, inside = tube(50.0, 49)

    def total(gain):
        image = Irradiance(jnp.asarray(values) * gain ** jnp.linspace(0.0, 1.0, 49)[None], jnp.asarray(inside))
        return jnp.sum(jnp.where(inside, jnp.log(reconstruct(image, camera, occlusions="off").surface.range), 0))

    step = 1e-4
    numeric = (total(1.0 + step) - total(1.0 - step)) / (2 * step)
    np.testing.assert_allclose(jax.grad(total)(1.0), numeric, rtol=2e-3)
