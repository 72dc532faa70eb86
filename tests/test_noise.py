"""The noise of a photograph, and the smoothing it asks for."""

import numpy as np
import pytest

from data_synth import default_camera, scene_from_text, take_photo
from data_synth.viewing import observe
from jaxsfs.noise import noise_level, smoothing_for


@pytest.mark.parametrize("noise", [0.003, 0.01, 0.03])
def test_noise_of_a_shaded_scene_is_measured(noise):
    scene = scene_from_text("wavy-wall")
    view = observe(scene, default_camera(scene, 160, 120), half_field_deg=50.0)
    valid = np.asarray(view.surface.valid)
    stored = take_photo(view, bits=None).stored
    noisy = stored + noise * np.random.default_rng(0).standard_normal(stored.shape[:2])[..., None]
    assert noise_level(noisy, valid) == pytest.approx(noise, rel=0.1)
    assert smoothing_for(noise_level(stored, valid)) == 0.0


def test_more_noise_never_asks_for_less_smoothing():
    sigmas = [smoothing_for(noise) for noise in (0.0, 4e-4, 6e-4, 4e-3, 9e-3, 2e-2, 1.0)]
    assert sigmas == sorted(sigmas)
    assert sigmas[0] == 0.0
    assert sigmas[-1] == 1.5


def test_too_few_pixels_have_no_noise():
    assert noise_level(np.random.default_rng(0).uniform(size=(9, 9)), np.ones((9, 9), bool)) == 0.0
