"""From stored photographs to irradiance: the inverse of rendering.photograph, and what must not be used as data."""

import jax.numpy as jnp
import numpy as np
import pytest

from jaxsfs.camera import Orthographic, Perspective, Spherical
from jaxsfs.irradiance import Irradiance
from jaxsfs.photo import automatic_response, clipping_limit, irradiance_of, parse_channel, plateau
from jaxsfs.photometry import (
    CosineExponentialFalloff,
    CosineFalloff,
    ExponentialFalloff,
    GammaResponse,
    LinearResponse,
    NoFalloff,
    SRGBResponse,
)
from jaxsfs.rendering import photograph

LINEAR = LinearResponse()


def camera(width=40, height=30) -> Spherical:
    return Spherical(f=30.0, cx=(width - 1) / 2, cy=(height - 1) / 2, width=width, height=height)


def smooth_irradiance(size) -> Irradiance:
    height, width = size
    v, u = np.indices(size)
    return Irradiance(jnp.asarray(0.2 + 0.1 * np.sin(u / 7) * np.cos(v / 5)), jnp.ones((height, width), bool))


FALLOFFS = [NoFalloff(), CosineFalloff(1.6), ExponentialFalloff(2.77), CosineExponentialFalloff(-0.5, 2.5)]


@pytest.mark.parametrize("response", [SRGBResponse(), GammaResponse(2.2), LINEAR])
@pytest.mark.parametrize("falloff", FALLOFFS)
def test_undoes_what_a_photograph_does(response, falloff):
    given = smooth_irradiance((30, 40))
    stored = np.asarray(photograph(given, camera(), response=response, falloff=falloff, gain=1.3))
    found, report = irradiance_of(stored, camera(), response=response, falloff=falloff, clip_limit=None)
    np.testing.assert_allclose(found.values, 1.3 * given.values, rtol=1e-12)
    assert found.valid.all()
    assert report.used == report.pixels == 1200
    assert report.largest == pytest.approx(float(found.values.max()))


def test_the_channels_are_mixed_in_linear_light():
    photo = np.broadcast_to(np.array([0.9, 0.5, 0.1]), (30, 40, 3))
    linear = np.asarray(SRGBResponse().decode(jnp.array([0.9, 0.5, 0.1])))
    found, _ = irradiance_of(photo, camera())
    np.testing.assert_allclose(found.values, linear @ [0.2126, 0.7152, 0.0722], rtol=1e-12)
    found, _ = irradiance_of(photo, camera(), weights=(0.0, 0.5, 0.5))
    np.testing.assert_allclose(found.values, linear[1:].mean(), rtol=1e-12)


def test_clipped_pixels_of_the_used_channels_are_left_out():
    photo = np.full((30, 40, 3), 0.5)
    photo[3, 4, 0] = 1.0
    photo[5, 6, 2] = 254 / 255
    found, report = irradiance_of(photo, camera())
    assert report.clipped == 2
    assert not found.valid[3, 4]
    assert not found.valid[5, 6]
    assert found.valid.sum() == 1198
    found, report = irradiance_of(photo, camera(), weights=parse_channel("green"))
    assert report.clipped == 0
    assert found.valid.all()


def test_black_pixels_are_left_out_and_counted():
    photo = np.full((30, 40), 0.5)
    photo[2, :3] = [0.0, 1e-9, 0.01]
    found, report = irradiance_of(photo, camera(), response=LINEAR)
    assert (report.black, report.used) == (2, 1198)
    assert found.valid[2].tolist()[:4] == [False, False, True, True]
    _, report = irradiance_of(photo, camera(), response=LINEAR, black=0.02)
    assert report.black == 3


def test_each_pixel_is_counted_once():
    seeing_less = Spherical(f=12.0, cx=19.5, cy=14.5, width=40, height=30)
    photo = np.full((30, 40), 0.5)
    photo[15, 15:18] = [1.0, 0.0, 1.0]
    valid = np.ones((30, 40), bool)
    valid[:, :20] &= np.arange(20) >= 16
    found, report = irradiance_of(photo, seeing_less, valid=valid)
    assert report.outside + report.no_ray + report.clipped + report.black + report.used == report.pixels
    assert (report.outside, report.clipped, report.black) == (16 * 30, 1, 1)
    assert report.no_ray > 0
    assert int(found.valid.sum()) == report.used
    assert set(report.as_dict()) == {"pixels", "used", "outside", "no_ray", "clipped", "black", "largest"}


def test_smoothing_never_mixes_in_pixels_without_data():
    photo = np.full((30, 40), 0.25)
    photo[:, 20:] = 1.0  # clipped
    photo[:, :5] = 0.9  # outside the mask
    valid = np.ones((30, 40), bool)
    valid[:, :5] = False
    found, _ = irradiance_of(photo, camera(), valid=valid, response=LINEAR, smooth_px=3.0)
    np.testing.assert_allclose(found.values[:, 5:20], 0.25, rtol=1e-12)
    assert (found.values[:, 20:] == 0).all()


def test_smoothing_is_gaussian():
    photo = np.full((41, 41), 0.2)
    photo[20, 20] = 0.8
    ortho = Orthographic(scale=1.0, cx=20.0, cy=20.0, width=41, height=41)
    found, _ = irradiance_of(photo, ortho, response=LINEAR, smooth_px=2.0)
    spread = np.asarray(found.values) - 0.2
    v, u = np.indices((41, 41)) - 20
    expected = np.exp(-(u**2 + v**2) / 8)
    np.testing.assert_allclose(spread, 0.6 * expected / expected.sum(), atol=2e-5)
    assert (spread > 0).sum() > 9


