"""The middle of a printed dot's image against the image of its middle."""

import numpy as np
import pytest

from jaxsfs.calibration._dot_bias import dot_bias, dot_radius
from jaxsfs.calibration._fit import Fit, Setup, plane_points
from jaxsfs.calibration._lens import images, lens_named, start_lens
from jaxsfs.calibration._plane import rotate
from jaxsfs.calibration._problem import Rows

VIEW = np.array([0.35, -0.2, 0.1, 1.0, -2.0, np.log(12.0)])
RADIUS = 1.2  # mm


@pytest.fixture(scope="module")
def known():
    """A fit that was never made: r = f sin α with f = 300 px, one tilted sheet."""
    none = np.zeros(0)
    rows = Rows(np.zeros((0, 2)), np.zeros((0, 2)), none, none, np.zeros(0, int))
    parameters = np.concatenate([start_lens(300.0, 320.0, 240.0), [0.0, 0.0], VIEW])
    free = np.ones(len(parameters), bool)
    setup = Setup("points", rows, (640, 480), 1, 1, free, parameters, np.ones(len(parameters)), np.zeros((0, 2)))
    square = np.zeros((len(parameters),) * 2)
    jacobian = np.zeros((0, 2, len(parameters)))
    return Fit("spherical", setup, parameters, np.zeros((0, 2)), none, 0.1, jacobian, square, 1.0, True)


def seen(fit, target):
    """Where points of the sheet (mm) are seen."""
    place = np.concatenate([target + VIEW[3:5], np.full((len(target), 1), np.exp(VIEW[5]))], axis=1)
    points = rotate(np.broadcast_to(VIEW[:3], place.shape), place)
    return images(lens_named(fit.name).build, fit.parameters[:8], points).pixel


def outline(fit, middle, radius=RADIUS, count=4000):
    """Area (px²) and centroid of a dot's image, from its outline by Green's theorem."""
    angle = 2 * np.pi * np.arange(count) / count
    x, y = (seen(fit, middle + radius * np.stack([np.cos(angle), np.sin(angle)], axis=1)) - seen(fit, middle[None])).T
    cross = x * np.roll(y, -1) - np.roll(x, -1) * y
    centroid = [np.sum((part + np.roll(part, -1)) * cross) / (3 * np.sum(cross)) for part in (x, y)]
    return abs(np.sum(cross)) / 2, np.array(centroid)


@pytest.mark.parametrize("middle", [(0.0, 0.0), (6.0, -3.0), (-7.0, 5.0)])
def test_bias_is_the_centroid_of_the_outline(known, middle):
    _, expected = outline(known, np.array(middle))
    pixel = seen(known, np.array([middle]))
    np.testing.assert_allclose(plane_points(known, pixel)[0], middle, atol=1e-9)
    bias = dot_bias(known, 0, pixel, RADIUS)[0]
    assert np.hypot(*expected) > 0.05  # there is something to correct
    np.testing.assert_allclose(bias, expected, atol=0.05 * np.hypot(*expected))


def test_radius_comes_back_from_the_images_areas(known):
    middles = np.array([[0.0, 0.0], [6.0, -3.0], [-7.0, 5.0], [4.0, 6.0], [-5.0, -5.0]])
    areas = np.array([outline(known, middle)[0] for middle in middles])
    assert dot_radius(known, 0, seen(known, middles), areas) == pytest.approx(RADIUS, rel=0.01)


def test_a_model_of_another_size_moves_the_bias_with_the_square(known):
    pixel = seen(known, np.array([[6.0, -3.0]]))
    small, large = (np.hypot(*dot_bias(known, 0, pixel, radius)[0]) for radius in (0.3, 0.6))
    assert large / small == pytest.approx(4.0, rel=0.05)
