"""The command line as a user meets it: render, reconstruct, evaluate, rectify."""

import json
import re
import shlex
import shutil

import cv2
import numpy as np
import pytest
import tifffile
from cli_folders import reconstruct, record

from jaxsfs import files
from jaxsfs.cli import main
from jaxsfs.cli._reconstruct_input import _as_seen
from jaxsfs.field import find_field
from jaxsfs.reconstruction import Reconstruction

WRITTEN = {
    *("range.tiff", "depth.tiff", "normals.tiff", "mask.png", "mesh.ply", "mesh.glb", "depth.png", "shaded.png"),
    *("result.json", "report.html"),
}


def test_what_render_writes(view):
    assert {p.name for p in view.iterdir()} == {"image.png", "range.tiff", "normals.tiff", "camera.json", "scene.json"}
    assert cv2.imread(str(view / "image.png"), cv2.IMREAD_UNCHANGED).dtype == np.uint16
    assert json.loads((view / "camera.json").read_text())["photometry"]["falloff"] == "cos:1"


def test_render_again_from_its_own_files(view, tmp_path):
    words = [
        "render",
        str(view / "scene.json"),
        "--camera",
        str(view / "camera.json"),
        "--out",
        str(tmp_path / "again"),
    ]
    assert main(words) == 0
    for name in ("image.png", "range.tiff", "normals.tiff", "scene.json"):
        assert (tmp_path / "again" / name).read_bytes() == (view / name).read_bytes()


def test_what_reconstruct_writes(result):
    assert {p.name for p in result.iterdir()} == WRITTEN
    said = record(result)
    assert said["status"]["trustworthy"] is True
    assert said["status"]["name"] == "good"
    assert said["unit"] == "scene units"
    assert said["camera"]["model"] == "spherical"
    assert {"jax", "jaxsfs", "numpy", "python"} <= set(said["versions"])
    assert said["command"].startswith("jaxsfs reconstruct ")
    known = np.isfinite(tifffile.imread(result / "range.tiff"))
    assert known.sum() == said["figures"]["solution"]["valid_pixels"]
    assert (
        said["figures"]["range"]["nearest"] < said["figures"]["range"]["median"] < said["figures"]["range"]["farthest"]
    )


def test_animate_and_no_report(view, tmp_path):
    assert main(reconstruct(view, tmp_path / "out", "--animate", "gif", "--no-report")) == 0
    assert {p.name for p in (tmp_path / "out").iterdir()} == WRITTEN - {"report.html"} | {"front.gif"}


def test_the_recorded_command_gives_the_same_result(result, tmp_path):
    words = shlex.split(record(result)["command"])[1:]
    words[words.index("--out") + 1] = str(tmp_path / "again")
    assert main(words) == 0
    assert (tmp_path / "again/range.tiff").read_bytes() == (result / "range.tiff").read_bytes()


