"""Functions compiled by Numba give what their namesakes in JAX give."""

from concurrent.futures import ThreadPoolExecutor

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from analytic import as_image, scene

from jaxsfs import native
from jaxsfs.arrival import arrival_from_point, arrival_times
from jaxsfs.implicit import _causal, _numba, _rows
from jaxsfs.reflectance import Lambertian
from jaxsfs.shading import light_at_camera
from jaxsfs.sweeping import sweep

SHAPE = (37, 53)  # neither square nor a multiple of any vector's length


def fields(seed: int, *more: int) -> np.ndarray:
    return np.random.default_rng(seed).uniform(0.5, 1.5, (*more, *SHAPE))


@pytest.mark.parametrize("order", [1, 2])
def test_arrival_times(order):
    speed = jnp.asarray(fields(0)).at[5:9, 20].set(0.0)
    known = jnp.full(SHAPE, jnp.inf).at[10:13, 8:11].set(0.0)
    one, other = (arrival_times(speed, known, order=order, updates=by) for by in ("rows", "numba"))
    assert np.array_equal(one.reached, other.reached)
    assert not other.reached[5:9, 20].any()
    np.testing.assert_allclose(np.asarray(one.time)[one.reached], np.asarray(other.time)[one.reached], rtol=1e-9)


@pytest.mark.parametrize("order", [1, 2])
def test_arrival_from_a_point(order):
    speed = jnp.asarray(1 + np.linspace(0, 1, SHAPE[1])[None] + np.linspace(0, 0.5, SHAPE[0])[:, None])
    one, other = (arrival_from_point(speed, (31, 12), order=order, updates=by) for by in ("rows", "numba"))
    np.testing.assert_allclose(one.time, other.time, rtol=1e-9)


def test_single_precision():
    camera, distance, cosine, mask = scene("ball", 41, 50.0)
    image, inside = as_image(cosine / distance**2, mask, jnp.float32), jnp.asarray(mask)
    shading = light_at_camera(image, inside, jnp.float32(1), Lambertian())
    known = jnp.full(image.shape, jnp.inf, jnp.float32)
    metric = camera.inverse_metrics(image.dtype)
    one, other = (sweep(shading, metric, inside, known, order=2, updates=by) for by in ("rows", "numba"))
    assert other.w.dtype == jnp.float32
    np.testing.assert_allclose(one.w, other.w, atol=2e-5)


@pytest.mark.parametrize("axis", [0, 1])
def test_sweeps_of_the_linear_system_and_its_transpose(axis):
    turned = SHAPE if axis == 0 else SHAPE[::-1]
    rng = np.random.default_rng(axis)
    weights = jnp.asarray(rng.uniform(-0.1, 0.2, (6, *turned)))
    owner = jnp.asarray(rng.integers(-1, 3, turned), jnp.int8)
    x, b = (jnp.asarray(image) for image in fields(3, 2))
    np.testing.assert_allclose(
        _rows.both_pulls(x, b, weights, owner, axis), _numba.both_pulls(x, b, weights, owner, axis), rtol=1e-12
    )
    for one, other in zip(
        _rows.both_pushes(x, b, weights, owner, axis), _numba.both_pushes(x, b, weights, owner, axis), strict=True
    ):
        np.testing.assert_allclose(one, other, rtol=1e-12, atol=1e-12)


def test_several_images_at_once():
    speeds = jnp.asarray(fields(7, 3))
    known = jnp.full(SHAPE, jnp.inf).at[10, 10].set(0.0)
    from jaxsfs.arrival._solve import _solve

    def time(speed):
        settings = {"order": 1, "max_rounds": 40, "tolerance": 1e-9, "updates": "numba"}
        return _solve(speed, known, jnp.asarray(1.0), None, **settings).time

    np.testing.assert_allclose(jax.vmap(time)(speeds), [time(speed) for speed in speeds], rtol=1e-12)


def test_without_numba_jax_does_it(monkeypatch):
    monkeypatch.setattr(native, "is_available", lambda: False)
    assert native.preferred() == "rows"
    monkeypatch.undo()
    assert native.preferred() == "numba"
    assert _causal.preferred is native.preferred


def test_a_function_is_compiled_once_a_process():
    with ThreadPoolExecutor(4) as threads:
        names = set(threads.map(lambda _: native.target_for("pulls", np.dtype(np.float64)), range(8)))
    assert len(names) == 1
    assert native.target_for("pulls", np.dtype(np.float64)) != native.target_for("pulls", np.dtype(np.float32))
