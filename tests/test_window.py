"""Computing in a window changes nothing but the time."""

import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from jaxsfs import Irradiance, Spherical, reconstruct
from jaxsfs.implicit import solve
from jaxsfs.rim import limited_at_rim
from jaxsfs.shading import light_at_camera
from jaxsfs.window import bucketed, window_of


@given(st.integers(1, 5000))
def test_sizes_are_at_most_a_sixteenth_too_large(size):
    assert size <= bucketed(size) <= size + max(0, size / 16)
    assert bucketed(bucketed(size)) == bucketed(size)


def test_an_octave_has_sixteen_sizes():
    assert len({bucketed(size) for size in range(513, 1025)}) == 16


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 30), st.integers(0, 30), st.integers(1, 20), st.integers(1, 20))
def test_paste_undoes_cut(top, left, rows, columns):
    usable = np.zeros((40, 37), bool)
    usable[top : top + rows, left : left + columns] = True
    window = window_of(usable)
    assert window is not None
    image = np.random.default_rng(0).normal(size=usable.shape)
    there = np.where(usable, image, 7.0)
    assert window.paste(window.cut(jnp.asarray(usable), False), usable.shape, False).sum() == usable.sum()
    np.testing.assert_array_equal(
        np.where(usable, window.paste(window.cut(jnp.asarray(image), 0), usable.shape, 7), 7), there
    )


def test_nothing_usable_and_everything_usable_have_no_window():
    assert window_of(np.zeros((9, 9), bool)) is None
    assert window_of(np.ones((96, 64), bool)) is None


@pytest.fixture(scope="module")
def picture():
    """A tilted plane in a small round field of a large picture."""
    camera = Spherical(f=40.0, cx=48.0, cy=30.0, width=128, height=96)
    rays = camera.rays()
    inside = camera.field() & (rays[..., 2] > np.cos(np.deg2rad(30)))
    distance = jnp.where(inside, 1 / (rays[..., 2] + 0.3 * rays[..., 0]), 1)
    cosine = (rays[..., 2] + 0.3 * rays[..., 0]) / np.sqrt(1.09)
    return Irradiance(jnp.where(inside, cosine / distance**2, 0), inside), camera, distance


def test_the_surface_lies_where_it_would_without(picture):
    image, camera, distance = picture
    found = reconstruct(image, camera)
    assert found.surface.range.shape == image.values.shape
    assert bool(jnp.all(found.surface.valid == image.valid))
    error = np.asarray(jnp.abs(found.surface.range / distance - 1))[np.asarray(image.valid)]
    assert error.mean() < 2e-3
    whole = reconstruct(image, camera, occlusions=jnp.zeros_like(image.valid))  # a given mask: no window
    np.testing.assert_allclose(found.surface.range[image.valid], whole.surface.range[image.valid], rtol=1e-6)
    assert found.statistics.valid_pixels == int(image.valid.sum())


def test_a_picture_of_nearly_the_same_size_compiles_the_solver_no_more(picture):
    image, camera, _ = picture
    reconstruct(image, camera)
    before = solve._cache_size(), limited_at_rim._cache_size(), light_at_camera._cache_size()
    larger = Irradiance(jnp.pad(image.values, ((0, 5), (2, 0))), jnp.pad(image.valid, ((0, 5), (2, 0))))
    found = reconstruct(larger, camera.cropped(-2, 0, 130, 101))
    assert (solve._cache_size(), limited_at_rim._cache_size(), light_at_camera._cache_size()) == before
    assert found.surface.range.shape == (101, 130)