def test_evaluate_says_how_it_compared(view, result, capsys):
    words = ["evaluate", str(result), str(view), "--align", "none", "--camera", str(view / "camera.json")]
    capsys.readouterr()
    assert main([*words, "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert said["abs_rel"] < 2e-3
    assert said["fraction"] > 0.85
    assert said["normals"]["mean_deg"] < 2
    assert (said["align"], said["quantity"], said["scale"]) == ("none", "range", 1.0)
    assert said["truth"].endswith("range.tiff")
    assert main(words) == 0
    table = capsys.readouterr().out
    assert re.search(r"^alignment +none$", table, re.M)
    assert re.search(r"^quantity +range$", table, re.M)
    assert re.search(r"^normals +mean", table, re.M)


def test_evaluate_with_damaged_normals(view, result, tmp_path, capsys):
    shutil.copytree(view, tmp_path / "view")
    (tmp_path / "view/normals.tiff").write_bytes(b"II*\0damaged")
    camera = ["--camera", str(view / "camera.json")]
    assert main(["evaluate", str(result), str(tmp_path / "view"), *camera]) == 2
    assert "normals.tiff" in capsys.readouterr().err
    assert main(["evaluate", str(result), str(tmp_path / "view")]) == 0


def test_evaluate_depth_of_folders_and_files(view, result, tmp_path, capsys):
    camera = ["--camera", str(view / "camera.json")]
    by_folder = ["evaluate", str(result), str(view), "--quantity", "depth", *camera, "--json"]
    by_file = ["evaluate", str(result / "depth.tiff"), str(view / "range.tiff"), *by_folder[3:]]
    capsys.readouterr()
    outputs = []
    for words in (by_folder, by_file):
        assert main(words) == 0
        outputs.append(json.loads(capsys.readouterr().out))
    assert outputs[0]["quantity"] == outputs[1]["quantity"] == "depth"
    assert outputs[0]["abs_rel"] == outputs[1]["abs_rel"]
    # without a camera a depth is not compared with a range
    assert main(["evaluate", str(result / "depth.tiff"), str(view / "range.tiff")]) == 2
    assert "a camera is needed" in capsys.readouterr().err


def test_evaluate_a_png_with_its_scale(view, tmp_path, capsys):
    truth = tifffile.imread(view / "range.tiff")
    files.write_png(tmp_path / "truth.png", np.nan_to_num(1000 * truth).astype(np.uint16))
    words = ["evaluate", str(view), str(tmp_path / "truth.png"), "--align", "none", "--json"]
    capsys.readouterr()
    assert main([*words, "--truth-scale", "0.001"]) == 0
    assert json.loads(capsys.readouterr().out)["abs_rel"] < 1e-3
    assert main(words) == 2
    assert "whole numbers" in capsys.readouterr().err


def test_the_border_of_a_linear_picture_is_what_looks_dark():
    """A dim 16-bit picture: its tissue is as small in linear light as a border in stored values."""
    v, u = np.indices((120, 160))
    field = np.hypot(u - 80, v - 60) < 50
    linear = np.where(field, 0.004 + 0.002 * np.sin(u / 9), 1e-5).astype(np.float32)
    assert find_field(linear).mask.all()
    found = find_field(_as_seen(linear)).mask
    assert (found & field).sum() > 0.88 * (found | field).sum()


def test_rectify(view, tmp_path, capsys):
    words = ["rectify", str(view / "image.png"), "--camera", str(view / "camera.json"), "--half-field", "40"]
    capsys.readouterr()
    assert main([*words, "--out", str(tmp_path / "flat.png"), "--json"]) == 0
    target = json.loads(capsys.readouterr().out)
    assert target["model"] == "perspective"
    assert target["fx"] == pytest.approx(48 / np.tan(np.deg2rad(40)), rel=1e-5)
    before = cv2.imread(str(view / "image.png"), cv2.IMREAD_UNCHANGED)
    after = cv2.imread(str(tmp_path / "flat.png"), cv2.IMREAD_UNCHANGED)
    assert after.dtype == np.uint16
    assert after.shape == before.shape
    np.testing.assert_allclose(after[46:50, 46:50], before[46:50, 46:50], rtol=0.02)
    assert (after[48, :3] > 0).all()  # 40 degrees at the border, 50 in the photograph


def test_json_goes_to_stdout_and_is_the_file(view, tmp_path, capsys):
    capsys.readouterr()
    assert main(reconstruct(view, tmp_path / "out", "--json")) == 0
    said = capsys.readouterr()
    assert said.out == (tmp_path / "out/result.json").read_text()
    assert said.err == ""


def test_the_summary_says_what_was_assumed(view, tmp_path, capsys):
    capsys.readouterr()
    assert main(reconstruct(view, tmp_path / "out", "--reflectance", "lambertian")) == 0
    text = capsys.readouterr().out
    assert re.search(r"response +srgb \(camera file\)", text)
    assert re.search(r"reflectance +lambertian \(command line\)", text)
    assert re.search(r"channel +luminance \(default\)", text)
    assert re.search(r"mask +round field of .* \(automatic\)", text)


def test_a_plateau_below_the_limit_is_warned_of_and_unknown_if_asked(view, tmp_path, capsys):
    picture = cv2.imread(str(view / "image.png"), cv2.IMREAD_UNCHANGED)
    limit = int(np.percentile(picture.max(axis=-1), 90))
    cv2.imwrite(str(tmp_path / "image.png"), np.minimum(picture, limit))
    shutil.copy(view / "camera.json", tmp_path)
    assert main(reconstruct(tmp_path, tmp_path / "a", "--no-report")) == 0
    said = capsys.readouterr().out
    assert "of the pixels share the highest value" in said
    assert "s before the solver" in said
    assert record(tmp_path / "a")["figures"]["photograph"]["plateau"]["share"] > 0.05
    assert set(record(tmp_path / "a")["seconds"]) == {"start", "read", "irradiance", "solve"}
    assert main(reconstruct(tmp_path, tmp_path / "b", "--no-report", "--clip-limit", "highest")) == 0
    assert "share the highest value" not in capsys.readouterr().out
    assert record(tmp_path / "b")["options"]["clip_limit"]["value"] == pytest.approx(limit / 65535)
    figures = record(tmp_path / "b")["figures"]["preparation"]
    assert figures["restored_from_other_channels"] + figures["filled_from_surroundings"] > 300
    assert main(reconstruct(tmp_path, tmp_path / "c", "--clip-limit", "most")) == 2
    assert "--clip-limit must be" in capsys.readouterr().err


def test_an_existing_result_is_kept_without_force(view, result, capsys):
    before = (result / "result.json").read_bytes()
    assert main(reconstruct(view, result)) == 2
    assert "overwrite it (--force)" in capsys.readouterr().err
    assert (result / "result.json").read_bytes() == before


def test_a_known_range_sets_the_scale(view, result, tmp_path):
    assert main(reconstruct(view, tmp_path / "out", "--known-range", "40,50,12.5")) == 0
    scaled, plain = tifffile.imread(tmp_path / "out/range.tiff"), tifffile.imread(result / "range.tiff")
    assert scaled[50, 40] == pytest.approx(12.5, rel=1e-6)
    ratio = scaled / plain
    assert np.nanmax(ratio) / np.nanmin(ratio) == pytest.approx(1, abs=1e-3)
    assert record(tmp_path / "out")["unit"] == "mm"
    assert b"comment unit mm" in (tmp_path / "out/mesh.ply").read_bytes()[:400]


@pytest.mark.parametrize(
    ("solver", "form"),
    [
        ("sweeping", "singular-point"),
        ("sweeping", "singular-point:48,48"),
        ("sweeping", "singular-point:48,48,{range}"),
        ("sweeping", "threshold:{bright}"),
        ("sweeping", "curve:{mask},{range}"),
        pytest.param("level-set", "deadline", marks=pytest.mark.slow),
    ],
)
def test_initial_conditions(view, result, tmp_path, solver, form):
    """From other initial curves the surface near them is that of the deadlines."""
    plain = tifffile.imread(result / "range.tiff")
    mask = np.zeros((96, 96), np.uint8)
    mask[48, 48] = 255
    files.write_png(tmp_path / "mask.png", mask)
    bright = 0.9 * record(result)["figures"]["photograph"]["largest"]
    form = form.format(mask=tmp_path / "mask.png", range=plain[48, 48], bright=bright)
    words = ["--initial", form, "--solver", solver, "--json"]
    assert main(reconstruct(view, tmp_path / "out", *words)) in (0, 3)
    assert record(tmp_path / "out")["options"]["initial"] == {"value": form, "origin": "command line"}
    found = tifffile.imread(tmp_path / "out/range.tiff")
    near = np.s_[45:52, 45:52]
    np.testing.assert_allclose(found[near], plain[near], rtol=0.03)


@pytest.mark.slow
def test_double_precision(view, result, tmp_path):
    assert main(reconstruct(view, tmp_path / "out", "--precision", "64")) == 0
    np.testing.assert_allclose(
        tifffile.imread(tmp_path / "out/range.tiff"), tifffile.imread(result / "range.tiff"), rtol=1e-3
    )


@pytest.mark.slow
def test_a_distant_light_with_heights(tmp_path):
    assert main(["render", "vase", "--width", "64", "--height", "64", "--out", str(tmp_path / "vase")]) == 0
    z = tifffile.imread(tmp_path / "vase/range.tiff")
    v, u = np.unravel_index(np.nanargmin(z), z.shape)
    (tmp_path / "heights.csv").write_text(f"u,v,z\n{u},{v},{z[v, u]}\n")
    words = ["--light", "distant", "--heights", str(tmp_path / "heights.csv")]
    assert main(reconstruct(tmp_path / "vase", tmp_path / "out", *words)) in (0, 3)
    assert tifffile.imread(tmp_path / "out/range.tiff")[v, u] == pytest.approx(z[v, u], abs=1e-3)
    assert record(tmp_path / "out")["options"]["initial"]["value"].startswith("heights:")


def test_a_result_that_is_not_to_be_trusted_is_written_with_exit_code_3(view, tmp_path, capsys):
    """Two rows of pixels are no surface."""
    mask = np.zeros((96, 96), np.uint8)
    mask[48, 40:46] = 255
    files.write_png(tmp_path / "mask.png", mask)
    assert main(reconstruct(view, tmp_path / "out", "--mask", str(tmp_path / "mask.png"))) == 3
    assert record(tmp_path / "out")["status"] == {
        "name": "few-pixels",
        "message": "Too few valid pixels for a surface: check the mask and the exposure.",
        "trustworthy": False,
    }
    assert "check the mask" in capsys.readouterr().out
    assert {p.name for p in (tmp_path / "out").iterdir()} == WRITTEN


def test_the_result_is_the_same_as_in_python(view, result):
    """The command line adds nothing to the library."""
    import jax

    from jaxsfs.cli._pipeline import solve
    from jaxsfs.photo import clipping_limit, irradiance_of
    from jaxsfs.photometry import parse_falloff, parse_response

    photo = files.read_image(view / "image.png")
    given = files.read_camera(view / "camera.json")
    with jax.enable_x64(False):
        irradiance, _ = irradiance_of(
            photo.values,
            given.camera,
            valid=files.read_mask(result / "mask.png"),
            response=parse_response("srgb"),
            falloff=parse_falloff("cos:1"),
            clip_limit=clipping_limit(photo.dtype),
        )
        found = solve(irradiance, given.camera, albedo=given.photometry["gain_albedo"])
    assert isinstance(found, Reconstruction)
    stored = tifffile.imread(result / "range.tiff")
    np.testing.assert_allclose(np.where(found.surface.valid, found.surface.range, np.nan), stored, rtol=1e-5)
