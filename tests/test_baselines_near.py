"""The methods for a light at the lens, each on a picture that meets its assumptions."""

from pathlib import Path

import numpy as np
import pytest

from data_synth import Ball, Plane, default_camera, observe
from jaxsfs import Perspective, Power

FOLDER = Path(__file__).parents[1] / "experiments"
SIZE = 65
CENTRE = ((SIZE - 1) / 2, (SIZE - 1) / 2)


@pytest.fixture
def curve_expansion(monkeypatch):
    monkeypatch.syspath_prepend(FOLDER)
    from baselines import curve_expansion

    return curve_expansion


@pytest.fixture
def prados_faugeras(monkeypatch):
    monkeypatch.syspath_prepend(FOLDER)
    from baselines import prados_faugeras

    return prados_faugeras


def seen(scene, camera, **light):
    view = observe(scene, camera, half_field_deg=45, **light)
    parts = (view.irradiance.values, view.surface.valid, view.surface.range)
    return tuple(np.asarray(part) for part in parts)


def pinhole() -> Perspective:
    f = SIZE / 2 / np.tan(np.deg2rad(45))
    return Perspective(fx=f, fy=f, cx=CENTRE[0], cy=CENTRE[1], width=SIZE, height=SIZE)


def error(found, truth, mask) -> float:
    known = mask & np.isfinite(found)
    assert known.sum() > 0.98 * mask.sum()
    return float(np.abs(found / truth - 1)[known].mean())


@pytest.mark.parametrize("start", ["cone", "threshold"])
def test_the_paper_s_method_finds_a_ball_to_a_few_per_cent(curve_expansion, start):
    camera = default_camera(Ball(), SIZE, SIZE)
    e, mask, truth = seen(Ball(), camera)
    found = curve_expansion.spherical(e, mask, float(camera.f), CENTRE, getattr(curve_expansion, start)(e, mask))
    assert error(found, truth, mask) < 0.06


def test_its_gradient_is_that_of_the_spherical_camera(curve_expansion, monkeypatch):
    """√ of the last equation of Section 5 against √(g^{ij} φ_i φ_j) of the library, z_pi = 1."""
    camera = default_camera(Plane(), SIZE, SIZE, 60)
    inside = np.asarray(camera.field()) & (np.asarray(camera.rays())[..., 2] > 0.3)
    metric = np.asarray(camera.inverse_metrics())
    caught = {}
    monkeypatch.setattr(curve_expansion, "expand", lambda *a, **k: caught.setdefault("gradient", a[3]))
    curve_expansion.spherical(np.ones((SIZE, SIZE)), inside, float(camera.f), CENTRE, None)
    slope = np.array([0.3, -0.7])
    expected = np.sqrt(np.einsum("...ij,i,j", metric[inside], slope, slope))
    ours = caught["gradient"](slope[0] * np.ones((SIZE, SIZE)), slope[1] * np.ones((SIZE, SIZE)))
    np.testing.assert_allclose(ours[inside], expected, rtol=1e-6)


def test_eq_6_with_another_reflectance_is_better_than_taking_it_for_lambertian(curve_expansion):
    law = Power(2.0)
    e, mask, truth = seen(Ball(), pinhole(), reflectance=law)
    start = curve_expansion.cone(e, mask)
    focal = float(pinhole().fx)
    right = curve_expansion.perspective(e, mask, focal, CENTRE, start, inverse=np.sqrt)
    wrong = curve_expansion.perspective(e, mask, focal, CENTRE, start)
    assert error(right, truth, mask) < 0.5 * error(wrong, truth, mask)


def test_prados_and_faugeras_converge_with_first_order(prados_faugeras):
    e, mask, truth = seen(Ball(), pinhole())
    fine = error(prados_faugeras.reconstruct(e, mask, float(pinhole().fx), CENTRE), truth, mask)
    assert fine < 5e-3
    half = pinhole().resized(33, 33)
    e, mask, truth = (np.asarray(part) for part in seen(Ball(), half))
    coarse = error(prados_faugeras.reconstruct(e, mask, float(half.fx), (16.0, 16.0)), truth, mask)
    assert 1.5 < coarse / fine < 3
