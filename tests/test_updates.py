"""The order of updates changes the time, not the answer."""

import jax.numpy as jnp
import numpy as np
import pytest
from analytic import as_image, scene

from jaxsfs.reflectance import Lambertian, OrenNayar
from jaxsfs.shading import light_at_camera
from jaxsfs.sweeping import sweep
from jaxsfs.updates import ROUNDS

HEIGHT, WIDTH = 33, 29
OTHERS = [name for name in ROUNDS if name != "rows"]


def solved(updates: str, order: int, name: str = "ball", form=None, **more):
    """A surface in a picture that is not square, with a corner missing and a bar that fronts must go round."""
    form = Lambertian() if form is None else form
    camera, distance, cosine, mask = scene(name, HEIGHT, 50.0)
    mask = mask & ~((np.arange(HEIGHT) < 7)[:, None] & (np.arange(HEIGHT) < 9))
    mask[12, 8:22] = False
    cut = np.s_[:, :WIDTH]
    values = np.asarray(form(jnp.asarray(cosine))) / distance**2
    image, inside = as_image(values, mask, jnp.float64)[cut], jnp.asarray(mask[cut])
    shading = light_at_camera(image, inside, 1.0, form)
    known = jnp.full(image.shape, jnp.inf)
    metric = camera.inverse_metrics(image.dtype)[cut]
    return sweep(shading, metric, inside, known, order=order, updates=updates, tolerance=1e-12, **more)


def difference(one, other) -> np.ndarray:
    assert np.array_equal(one.reached, other.reached)
    return np.abs(np.asarray(one.w - other.w))[np.asarray(one.reached)]


@pytest.mark.parametrize("updates", OTHERS)
@pytest.mark.parametrize("name", ["ball", "waves"])
def test_first_order_is_the_same(updates, name):
    assert difference(solved(updates, 1, name), solved("rows", 1, name)).max() < 1e-9


@pytest.mark.parametrize("updates", OTHERS)
@pytest.mark.parametrize("order", [2, 3])
def test_higher_orders_are_the_same_off_kinks(updates, order):
    """At a kink either side may own a pixel, and the pixel may differ by the error of its scheme."""
    gaps = difference(solved(updates, order), solved("rows", order))
    assert np.median(gaps) < 1e-9
    assert gaps.mean() < 1e-4


@pytest.mark.parametrize("updates", OTHERS)
def test_a_reflectance_that_makes_no_quadratic(updates):
    form = OrenNayar(0.3)
    assert difference(solved(updates, 1, form=form), solved("rows", 1, form=form)).max() < 1e-9


def test_a_corner_at_a_time_takes_no_more_rounds():
    assert int(solved("diagonals", 1).rounds) <= int(solved("rows", 1).rounds) + 1
