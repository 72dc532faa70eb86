"""The published definitions on numbers worked out by hand, and what must not change them."""

import json
import math

import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from hypothesis.extra import numpy as hnp

from jaxsfs.camera import Orthographic, Perspective, Spherical
from jaxsfs.evaluation import convert_quantity, evaluate

TRUTH = np.array([[1.0, 2.0], [4.0, 10.0]])
PREDICTED = np.array([[1.1, 1.8], [4.0, 13.0]])
maps = hnp.arrays(np.float64, (5, 7), elements=st.floats(0.1, 100.0))


def plane(camera: Perspective, tilt_deg: float) -> np.ndarray:
    """Depth of the plane through (0, 0, 10) that is turned by `tilt_deg` about the vertical axis."""
    x = (np.arange(camera.width) - camera.cx) / camera.fx
    return np.broadcast_to(10 / (1 - np.tan(np.deg2rad(tilt_deg)) * x), (camera.height, camera.width))


def test_measures_of_four_pixels_worked_out_by_hand():
    e = evaluate(PREDICTED, TRUTH, align="none")
    assert e.abs_rel == pytest.approx((0.1 + 0.1 + 0 + 0.3) / 4)
    assert e.sq_rel == pytest.approx((0.01 / 1 + 0.04 / 2 + 0 + 9 / 10) / 4)
    assert e.rmse == pytest.approx(math.sqrt((0.01 + 0.04 + 0 + 9) / 4))
    logs = [math.log(1.1), math.log(0.9), 0, math.log(1.3)]
    assert e.rmse_log == pytest.approx(math.sqrt(sum(x * x for x in logs) / 4))
    # max(d/p, p/d) is 1.1, 1.111, 1, 1.3; 1.1 < 1.10 is left to rounding, so the shares are read around it.
    assert (e.delta_1_05, e.delta_1_25) == (0.25, 0.75)
    assert e.median_rel == pytest.approx(0.1)
    assert e.p95_rel == pytest.approx(0.1 + 0.85 * 0.2)
    assert (e.pixels, e.fraction, e.scale, e.align, e.quantity) == (4, 1.0, 1.0, "none", "range")
    assert e.normals is None


def test_median_alignment_is_a_ratio_of_medians():
    e = evaluate(PREDICTED, TRUTH)
    assert e.align == "median"
    assert e.scale == pytest.approx(3.0 / 2.9)
    assert e.abs_rel == pytest.approx(evaluate(PREDICTED * 3.0 / 2.9, TRUTH, align="none").abs_rel)


def test_identical_input_has_no_error():
    camera = Perspective(50.0, 50.0, 15.5, 11.5, 32, 24)
    depth = plane(camera, 30.0)
    e = evaluate(depth, depth, camera=camera, quantity="depth")
    zeros = (e.abs_rel, e.sq_rel, e.rmse, e.rmse_log, e.median_rel, e.p95_rel)
    assert zeros == (0,) * 6
    assert (e.delta_1_05, e.delta_1_10, e.delta_1_25, e.scale) == (1, 1, 1, 1)
    assert e.normals is not None
    assert e.normals.mean_deg < 1e-6
    assert e.normals.share_below_11_25_deg == 1
    assert e.normals.pixels == 32 * 24


@settings(max_examples=50, deadline=None)
@given(maps, maps, st.floats(1e-3, 1e3))
def test_median_aligned_measures_do_not_see_the_prediction_s_scale(predicted, truth, factor):
    a, b = evaluate(predicted, truth).as_dict(), evaluate(factor * predicted, truth).as_dict()
    assert b["scale"] == pytest.approx(a["scale"] / factor)
    # A share may differ by pixels whose ratio equals its limit to rounding.
    for name in ("abs_rel", "sq_rel", "rmse", "rmse_log", "median_rel", "p95_rel"):
        assert b[name] == pytest.approx(a[name], rel=1e-9, abs=1e-12)


@settings(max_examples=25, deadline=None)
@given(maps, maps, st.floats(1e-2, 1e2))
def test_only_measures_with_a_unit_change_with_the_unit(predicted, truth, factor):
    a = evaluate(predicted, truth, align="none")
    b = evaluate(factor * predicted, factor * truth, align="none")
    assert b.abs_rel == pytest.approx(a.abs_rel)
    assert b.rmse_log == pytest.approx(a.rmse_log)
    assert b.rmse == pytest.approx(factor * a.rmse)
    assert b.sq_rel == pytest.approx(factor * a.sq_rel)


def test_pixels_without_data_are_neither_compared_nor_counted():
    predicted = np.array([[1.0, np.nan, 3.0, 5.0], [0.0, 2.0, np.inf, 7.0]])
    truth = np.array([[1.0, 2.0, 0.0, 5.0], [1.0, 2.0, 4.0, np.nan]])
    valid = np.array([[True, True, True, False], [True, True, True, True]])
    e = evaluate(predicted, truth, valid=valid, align="none")
    assert e.pixels == 2
    assert e.fraction == pytest.approx(2 / 5)  # true pixels inside the mask: 1, 2 | 1, 2, 4
    assert e.abs_rel == 0


