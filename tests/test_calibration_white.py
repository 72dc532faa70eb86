"""White paper: synthetic photographs with known response, fall-off and gain, and a real one of a colonoscope."""

import itertools

import cv2
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from data_synth.target_patterns import BlankSheet, Rings
from data_synth.targets import Studio, photograph
from jaxsfs.calibration import calibrate_dots, calibrate_white, tilted
from jaxsfs.calibration._field import photograph_from
from jaxsfs.calibration._paper import _fine_print
from jaxsfs.calibration._white_fit import Cells, compare_models
from jaxsfs.camera import Spherical
from jaxsfs.photo import irradiance_of, parse_channel
from jaxsfs.photometry import (
    CosineFalloff,
    ExponentialFalloff,
    GammaResponse,
    SRGBResponse,
    parse_falloff,
    parse_response,
)
from jaxsfs.reconstruction import reconstruct
from jaxsfs.report import white_summary

CAMERA = Spherical(270.0, 327.0, 236.0, 640, 480)
RINGS = Rings((5.0, 10.0, 15.0, 20.0, 25.0, 30.0), 0.8, 1.0)
SQUARE, LEANING = tilted(0.0, 0.0, 24.0), tilted(10.0, 40.0, 24.0, (2.0, 1.0))
GAIN = 0.5 * 24.0**2
GAMMA = Studio(CosineFalloff(1.2), GammaResponse(2.2), glares=((300.0, 300.0, 12.0),), field="round")
SRGB = Studio(ExponentialFalloff(2.0), SRGBResponse(), glares=((300.0, 300.0, 12.0),), field="octagon")
COSINES = np.cos(np.radians(np.linspace(0, 60, 13)))


def shots(studio, *poses, gains=(GAIN, GAIN), pattern=RINGS):
    return [photograph(CAMERA, pattern, pose, studio, i, gains[i]) for i, pose in enumerate(poses)]


def curve(text):
    return np.asarray(parse_falloff(text)(jnp.asarray(COSINES)))


def check_separated(found):
    assert found.separated
    assert found.gamma == pytest.approx(2.2, rel=0.02)
    assert np.allclose(curve(found.falloff), COSINES**1.2, rtol=0.02)
    assert found.gain_albedo == pytest.approx(GAIN, rel=0.02)
    assert found.note == (
        "Response and fall-off were told apart: the sheet's tilt or the photographs' distances or exposures show both."
    )


def test_a_tilted_photograph_separates_response_and_falloff():
    check_separated(calibrate_white(shots(GAMMA, SQUARE, LEANING), CAMERA, [SQUARE, LEANING]))


def test_a_second_distance_separates_them():
    poses = [SQUARE, tilted(0.0, 0.0, 32.0)]
    check_separated(calibrate_white(shots(GAMMA, *poses), CAMERA, poses))


def test_a_second_exposure_separates_them():
    images = shots(GAMMA, SQUARE, SQUARE, gains=(GAIN, 0.4 * GAIN))
    check_separated(calibrate_white(images, CAMERA, [SQUARE, SQUARE], exposures=(1.0, 0.4)))


def test_automatic_exposure_is_noticed_and_leaves_the_gain_unknown():
    found = calibrate_white(shots(GAMMA, SQUARE, LEANING, gains=(GAIN, 1.3 * GAIN)), CAMERA, [SQUARE, LEANING])
    assert found.rms < 0.004  # one gain for both: 0.02
    assert np.allclose(curve(found.falloff), COSINES**1.2, rtol=0.03)
    assert found.gamma == pytest.approx(2.2, rel=0.03)
    assert found.gain_albedo is None
    assert set(found.photometry()) == {"response", "falloff", "channel"}
    assert "not exposed alike (their gains differ by up to 30%)" in found.note
    assert "gain·ρ: not known" in white_summary(found)


