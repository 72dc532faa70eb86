"""The warning about the dichromatic model is raised where it does not hold, and only there."""

import cv2
import numpy as np
import pytest

from jaxsfs.cli import main
from jaxsfs.specular import dichromatic_compliance

SHAPE = (96, 128)
ALL = np.ones(SHAPE, bool)


def noise(seed=0, sigma=0.003):
    return np.random.default_rng(seed).normal(0, sigma, (*SHAPE, 3)).astype(np.float32)


def shaded():
    v, u = np.indices(SHAPE)
    return (0.3 + 0.15 * np.sin(u / 17) * np.cos(v / 23)).astype(np.float32)


def patchwork():
    """Many colours within every region."""
    patches = np.random.default_rng(1).uniform(0.1, 0.6, (24, 32, 3)).astype(np.float32)
    return cv2.resize(patches, SHAPE[::-1], interpolation=cv2.INTER_CUBIC)


@pytest.mark.parametrize("sigma", [0.0, 0.003, 0.01])
def test_one_body_colour_under_white_highlights_complies(sigma):
    v, u = np.indices(SHAPE)
    spot = 0.3 * np.exp(-((u - 60) ** 2 + (v - 40) ** 2) / 200).astype(np.float32)
    picture = shaded()[..., None] * np.array([1, 0.6, 0.5], np.float32) + spot[..., None] + noise(sigma=sigma)
    found = dichromatic_compliance(picture, ALL)
    assert found.regions == 48
    assert found.share == 1


def test_many_colours_in_a_region_do_not():
    assert dichromatic_compliance(patchwork() + noise(), ALL).share < 0.1


def test_too_few_whole_regions_say_nothing():
    few = np.zeros(SHAPE, bool)
    few[:32, :32] = True
    found = dichromatic_compliance(patchwork(), few)
    assert np.isnan(found.share)
    assert found.regions == 4


@pytest.mark.parametrize("complies", [True, False])
def test_the_command_warns(tmp_path, capsys, complies):
    picture = shaded()[..., None] * np.array([0.5, 0.6, 1]) if complies else patchwork() * 0.9
    cv2.imwrite(str(tmp_path / "photo.png"), np.round(255 * picture).astype(np.uint8))
    assert main(["specular", f"{tmp_path}/photo.png", "--out", f"{tmp_path}/out", "--response", "linear"]) == 0
    assert ("dichromatic model (eq. 7) does not hold" in capsys.readouterr().out) is not complies