def test_range_and_depth_convert_into_each_other():
    camera = Spherical(20.0, 7.5, 5.5, 16, 12)
    distance = np.full((12, 16), 3.0)
    depth = convert_quantity(distance, "range", "depth", camera)
    np.testing.assert_allclose(depth, 3.0 * np.asarray(camera.rays()[..., 2]))
    np.testing.assert_allclose(convert_quantity(depth, "depth", "range", camera), distance)
    e = evaluate(distance, depth, truth_quantity="depth", camera=camera, align="none")
    assert e.quantity == "range"
    assert e.abs_rel < 1e-12
    e = evaluate(distance, depth, predicted_quantity="range", quantity="depth", camera=camera, align="none")
    assert e.rmse < 1e-12


def test_depth_does_not_exist_where_the_camera_has_no_ray():
    camera = Spherical(5.0, 7.5, 5.5, 16, 12)
    depth = convert_quantity(np.ones((12, 16)), "range", "depth", camera)
    np.testing.assert_array_equal(np.isfinite(depth), np.asarray(camera.field()))


@pytest.mark.parametrize("tilt_deg", [5.0, 20.0])
def test_normal_angle_of_a_turned_plane(tilt_deg):
    camera = Perspective(60.0, 60.0, 15.5, 11.5, 32, 24)
    e = evaluate(plane(camera, tilt_deg), plane(camera, 0.0), camera=camera, quantity="depth")
    assert e.normals is not None
    assert e.normals.mean_deg == pytest.approx(tilt_deg, abs=0.05)
    assert e.normals.median_deg == pytest.approx(tilt_deg, abs=0.05)
    assert e.normals.share_below_11_25_deg == (1.0 if tilt_deg < 11.25 else 0.0)
    assert e.normals.share_below_22_5_deg == 1.0


def test_given_normals_take_the_place_of_differenced_ones():
    camera = Perspective(60.0, 60.0, 15.5, 11.5, 32, 24)
    normals = np.broadcast_to([0.0, 0.0, -2.0], (24, 32, 3)).copy()
    normals[:4] = np.nan
    e = evaluate(plane(camera, 12.0), plane(camera, 40.0), camera=camera, quantity="depth", truth_normals=normals)
    assert e.normals is not None
    assert e.normals.mean_deg == pytest.approx(12.0, abs=0.05)
    assert e.normals.pixels == 20 * 32


def test_normals_of_an_orthographic_camera_see_the_scale():
    camera = Orthographic(10.0, 15.5, 11.5, 32, 24)
    truth = 5 + np.broadcast_to((np.arange(32) - 15.5) / 10, (24, 32))
    e = evaluate(truth / 3, truth, camera=camera)
    assert e.normals is not None
    assert e.normals.mean_deg < 1e-5
    assert evaluate(truth / 3, truth, camera=camera, align="none").normals.mean_deg > 20


def test_the_dictionary_is_json_and_states_quantity_and_alignment():
    camera = Perspective(60.0, 60.0, 15.5, 11.5, 32, 24)
    record = evaluate(plane(camera, 12.0), plane(camera, 0.0), camera=camera, quantity="depth").as_dict()
    again = json.loads(json.dumps(record))
    assert (again["quantity"], again["align"]) == ("depth", "median")
    assert again["normals"]["pixels"] == 32 * 24
    assert evaluate(PREDICTED, TRUTH).as_dict()["normals"] is None


def test_jax_arrays_and_whole_numbers_are_taken():
    e = evaluate(jnp.asarray(PREDICTED), np.array([[1, 2], [4, 10]]), align="none")
    assert e.abs_rel == pytest.approx(0.125)


def test_bad_input_says_what_was_expected():
    camera = Perspective(60.0, 60.0, 15.5, 11.5, 32, 24)
    with pytest.raises(ValueError, match=r"one size, got \(2, 2\) and \(3, 2\)"):
        evaluate(PREDICTED, np.ones((3, 2)))
    with pytest.raises(ValueError, match="no pixel in common: 0 predicted pixels and 4 true ones"):
        evaluate(np.full((2, 2), np.nan), TRUTH)
    with pytest.raises(ValueError, match=r"must be \(2, 2\) like the arrays, got \(2, 3\)"):
        evaluate(PREDICTED, TRUTH, valid=np.ones((2, 3), bool))
    with pytest.raises(ValueError, match="a camera is needed"):
        evaluate(PREDICTED, TRUTH, truth_quantity="depth")
    with pytest.raises(ValueError, match="32 x 24 px, the arrays are 2 x 2 px"):
        evaluate(PREDICTED, TRUTH, camera=camera)
    with pytest.raises(ValueError, match="without a camera"):
        evaluate(PREDICTED, TRUTH, truth_normals=np.ones((2, 2, 3)))
    with pytest.raises(ValueError, match=r"true normals must be \(24, 32, 3\)"):
        evaluate(np.ones((24, 32)), np.ones((24, 32)), camera=camera, truth_normals=np.ones((24, 32)))
