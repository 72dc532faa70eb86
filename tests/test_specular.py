"""Highlights: the invariant is blind to the interface, and what is not a highlight stays as it was."""

import numpy as np
import pytest
from hypothesis import assume, given, settings, strategies as st

from jaxsfs.specular import (
    LUMINANCE,
    RED_MINUS_GREEN,
    WHITE,
    body_colour,
    body_strength,
    interface_free_vector,
    noise_covariance,
    remove_highlights,
    saturated,
    saturation,
    separate,
)

TISSUE = np.array([0.75, 0.35, 0.28])
colours = st.tuples(*[st.floats(0.05, 1)] * 3).map(np.array)


def shading(size=(96, 128)):
    """E of a wall seen obliquely, smooth, between 0.3 and 0.8."""
    v, u = np.indices(size) / size[1]
    return 0.3 + 0.5 * np.exp(-((u - 0.4) ** 2) / 0.3 - (v - 0.3) ** 2 / 0.5)


def spot(size=(96, 128), centre=(60, 70), sigma=4.0, peak=0.3):
    v, u = np.indices(size)
    return peak * np.exp(-((v - centre[0]) ** 2 + (u - centre[1]) ** 2) / (2 * sigma**2))


def noisy(linear, sigma=0.002, seed=0):
    return linear + sigma * np.random.default_rng(seed).standard_normal(linear.shape)


@given(body=colours, interface=colours, amounts=st.lists(st.floats(-2, 2), min_size=4, max_size=4))
@settings(deadline=None)
def test_adding_any_multiple_of_the_interface_changes_nothing(body, interface, amounts):
    assume(saturation(body, interface) > 0.02)
    linear = np.array([0.1, 0.5, 1.0, 2.0])[:, None] * body
    vector = interface_free_vector(body, interface)
    with_highlights = linear + np.array(amounts)[:, None] * interface
    np.testing.assert_allclose(body_strength(linear, vector, body), [0.1, 0.5, 1.0, 2.0], rtol=1e-9)
    np.testing.assert_allclose(
        body_strength(with_highlights, vector, body), body_strength(linear, vector, body), atol=1e-9
    )
    np.testing.assert_allclose(separate(with_highlights, body, interface)[0], linear, atol=1e-9)


@given(body=colours, interface=colours, seed=st.integers(0, 99))
@settings(deadline=None)
def test_noise_aware_vector_is_the_quietest_of_all_that_are_blind_to_the_interface(body, interface, seed):
    assume(saturation(body, interface) > 0.05)
    rng = np.random.default_rng(seed)
    factor = rng.uniform(-0.3, 0.3, (3, 3)) + np.eye(3)
    covariance = factor @ factor.T
    best = interface_free_vector(body, interface, covariance)
    assert abs(best @ interface) < 1e-9
    assert best @ body == pytest.approx(1)
    # every other such vector differs by a multiple of what is perpendicular to both colours
    across = np.cross(body, interface)
    for amount in (-0.1, 0.1):
        other = best + amount * across / np.linalg.norm(across)
        assert other @ covariance @ other > best @ covariance @ best


def test_red_minus_green_of_the_paper():
    linear = shading()[..., None] * TISSUE + spot()[..., None] * WHITE
    np.testing.assert_allclose(body_strength(linear, RED_MINUS_GREEN, TISSUE), shading(), rtol=1e-12)
    with pytest.raises(ValueError, match="not perpendicular"):
        separate(linear, TISSUE, np.array([1.0, 0.8, 0.9]), RED_MINUS_GREEN)
    with pytest.raises(ValueError, match="blind"):
        body_strength(linear, RED_MINUS_GREEN, np.array([0.5, 0.5, 0.2]))
    with pytest.raises(ValueError, match="parallel"):
        interface_free_vector(0.4 * WHITE)


def test_body_colour_ignores_highlights_and_noise_is_measured():
    linear = noisy(shading()[..., None] * TISSUE + 5 * spot(sigma=12)[..., None] * WHITE)
    colour = body_colour(linear, np.ones((96, 128), bool))
    np.testing.assert_allclose(colour, TISSUE / (LUMINANCE @ TISSUE), rtol=0.02)
    plain = noisy(shading()[..., None] * TISSUE, 0.01)
    covariance = noise_covariance(plain, np.ones((96, 128), bool))
    np.testing.assert_allclose(np.sqrt(np.diag(covariance)), 0.01, rtol=0.25)


def test_saturated_is_any_channel():
    stored = np.array([[[1.0, 0.2, 0.2], [0.9, 0.9, 0.9]]])
    assert saturated(stored).tolist() == [[True, False]]
    assert saturated(stored[..., 0], 0.85).tolist() == [[True, True]]


@pytest.mark.parametrize("colour", [TISSUE, np.ones(3)], ids=["tissue", "grey"])
@pytest.mark.parametrize("method", ["auto", "mask"])
def test_picture_without_highlights_stays_as_it_is(colour, method):
    linear = noisy(0.7 * shading()[..., None] * colour).clip(0, 1)
    result = remove_highlights(linear, method=method)
    assert not result.highlights.any()
    np.testing.assert_array_equal(result.values, linear)
    assert "no highlight" in result.report.message


def test_near_wall_that_saturates_is_unknown_but_no_highlight():
    linear = np.clip(1.6 * shading()[..., None] * TISSUE, 0, 0.9)
    result = remove_highlights(linear, saturated=(linear >= 0.9).any(-1))
    assert (linear >= 0.9).any()
    assert not result.highlights.any()
    np.testing.assert_array_equal(result.unknown, (linear >= 0.9).any(-1))
    np.testing.assert_array_equal(result.values, linear)