@pytest.mark.slow
def test_the_srgb_curve_is_told_from_a_power_law():
    found = calibrate_white(shots(SRGB, SQUARE, LEANING), CAMERA, [SQUARE, LEANING])
    assert found.response == "srgb"
    assert found.falloff.startswith("exp:")
    assert found.mu == pytest.approx(2.0, rel=0.02)
    power_law = next(row for row in found.models if row["response"].startswith("gamma"))
    assert power_law["rms"] > 1.2 * found.rms


def test_one_square_photograph_fixes_the_product_and_says_so():
    found = calibrate_white(shots(GAMMA, SQUARE), CAMERA, [SQUARE])
    assert not found.separated
    assert found.response == "gamma:2.2"  # nearer to these stored values than the sRGB curve, which is tried too
    assert found.gamma is None
    assert "tilted by 10°" in found.note
    assert found.product == pytest.approx(4.2 / 2.2, rel=0.01)
    # what is fixed is how stored values fall: the found pair must predict them
    assert found.gain_albedo is not None
    light = GAIN / 24.0**2 * COSINES**3
    truth = (light * COSINES**1.2) ** (1 / 2.2)
    seen = found.gain_albedo / 24.0**2 * COSINES**3 * curve(found.falloff)
    stored = np.asarray(parse_response(found.response).encode(jnp.asarray(seen)))
    assert np.allclose(stored, truth, atol=0.02)


@pytest.mark.parametrize("response", ["gamma", "srgb"])
def test_where_the_response_is_held_two_terms_draw_how_stored_values_fall(response):
    # γ 1.7 seen as 2.2: no fall-off of one parameter is exact
    cosine = np.cos(np.radians(np.linspace(0, 75, 400)))
    stored = (0.8 * cosine**3 * np.exp(-2.0 * (1 - cosine))) ** (1 / 1.7)
    cells = Cells(stored[:, None], 3 * np.log(cosine), cosine, np.ones(1), np.zeros(400, int))
    found = compare_models(cells, 2.2 if response == "gamma" else None, "srgb")
    assert found.how == ("given" if response == "gamma" else "held")
    assert found.chosen.model.falloff == "cosexp"
    a, b = found.chosen.parameters[1:3]
    assert (a, b) == pytest.approx((3 * (2.2 / 1.7 - 1), 2.0 * 2.2 / 1.7), rel=1e-3)
    assert found.chosen.mu == pytest.approx(a + b)
    assert found.chosen.falloff_text == f"cosexp:{a:.5g},{b:.5g}"
    assert np.allclose(found.chosen.predicted(cells.geometry, cosine), stored, rtol=1e-4)
    simple = min(row.rms for row in found.ranked if row.model.falloff != "cosexp")
    assert simple > 0.003


def test_a_given_gamma_is_held():
    found = calibrate_white(shots(GAMMA, SQUARE), CAMERA, [SQUARE], gamma=2.2)
    assert found.response == "gamma:2.2"
    assert np.allclose(curve(found.falloff), COSINES**1.2, rtol=0.02)


@pytest.mark.slow
def test_reconstruction_with_the_photometry_is_in_millimetres():
    images = shots(SRGB, SQUARE, LEANING)
    photometry = calibrate_white(images, CAMERA, [SQUARE, LEANING]).photometry()
    assert set(photometry) == {"response", "falloff", "gain_albedo", "unit", "channel"}
    assert photometry["unit"] == "mm"
    unknown = tilted(6.0, 200.0, 28.0)
    blank = photograph(CAMERA, BlankSheet(), unknown, Studio(SRGB.falloff, SRGB.response, noise=0.004), 5, GAIN)
    irradiance, _ = irradiance_of(
        blank / 255,
        CAMERA,
        response=parse_response(photometry["response"]),
        falloff=parse_falloff(photometry["falloff"]),
        smooth_px=2.0,
    )
    result = reconstruct(irradiance, CAMERA, albedo=photometry["gain_albedo"], order=1)
    v, u = np.mgrid[140:340:20, 220:420:20]
    rays = jax.vmap(CAMERA.ray)(jnp.asarray(np.stack([u.ravel(), v.ravel()], axis=1), float))
    truth = 28.0 / np.asarray(jax.vmap(unknown.facing)(rays))
    assert np.allclose(np.asarray(result.surface.range)[v.ravel(), u.ravel()], truth, rtol=0.01)


