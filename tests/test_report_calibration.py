"""The pictures on the pages of calibrations: where curves, dots and ticks stand."""

import re

import numpy as np
import pytest

from data_synth.target_patterns import Rings
from data_synth.targets import Studio, photograph
from jaxsfs.calibration import Calibration, calibrate_circles, observations, tilted
from jaxsfs.camera import Spherical
from jaxsfs.report import calibration_page
from jaxsfs.report._calibration_figures import detections, residual_against_angle
from jaxsfs.report._chart import Curve, chart
from jaxsfs.report._scale import Scale

RADII = (5.0, 10.0, 15.0, 20.0, 25.0)
ACROSS, UP = Scale(0.0, 10.0, "time / s"), Scale(-1.0, 1.0, "height & depth / mm")
LEFT, RIGHT, TOP, BOTTOM = 78.0, 868.0, 12.0, 312.0  # of the frame


def numbers(text: str) -> list[float]:
    return [float(word) for word in re.findall(r"-?\d+(?:\.\d+)?", text)]


def paths(page: str, kind: str) -> list[str]:
    return re.findall(rf'<path class="{kind}"[^>]* d="([^"]*)"', page)


def test_a_curve_runs_between_the_ends_of_the_scales():
    page = chart("a fall", [Curve(np.array([0.0, 5.0, 10.0]), np.array([1.0, 0.0, -1.0]), "ball")], ACROSS, UP)
    assert numbers(paths(page, "curve")[0]) == [LEFT, TOP, (LEFT + RIGHT) / 2, (TOP + BOTTOM) / 2, RIGHT, BOTTOM]
    assert "</i>ball</li>" in page
    assert 'aria-label="a fall"' in page


def test_axes_have_round_numbers_and_their_labels():
    page = chart("nothing", [], ACROSS, UP, level=0.5, upright=5.0)
    ticks = re.findall(r"<text [^>]*>([^<]*)</text>", page)
    assert ticks[:7] == ["0", "2", "4", "6", "8", "10", "time / s"]
    assert ticks[7:] == ["-1", "-0.5", "0", "0.5", "1", "height &amp; depth / mm"]
    assert numbers(paths(page, "rule")[0])[:2] == [LEFT, TOP + 0.25 * (BOTTOM - TOP)]
    assert numbers(paths(page, "rule")[1])[:2] == [(LEFT + RIGHT) / 2, TOP]


def test_points_without_a_number_are_left_out_and_wild_ones_stay_writable():
    curve = Curve(np.array([0.0, 1.0, 2.0]), np.array([0.0, np.nan, 1e30]), "", style="both")
    page = chart("holes", [curve], ACROSS, UP)
    assert paths(page, "marks")[0].count("M") == 2
    assert max(np.abs(numbers(paths(page, "marks")[0]))) < 1e4
    assert "nan" not in page


def test_a_logarithmic_scale_keeps_decades_apart_by_the_same_step():
    scale = Scale(1e-3, 1.0, "score", even="logarithm")
    page = chart("decades", [Curve(np.array([0.0, 5.0, 10.0]), np.array([1.0, 0.1, 0.01]), "")], ACROSS, scale)
    heights = numbers(paths(page, "curve")[0])[1::2]
    assert np.diff(heights) == pytest.approx(100.0)


@pytest.fixture(scope="module")
def found() -> tuple[Calibration, np.ndarray]:
    camera = Spherical(160.0, 163.0, 118.0, 320, 240)
    image = photograph(camera, Rings(RADII, 1.0, 1.0), tilted(8.0, 40.0, 22.0), Studio(blur=0.8), 1)
    return calibrate_circles([image], RADII), np.repeat(image[..., None], 3, axis=2)


def test_every_observation_lies_where_it_was_seen(found):
    calibration, picture = found
    seen = observations(calibration)
    page = detections(calibration, seen, picture, 0)
    drawn = np.array(numbers(paths(page, "dots")[0])).reshape(-1, 3)[:, :2]
    np.testing.assert_allclose(drawn, seen.pixel[seen.used], atol=0.051)
    assert paths(page, "crosses")[0].count("M") == (~seen.used).sum()
    assert f"used ({seen.used.sum()})" in page
    assert 'viewBox="-0.5 -0.5 320 240"' in page


def test_wedges_point_along_the_residuals(found):
    calibration, picture = found
    seen = observations(calibration)
    page = detections(calibration, seen, picture, 0)
    factor = float(re.search(r"residuals ×(\d+)", page)[1])
    # foot, to the tip, to the other side of the foot: the tip from the middle of the foot is the arrow
    wedge = np.array(numbers(paths(page, "arrows")[0])).reshape(-1, 6)
    arrow = wedge[:, 2:4] + (wedge[:, 2:4] + wedge[:, 4:6]) / -2
    every = -(-int(seen.used.sum()) // 400)
    np.testing.assert_allclose(arrow, factor * seen.residual[seen.used][::every], atol=0.3)


def test_residuals_are_drawn_for_every_observation_used(found):
    calibration, _ = found
    seen = observations(calibration)
    page = residual_against_angle(calibration, seen)
    assert paths(page, "cloud")[0].count("M") == seen.used.sum()


def test_the_page_has_all_its_pictures(found):
    calibration, picture = found
    page = calibration_page(calibration, [picture], ["<a>.png"], {"command": "jaxsfs calibrate"})
    titles = re.findall(r"<h[23]>([^<]+)</h[23]>", page)
    assert titles == [
        *("Camera", "Photographs", "&lt;a&gt;.png: observations and residuals (seen minus fitted)"),
        *("Residuals against the angle", "Coverage and uncertainty", "Coverage"),
        *("Where a direction is seen: 1σ", "Which lens is it", "Rectified", "Stored", "Rectified"),
        "How it was made",
    ]
    assert page.count('<svg class="chart"') == 2
    assert page.count('<svg class="over"') == 1