@pytest.mark.parametrize(("peak", "sigma"), [(0.15, 12.0), (0.4, 4.0), (3.0, 3.0)], ids=["broad", "spot", "saturated"])
def test_highlight_is_taken_off(peak, sigma):
    body = shading()[..., None] * TISSUE
    linear = noisy(body + spot(peak=peak, sigma=sigma)[..., None] * WHITE).clip(0, 1)
    result = remove_highlights(linear, saturated=(linear > 0.99).any(-1))
    changed = result.highlights
    assert changed[60, 70]
    assert changed.mean() < 0.4
    np.testing.assert_array_equal(result.values[~changed], linear[~changed])
    before, after = (np.abs(picture - body).mean(-1)[changed].mean() for picture in (linear, result.values))
    assert after < 0.1 * before
    assert result.filled.any() == (peak > 1)


def test_coloured_light_is_estimated_from_the_highlights():
    light = np.array([0.8, 1.2, 1.0])
    body = shading()[..., None] * TISSUE
    linear = noisy(body + sum(spot(centre=c)[..., None] for c in ((60, 70), (20, 30), (30, 100))) * light)
    report = remove_highlights(linear).report
    assert report.interface_origin == "estimated from the highlights"
    np.testing.assert_allclose(report.interface_colour, light, atol=0.05)


def test_grey_picture_is_searched_by_brightness_and_says_so():
    grey = noisy(0.6 * shading() + spot(peak=0.4, sigma=2.5))
    for linear in (grey, grey[..., None] * np.ones(3)):
        result = remove_highlights(linear)
        assert result.highlights[60, 70]
        assert np.abs(result.values[60, 70] / (0.6 * shading()[60, 70]) - 1).max() < 0.1
        assert "grey" in result.report.message
    with pytest.raises(ValueError, match="grey picture has no colour"):
        remove_highlights(grey, method="dichromatic")
    with pytest.raises(ValueError, match="too close"):
        remove_highlights(grey[..., None] * np.ones(3), method="dichromatic")


def test_a_white_sheet_with_dark_dots_has_no_highlights():
    """What lies between the dots is brighter than they are, and as bright as the sheet beyond."""
    v, u = np.indices((96, 128))
    ink = (((v % 8 - 4) ** 2 + (u % 8 - 4) ** 2) < 6) & (abs(v - 48) < 30) & (abs(u - 64) < 40)
    sheet = noisy(np.where(ink, 0.1, 0.6) * np.exp(-((v - 48) ** 2 + (u - 64) ** 2) / 6000))
    assert not remove_highlights(sheet).highlights.any()


def test_off_and_dichromatic():
    linear = shading()[..., None] * TISSUE + spot()[..., None] * WHITE
    np.testing.assert_array_equal(remove_highlights(linear, method="off").values, linear)
    body = remove_highlights(linear, method="dichromatic").values
    np.testing.assert_allclose(body, shading()[..., None] * TISSUE, rtol=0.02)


def test_what_cannot_be_used_is_named():
    linear = shading()[..., None] * TISSUE
    with pytest.raises(ValueError, match="no pixel is usable"):
        remove_highlights(linear, np.zeros((96, 128), bool))
    with pytest.raises(ValueError, match="1 or 3 channels"):
        remove_highlights(linear[..., :2])


def veiled(body_colour):
    """A bowl that shines but for its corners."""
    v, u = np.indices((96, 128))
    near = np.exp(-((v - 48) ** 2 + (u - 64) ** 2) / 2000)
    body = (0.25 + 0.2 * np.cos(v / 15) * np.cos(u / 20))[..., None] * body_colour
    return noisy(body + (0.3 * near**2)[..., None] * WHITE), body @ LUMINANCE


def test_a_veil_over_the_whole_picture_is_no_paler_tissue():
    """One body colour and white explain every pixel, so what is pale is veiled."""
    linear, truth = veiled(TISSUE)
    removed = remove_highlights(linear)
    ratio = np.log(removed.values @ LUMINANCE) - np.log(truth)
    assert np.log(linear @ LUMINANCE / truth).max() > 0.5
    assert np.abs(ratio - np.median(ratio)).mean() < 0.015
    assert removed.highlights.mean() > 0.5


def test_tissue_of_several_colours_has_no_veil():
    """Blood darkens green and blue at once: the colours lie on a line, and it misses white."""
    v, u = np.indices((96, 128))
    blood = 0.5 + 0.5 * np.sin(v / 9) * np.sin(u / 13)
    linear = noisy(0.4 * np.asarray(TISSUE) * np.exp(-0.5 * blood[..., None] * np.array([0.13, 1.0, 0.95])))
    assert not remove_highlights(linear).highlights.any()


def test_small_glints_that_clip_tell_the_colour_of_their_light():
    """Too few pixels have flanks: what they add to the body around tells; their cores are none of the body's."""
    light = np.array([0.85, 1.0, 0.8])
    body = shading()[..., None] * TISSUE
    centres = [(v, u) for v in (20, 48, 75) for u in (20, 52, 84, 110)]
    glints = sum(spot(peak=3.0, sigma=1.2, centre=c)[..., None] for c in centres)
    linear = noisy(body + glints * light).clip(0, 1)
    found = remove_highlights(linear, saturated=(linear > 0.99).any(-1))
    assert found.report.interface_origin == "estimated from the highlights"
    ratio = np.array(found.report.interface_colour) / light
    np.testing.assert_allclose(ratio / ratio.mean(), 1, atol=0.08)  # white would be off by 0.15
    assert all(found.highlights[centre] for centre in centres)
    wrong = np.abs(np.log(found.values @ LUMINANCE) - np.log(body @ LUMINANCE))
    assert wrong[found.highlights].mean() < 0.03