@pytest.mark.slow
def test_channels_of_colour_share_the_response_and_have_their_own_gain():
    shares = np.array([1.0, 0.8, 0.6])
    images = [
        np.stack([photograph(CAMERA, RINGS, pose, GAMMA, i, share * GAIN) for share in shares], axis=2)
        for i, pose in enumerate((SQUARE, LEANING))
    ]
    for channel in ("luminance", "blue"):
        found = calibrate_white(images, CAMERA, [SQUARE, LEANING], channel=channel)
        assert found.gamma == pytest.approx(2.2, rel=0.02)
        assert found.gain_albedo == pytest.approx(
            GAIN * sum(float(w) * s for w, s in zip(parse_channel(channel), shares, strict=True)), rel=0.02
        )
        assert found.photometry()["channel"] == channel


@pytest.mark.parametrize(
    ("more", "match"),
    [
        ({"poses": [SQUARE, SQUARE]}, "1 photographs, 2 poses"),
        ({"gamma": 9.0}, "between 0.2 and 5"),
        ({"exposures": (1.0, 2.0)}, "1 photographs, 2 exposures"),
        ({"exposures": (-1.0,)}, "exposures are positive"),
        ({"channel": "infrared"}, "channel 'infrared' is unknown"),
        ({"camera": Spherical(300.0, 50.0, 50.0, 100, 100)}, "same mode"),
    ],
)
def test_bad_arguments_are_refused(more, match):
    arguments = {"images": [np.full((480, 640), 128, np.uint8)], "camera": CAMERA, "poses": [SQUARE]} | more
    with pytest.raises(ValueError, match=match):
        calibrate_white(**arguments)


def test_lines_that_blur_turned_pale_are_told_from_paper():
    across, down = np.meshgrid(np.arange(200.0), np.arange(160.0))
    paper = 0.3 + 0.001 * across  # the prediction is even: light that it misses is no line
    grain = 0.004 * np.random.default_rng(1).standard_normal(paper.shape)
    lines = np.exp(-((down % 20 - 10) ** 2) / 8)
    for depth, share in ((0.1, 0.99), (0.0, 0.0)):
        photo = photograph_from((paper * (1 - depth * lines) + grain).astype(np.float32))
        ink = _fine_print(photo, np.full(paper.shape, 0.4))
        assert np.mean(ink[lines > 0.8]) >= share
        assert np.mean(ink[lines < 0.01]) < 0.01
    assert np.mean(ink) < 0.01


def test_too_little_paper_is_refused():
    image = np.full((480, 640), 255, np.uint8)
    image[:30, :30] = 128
    with pytest.raises(ValueError, match="too little white paper"):
        calibrate_white([image], CAMERA, [SQUARE])


@pytest.mark.slow
def test_the_paper_of_a_real_colonoscope_falls_off_as_published(data):
    stored = cv2.imread(str(data / "endomapper_plane" / "sample_frame.png"))
    assert stored is not None
    stored = stored[..., ::-1]
    camera = calibrate_dots([stored], 19, 10, 5.2797)
    found = calibrate_white([stored], camera.camera, [camera.fit.pose(0)], gamma=2.2)
    # published for this series: γ = 2.2 and V = exp(−2.77(1 − cos α))
    exponential = next(row for row in found.models if row["falloff"].startswith("exp"))
    assert float(exponential["falloff"].removeprefix("exp:")) == pytest.approx(2.77, rel=0.05)
    assert found.rms < 0.02
    near = [value for alpha, value in zip(found.alpha_deg, found.measured, strict=True) if alpha < 60]
    assert all(a > b for a, b in itertools.pairwise(near))
