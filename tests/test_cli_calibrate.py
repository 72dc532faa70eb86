"""`jaxsfs calibrate …` as a user runs it."""

import json
import re

import cv2
import numpy as np
import pytest
import tifffile

from data_synth.target_patterns import BlankSheet, LineGrid, Rings
from data_synth.targets import Studio, photograph
from jaxsfs import files
from jaxsfs.calibration import tilted
from jaxsfs.camera import Spherical
from jaxsfs.cli import main

RADII = (5.0, 10.0, 15.0, 20.0, 25.0, 30.0)
LISTED = ["--radii", *(f"{radius:g}" for radius in RADII)]
CAMERA = Spherical(320.0, 327.0, 236.0, 640, 480)
GAIN = 320.0  # mm²


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Two photographs of rings under one exposure, one of a line grid, one of blank paper."""
    path = tmp_path_factory.mktemp("targets")
    rings = Rings(RADII, 0.8, 1.0)
    views = {
        "a.png": (rings, tilted(3.0, 40.0, 22.0, (1.0, 0.5))),
        "b.png": (rings, tilted(16.0, 140.0, 23.0)),
        "grid.png": (LineGrid(4.0, 0.5, 12), tilted(15.0, 70.0, 20.0, (2.0, 1.0), 10.0)),
        "blank.png": (BlankSheet(), tilted(3.0, 0.0, 22.0)),
    }
    for seed, (name, (pattern, pose)) in enumerate(views.items()):
        files.write_png(path / name, photograph(CAMERA, pattern, pose, Studio(), seed, gain=GAIN))
    return path


@pytest.fixture(scope="module")
def calibrated(folder):
    assert (
        main(["calibrate", "circles", f"{folder}/a.png", f"{folder}/b.png", *LISTED, "--out", f"{folder}/c.json"]) == 0
    )
    return folder


@pytest.mark.slow
def test_circles_write_a_camera_that_reconstruct_accepts(calibrated):
    file = files.read_camera(calibrated / "c.json")
    assert isinstance(file.camera, Spherical)
    assert float(file.camera.f) == pytest.approx(320.0, rel=5e-4)
    made = file.other["calibration"]
    assert made["f_sd"] > 0
    assert np.shape(made["uncertainty"]["covariance"]) == (8, 8)
    assert [row["file"] for row in made["inputs"]] == [f"{calibrated}/a.png", f"{calibrated}/b.png"]
    assert made["command"].startswith("jaxsfs calibrate circles")
    assert made["photographs"][1]["tilt_deg"] == pytest.approx(16.0, abs=0.2)


def test_the_report_is_one_file_with_pictures_and_no_network(calibrated):
    page = (calibrated / "c.report.html").read_text(encoding="utf-8")
    assert page.count('<svg class="over"') == 2  # a photograph each
    assert page.count('src="data:image/') == 4  # coverage, uncertainty, stored, rectified
    assert "http" not in re.sub(r'base64,[^"]+', "", page).replace("http-equiv", "")
    assert "<script" not in page
    assert "The lens obeys r = f sin α" in page


def test_white_paper_under_the_rings_gives_the_photometry(calibrated, capsys):
    out = calibrated / "photometric.json"
    images = [f"{calibrated}/a.png", f"{calibrated}/b.png"]
    assert main(["calibrate", "white", *images, "--camera", f"{calibrated}/c.json", "--out", str(out), "--json"]) == 0
    figures = json.loads(capsys.readouterr().out)
    assert figures["response"] == "srgb"
    photometry = files.read_camera(out).photometry
    assert photometry["unit"] == "mm"
    assert photometry["gain_albedo"] == pytest.approx(GAIN, rel=0.02)
    assert (calibrated / "photometric.report.html").exists()


def test_white_needs_to_know_how_the_sheet_stood(calibrated, capsys):
    words = ["calibrate", "white", f"{calibrated}/blank.png", "--camera", f"{calibrated}/c.json"]
    assert main([*words, "--out", f"{calibrated}/w.json"]) == 2
    assert "give --height (mm)" in capsys.readouterr().err
    assert main([*words, "--height", "22", "23", "--out", f"{calibrated}/w.json"]) == 2
    assert "one for each of 1 photographs" in capsys.readouterr().err
    assert not (calibrated / "w.json").exists()


def test_grid_prints_json_and_keeps_the_straightness_curve(folder, capsys):
    assert main(["calibrate", "grid", f"{folder}/grid.png", "--out", f"{folder}/g.json", "--json"]) == 0
    record = json.loads(capsys.readouterr().out)
    assert record["f"] == pytest.approx(320.0, rel=2e-3)
    assert len(record["calibration"]["straightness"]["sampson_px"]) > 10
    assert "naive" not in record
    assert "straightness" in (folder / "g.report.html").read_text(encoding="utf-8")


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["circles", "a.png"], "--radii is missing"),
        (["circles", "a.png", "--radii", "5"], "at least two rings"),
        (["circles", "a.png", "--radii", "5", "4", "9"], "increasing"),
        (["circles", "a.png", *LISTED, "--height", "0.022"], "in mm"),
        (["circles", "a.png", *LISTED, "--model", "sine"], "unknown"),
        (["circles", "a.png", "a.png", *LISTED], "the same photograph"),
        (["circles", "a.png", "small.png", *LISTED], "sizes differ"),
        (["circles", "missing.png", *LISTED], "there is no file"),
        (["circles", "black.png", *LISTED], "black"),
        (["circles", "white.png", *LISTED], "100% of full scale everywhere"),
        (["checkerboard", "white.png", "--columns", "7", "--rows", "6", "--pitch", "2"], "everywhere"),
        (["grid", "white.png"], "everywhere"),
        (["circles", "dead.tiff", *LISTED], "where the picture is lit (rows 100 to 103"),
        (["circles", "blank.png", *LISTED], "no photograph could be used"),
        (["circles", "a.png", *LISTED, "--response", "log"], "--response"),
        (["checkerboard", "a.png", "--columns", "7"], "all needed"),
        (["checkerboard", "blank.png", "--columns", "7", "--rows", "6", "--pitch", "2"], "count corners between"),
        (["dots", "blank.png", "--columns", "9", "--rows", "8", "--pitch", "0"], "pitch"),
        (["grid", "blank.png"], "no grid found"),
    ],
)
def test_bad_input_is_one_line_and_no_camera_file(folder, capsys, words, message):
    cv2.imwrite(str(folder / "small.png"), np.full((100, 120), 128, np.uint8))
    cv2.imwrite(str(folder / "black.png"), np.zeros((480, 640), np.uint8))
    cv2.imwrite(str(folder / "white.png"), np.full((480, 640), 255, np.uint8))
    dead = cv2.imread(f"{folder}/a.png", cv2.IMREAD_UNCHANGED).astype(np.float32) / 255
    dead[100:104] = np.nan
    tifffile.imwrite(folder / "dead.tiff", dead)
    kind, *rest = words
    rest = [f"{folder}/{word}" if word.endswith((".png", ".tiff")) else word for word in rest]
    assert main(["calibrate", kind, *rest, "--out", f"{folder}/bad.json"]) == 2
    error = capsys.readouterr().err
    assert message in error
    assert error.count("\n") == 1
    assert not (folder / "bad.json").exists()


def test_outputs_are_checked_before_any_work(folder, capsys):
    (folder / "old.json").write_text("{}")
    assert main(["calibrate", "circles", f"{folder}/a.png", *LISTED, "--out", f"{folder}/old.json"]) == 2
    assert "--force" in capsys.readouterr().err
    assert main(["calibrate", "circles", f"{folder}/a.png", *LISTED, "--out", f"{folder}/old.yaml"]) == 2
    assert "camera.json" in capsys.readouterr().err


def test_the_group_alone_lists_its_kinds(capsys):
    assert main(["calibrate"]) == 0
    assert "calibrate circles" in capsys.readouterr().out
    assert main(["calibrate", "ovals"]) == 2
    assert "there is no command 'calibrate ovals'" in capsys.readouterr().err
