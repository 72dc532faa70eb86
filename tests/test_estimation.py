"""Photometry from known ranges, and lights beside the lens, as `reconstruct` offers them."""

import json

import numpy as np
import pytest

from data_synth import default_camera, scene_from_text, take_photo
from data_synth.viewing import observe
from jaxsfs import GammaResponse, Power, files, irradiance_of, reconstruct
from jaxsfs.camera import camera_to_dict
from jaxsfs.cli import main
from jaxsfs.estimation import estimate_photometry, prior_about
from jaxsfs.photometry import CosineFalloff, NoFalloff


@pytest.fixture(scope="module")
def scope():
    """A tilted wall photographed by a scope whose photometry is not known, and five of its ranges in mm."""
    scene = scene_from_text("tilted-plane")
    view = observe(scene, default_camera(scene, 160, 120), half_field_deg=50.0, reflectance=Power(0.7))
    photo = take_photo(view, read_noise=0.002, seed=1, response=GammaResponse(2.6), falloff=CosineFalloff(2.2))
    valid = np.asarray(view.surface.valid)
    places = np.argwhere(valid)
    places = places[np.random.default_rng(0).choice(len(places), 8, replace=False)]
    known = [(int(u), int(v), 10 * float(view.surface.range[v, u])) for v, u in places]
    return view, photo.stored, valid, known


def abs_rel(view, stored, valid, gamma, mu, power):
    irradiance, _ = irradiance_of(
        stored.mean(axis=-1) / 255,
        view.camera,
        valid=valid,
        response=GammaResponse(gamma),
        falloff=CosineFalloff(mu),
        clip_limit=None,
    )
    found = np.asarray(reconstruct(irradiance, view.camera, reflectance=Power(power)).surface.range)[valid]
    truth = np.asarray(view.surface.range)[valid]
    return float(np.mean(np.abs(found * np.median(truth) / np.median(found) / truth - 1)))


@pytest.mark.slow
def test_known_ranges_give_the_photometry(scope):
    view, stored, valid, known = scope
    found = estimate_photometry(stored.mean(axis=-1) / 255, view.camera, known, valid)
    before = abs_rel(view, stored, valid, 2.2, 1.0, 0.8)
    after = abs_rel(view, stored, valid, found.gamma, found.mu, found.power)
    assert before > 0.02
    assert after < 0.3 * before
    assert abs(found.gamma - 2.6) < 3 * found.sd[0]
    assert abs(found.mu - 2.2) < 3 * found.sd[1]
    assert found.misfit < 0.3 * found.misfit_before


def test_too_few_known_ranges_are_refused(scope):
    view, stored, valid, known = scope
    with pytest.raises(ValueError, match="at least 5 known ranges at usable pixels, got 4 of 4"):
        estimate_photometry(stored.mean(axis=-1) / 255, view.camera, known[:4], valid)


def about_the_preset():
    return prior_about(GammaResponse(2.2), CosineFalloff(1.6), Power(0.65))


def two_apart(known):
    by_range = sorted(known, key=lambda point: point[2])
    return [by_range[0], by_range[-1]]


def test_two_known_ranges_move_a_scope_towards_the_truth(scope):
    view, stored, valid, known = scope
    found = estimate_photometry(stored.mean(axis=-1) / 255, view.camera, two_apart(known), valid, about_the_preset())
    before = abs_rel(view, stored, valid, 2.2, 1.6, 0.65)
    after = abs_rel(view, stored, valid, found.gamma, found.mu, found.power)
    assert before > 0.015
    assert after < 0.8 * before
    assert found.misfit < found.misfit_before


def test_ranges_that_say_little_leave_the_prior_as_it_is(scope):
    view, stored, valid, known = scope
    u, v, distance = known[0]
    beside = [(u, v, distance), (u, v, distance)]
    found = estimate_photometry(stored.mean(axis=-1) / 255, view.camera, beside, valid, about_the_preset())
    np.testing.assert_allclose((found.gamma, found.mu, found.power), (2.2, 1.6, 0.65), rtol=1e-3)
    np.testing.assert_allclose(found.sd, (2.2 * 0.15, 0.5, 0.15), rtol=0.01)


def test_a_prior_needs_the_forms_that_are_estimated():
    with pytest.raises(ValueError, match="the preset has another form"):
        prior_about(GammaResponse(2.2), NoFalloff(), Power(0.65))


@pytest.fixture(scope="module")
def folder(scope, tmp_path_factory):
    view, stored, _, known = scope
    path = tmp_path_factory.mktemp("scope")
    files.write_png(path / "image.png", stored)
    (path / "camera.json").write_text(json.dumps(camera_to_dict(view.camera)))
    (path / "known.csv").write_text("u,v,range\n" + "".join(f"{u},{v},{r:.4f}\n" for u, v, r in known))
    (path / "one.csv").write_text("u,v,range\n" + "{},{},{:.4f}\n".format(*known[0]))
    (path / "lights.json").write_text('{"unit": "mm", "lights": [{"position": [0.2, 0, 0], "power": 1}]}')
    return path


def words(folder, *more):
    return ["reconstruct", f"{folder}/image.png", "--camera", f"{folder}/camera.json", *more]


def test_the_command_line_estimates_and_gives_millimetres(folder, scope, tmp_path, capsys):
    out = tmp_path / "out"
    assert main(words(folder, "--out", str(out), "--estimate-photometry", f"{folder}/known.csv", "--json")) == 0
    record = json.loads(capsys.readouterr().out)
    assert record["unit"] == "mm"
    assert record["options"]["response"]["origin"].startswith("estimated from 8 known ranges")
    found = files.read_map(out / "range.tiff")
    true = 10 * np.where(scope[2], np.asarray(scope[0].surface.range), np.nan)
    assert np.nanmean(np.abs(found / true - 1)) < 0.02


@pytest.mark.slow
def test_lights_need_a_scale_and_are_recorded(folder, tmp_path, capsys):
    assert main(words(folder, "--out", f"{tmp_path}/a", "--lights", f"{folder}/lights.json")) == 2
    assert "the scale must be known" in capsys.readouterr().err
    code = main(
        words(
            folder, "--out", f"{tmp_path}/b", "--lights", f"{folder}/lights.json", "--known-range", "80,60,12", "--json"
        )
    )
    assert code in (0, 3)
    record = json.loads(capsys.readouterr().out)
    assert record["lights"]["lights"][0]["position"] == [0.2, 0.0, 0.0]
    assert record["unit"] == "mm"


@pytest.mark.parametrize(
    ("more", "message"),
    [
        (["--estimate-photometry", "known.csv", "--response", "srgb"], "finds what --response would set"),
        (["--estimate-photometry", "one.csv", "--preset", "colonoscope"], "at least 2 known ranges"),
        (["--estimate-photometry", "camera.json"], "header u,v,range"),
        (["--lights", "known.csv", "--known-range", "80,60,12"], "is not JSON"),
        (["--estimate-photometry", "known.csv", "--light", "distant"], "belong to a light at the camera"),
    ],
)
def test_what_does_not_fit_together_is_said(folder, tmp_path, capsys, more, message):
    more = [f"{folder}/{word}" if "." in word and "," not in word else word for word in more]
    assert main(words(folder, "--out", f"{tmp_path}/out", *more)) == 2
    assert message in capsys.readouterr().err
    assert not (tmp_path / "out").exists()