def test_works_in_single_precision():
    photo = np.full((30, 40, 3), 0.5, np.float32)
    found, _ = irradiance_of(photo, camera(), smooth_px=1.5, falloff=CosineFalloff(1.6))
    assert found.values.dtype == jnp.result_type(float)


def test_a_fall_off_that_reaches_zero_leaves_the_pixel_out():
    wide = Spherical(f=20.0, cx=19.5, cy=14.5, width=40, height=30)
    found, report = irradiance_of(np.full((30, 40), 0.5), wide, falloff=CosineFalloff(2.0))
    assert np.isfinite(np.asarray(found.values)).all()
    assert report.no_ray > 0


@pytest.mark.parametrize(
    ("stored", "message"),
    [
        (np.zeros((30, 40)), "no usable pixel: of 1200, 1200 black; a black picture"),
        (np.ones((30, 40, 3)), "1200 clipped; a white picture .* lower the exposure"),
    ],
)
def test_refuses_pictures_without_shading(stored, message):
    with pytest.raises(ValueError, match=message):
        irradiance_of(stored, camera())


def test_says_when_the_mask_leaves_nothing():
    valid = np.zeros((30, 40), bool)
    with pytest.raises(ValueError, match="1200 outside the mask; check that mask and camera"):
        irradiance_of(np.full((30, 40), 0.5), camera(), valid=valid)


def test_names_both_sizes():
    with pytest.raises(
        ValueError, match=r"40 x 30 px, .* 80 x 60 px; the aspect is the same: resize .*resized\(40, 30"
    ):
        irradiance_of(np.full((30, 40), 0.5), camera(80, 60))
    with pytest.raises(ValueError, match=r"40 x 30 px, .* 50 x 60 px; give the picture in its original size, or crop"):
        irradiance_of(np.full((30, 40), 0.5), camera(50, 60))
    with pytest.raises(ValueError, match="the mask is 30 x 40 px and the photograph 40 x 30 px"):
        irradiance_of(np.full((30, 40), 0.5), camera(), valid=np.ones((40, 30), bool))


def test_refuses_a_negative_sigma_and_two_channels():
    with pytest.raises(ValueError, match="sigma must be 0 or more"):
        irradiance_of(np.full((30, 40), 0.5), camera(), smooth_px=-1.0)
    with pytest.raises(ValueError, match="1 or 3 channels, got 2"):
        irradiance_of(np.full((30, 40, 2), 0.5), camera())


def test_one_pixel():
    one = Perspective(fx=10.0, fy=10.0, cx=0.0, cy=0.0, width=1, height=1)
    found, report = irradiance_of(np.full((1, 1), 0.5), one, response=LINEAR, smooth_px=2.0)
    assert float(found.values[0, 0]) == pytest.approx(0.5)
    assert report.used == 1


@pytest.mark.parametrize(
    ("text", "weights"),
    [("green", (0, 1, 0)), ("Luminance", (0.2126, 0.7152, 0.0722)), ("0,2,2", (0, 0.5, 0.5)), (" 1, 0, 0 ", (1, 0, 0))],
)
def test_channel_forms(text, weights):
    assert parse_channel(text) == pytest.approx(weights)


@pytest.mark.parametrize("text", ["grey", "1,2", "0,0,0", "1,-1,1", "nan,1,1", ""])
def test_channel_errors_list_the_forms(text):
    with pytest.raises(ValueError, match="luminance, red, green, blue, or three weights"):
        parse_channel(text)


def test_what_a_stored_type_stands_for():
    assert [automatic_response(kind) for kind in ("uint8", "uint16", "float32")] == ["srgb", "linear", "linear"]
    assert clipping_limit("uint8") == 254 / 255
    assert clipping_limit("uint16") == 65534 / 65535
    assert clipping_limit("float32") is None


def test_a_plateau_below_the_limit_of_the_type_is_seen_and_a_smooth_top_is_none():
    """8-bit data times 256 clips at 65280, which the limit of 16 bits does not reach."""
    rng = np.random.default_rng(0)
    v, u = np.indices((120, 160))
    smooth = 0.9 * np.exp(-((u - 70) ** 2 + (v - 50) ** 2) / 5000)[..., None] * (1.0, 0.6, 0.5)
    eight_bit = np.rint(255 * smooth + 0.5 * rng.standard_normal(smooth.shape)).clip(0, 255) * 256 / 65535
    valid, limit = np.ones((120, 160), bool), clipping_limit("uint16")
    assert plateau(eight_bit, valid, limit) is None
    clipped = np.minimum(eight_bit, 150 * 256 / 65535)
    found = plateau(clipped, valid, limit)
    assert found is not None
    assert found.value == pytest.approx(150 * 256 / 65535)
    assert found.share == pytest.approx((clipped.max(axis=-1) == clipped.max()).mean())
    assert plateau(clipped, valid, found.value) is None  # then they count as clipped already
    assert plateau(0 * clipped, valid, limit) is None
    assert plateau(np.full((120, 160), 0.5), valid, limit) is None  # a grey sheet: nothing to compare with
    assert plateau(clipped[..., 0], valid, None) is not None
