"""`jaxsfs video`: every frame once, resumable, one bad frame stops nothing, and a locked scale does not flicker."""

import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import cv2
import numpy as np
import pytest

from data_synth import WavyWall, render_scene
from jaxsfs import files
from jaxsfs.cli import main
from jaxsfs.files._frames import open_frames
from jaxsfs.files._store import FrameStore, create_store
from jaxsfs.frames import FIGURES, STATUSES, FrameSettings, reconstruct_frame
from jaxsfs.photometry import NoFalloff, parse_response
from jaxsfs.reflectance import Lambertian

xarray = pytest.importorskip("xarray", reason="the extra cluster is not installed")
pytest.importorskip("zarr", reason="the extra cluster is not installed")

SIZE = 96


@pytest.fixture(scope="module")
def scene():
    return render_scene(WavyWall(1.4, 0.03, 6.0), width=SIZE, height=SIZE, bits=16)


@pytest.fixture(scope="module")
def folder(scene, tmp_path_factory) -> Path:
    """Ten pictures; number 4 is black and number 6 is no picture."""
    path = tmp_path_factory.mktemp("frames")
    files.write_camera(path / "camera.json", scene.camera_file)
    photo = scene.photo.stored
    for index in range(10):
        gain = 1.0 if index % 2 else 0.7
        linear = np.clip((photo / 65535) ** 2.2 * gain, 0, 1)
        stored = np.round(255 * linear ** (1 / 2.2)).astype(np.uint8)
        files.write_png(path / f"frame{index}.png", np.zeros_like(stored) if index == 4 else stored)
    (path / "frame6.png").write_bytes(b"no picture")
    return path


def run(folder: Path, out: Path, *words: str) -> int:
    return main(["video", str(folder), "--camera", str(folder / "camera.json"), "--out", str(out), *words])


def test_every_frame_has_a_status(folder, scene, tmp_path, capsys):
    assert run(folder, tmp_path / "r.zarr", "--batch", "3", "--json") == 0
    record = json.loads(capsys.readouterr().out)
    assert record["statuses"] == {"good": 8, "unusable": 1, "unreadable": 1}
    with xarray.open_zarr(tmp_path / "r.zarr") as data:
        assert data.range.dims == ("frame", "v", "u")
        assert data.range.shape == (10, SIZE, SIZE)
        meanings = data.status.attrs["flag_meanings"].split()
        assert [meanings[number + 1] for number in data.status.values[[3, 4, 6]]] == ["good", "unusable", "unreadable"]
        assert not data.valid.values[[4, 6]].any()
        assert np.isnan(data.range.values[4]).all()
        np.testing.assert_array_equal(np.isfinite(data.range.values), data.valid.values)
        assert data.attrs["camera"]["model"] == "spherical"
        good = data.range.values[1]
        error = np.abs(good * np.nanmedian(scene.range) / np.nanmedian(good) / scene.range - 1)
        assert np.nanmean(error) < 0.01
        assert data.valid_pixels.values[1] == data.valid.values[1].sum()


@pytest.fixture(scope="module")
def flat_topped(scene, tmp_path_factory) -> Path:
    """Two 16-bit pictures that stop below the type's limit."""
    path = tmp_path_factory.mktemp("flat")
    files.write_camera(path / "camera.json", scene.camera_file)
    stored = scene.photo.stored
    for index in range(2):
        cut = np.minimum(stored, int(np.percentile(stored.max(axis=-1), 80)))
        files.write_png(path / f"frame{index}.png", cut)
    return path


def test_a_plateau_below_the_limit_is_warned_of_and_unknown_if_asked(flat_topped, tmp_path, capsys):
    assert run(flat_topped, tmp_path / "a.zarr", "--json") == 0
    said = capsys.readouterr()
    assert "--clip-limit highest" in said.err
    found = json.loads(said.out)["plateau"]
    assert found["share"] > 0.1
    assert run(flat_topped, tmp_path / "b.zarr", "--clip-limit", "highest") == 0
    assert "warning" not in capsys.readouterr().err
    assert FrameStore(tmp_path / "b.zarr").attributes["settings"]["clip_limit"]["value"] == found["value"]
    with xarray.open_zarr(tmp_path / "a.zarr") as left, xarray.open_zarr(tmp_path / "b.zarr") as out:
        assert left.clipped_pixels.values.tolist() == [0, 0]
        assert (out.clipped_pixels.values > 0.1 * SIZE**2).all()
    assert run(flat_topped, tmp_path / "c.zarr", "--clip-limit", "most") == 2
    assert "--clip-limit must be" in capsys.readouterr().err


@pytest.mark.parametrize("dtype", [np.uint16, np.float32])
def test_a_limit_means_the_stored_value_whatever_the_response(scene, dtype):
    stored = scene.photo.stored if dtype == np.uint16 else (scene.photo.stored / 65535).astype(np.float32)
    green = scene.photo.stored[..., 1] / 65535
    limit = float(np.percentile(green[scene.valid], 80))
    response = parse_response("gamma:2.2")
    settings = FrameSettings(
        scene.camera_file.camera, scene.valid, response, NoFalloff(), Lambertian(), (0, 1, 0), clip_limit=limit
    )
    expected = ((green >= limit) & scene.valid).sum()
    assert 100 < expected < scene.valid.sum()
    assert reconstruct_frame(stored, settings).figures["clipped_pixels"] == expected


def test_a_second_run_computes_what_is_missing(folder, tmp_path, capsys, monkeypatch):
    out = tmp_path / "r.zarr"
    assert run(folder, out, "--batch", "3") == 0
    before = FrameStore(out).statuses()
    group = FrameStore(out)._group
    group["status"][3:6] = -1
    group["range"][3:6] = 0
    capsys.readouterr()
    assert run(folder, out, "--batch", "3", "--json") == 0
    assert json.loads(capsys.readouterr().out)["computed"] == 3
    np.testing.assert_array_equal(FrameStore(out).statuses(), before)
    assert np.nanmin(group["range"][3:6]) > 0
    assert run(folder, out, "--batch", "3", "--rounds", "6") == 2
    assert "other settings" in capsys.readouterr().err
    assert run(folder, out, "--frames", "0:4") == 2
    assert "other frames" in capsys.readouterr().err
    assert run(folder, out, "--frames", "0:4", "--force") == 0
    assert len(FrameStore(out).indices) == 4


def test_a_folder_of_something_else_is_left_alone(folder, tmp_path, capsys):
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "thesis.txt").write_text("years of work")
    assert run(folder, tmp_path / "mine", "--force") == 2
    assert "is no store of frames" in capsys.readouterr().err
    assert (tmp_path / "mine" / "thesis.txt").exists()


def test_scale_locked_and_per_frame(folder, tmp_path):
    """With one gain, frames of 0.7 of the light are √(1/0.7) farther, and equal frames are equal: nothing flickers."""
    assert run(folder, tmp_path / "locked.zarr", "--frames", "0:4") == 0
    assert run(folder, tmp_path / "frame.zarr", "--frames", "0:4", "--scale", "frame") == 0
    with xarray.open_zarr(tmp_path / "locked.zarr") as locked, xarray.open_zarr(tmp_path / "frame.zarr") as each:
        medians = locked.range.median(("v", "u")).values
        assert medians[0] == medians[2]
        assert medians[0] / medians[1] == pytest.approx(0.7**-0.5, rel=5e-3)
        assert "one gain" in locked.attrs["scale"]
        np.testing.assert_allclose(each.range.median(("v", "u")).values, 1, rtol=1e-6)
        np.testing.assert_allclose(
            each.range.values / each.factor.values[:, None, None], locked.range.values, rtol=1e-5
        )
        assert "median range is 1" in each.attrs["scale"]


def test_noise_does_not_make_a_locked_scale_flicker(scene, folder, tmp_path):
    rng = np.random.default_rng(1)
    clean = scene.photo.stored / 65535
    for index in range(6):
        noisy = clean + 0.01 * rng.standard_normal(clean.shape)
        files.write_png(tmp_path / f"{index}.png", np.round(255 * np.clip(noisy, 0, 1)).astype(np.uint8))
    (tmp_path / "camera.json").write_bytes((folder / "camera.json").read_bytes())
    assert run(tmp_path, tmp_path / "r.zarr") == 0
    with xarray.open_zarr(tmp_path / "r.zarr") as data:
        medians = data.range.median(("v", "u")).values
        assert medians.std() / medians.mean() < 2e-3
        assert (data.valid.sum(("v", "u")).values > 0.95 * data.valid.any("frame").sum().values).all()


@pytest.mark.slow
def test_a_killed_run_goes_on(folder, tmp_path):
    """SIGKILL in the middle: what was stored stays, and the next run ends with every frame."""
    paths = [folder / "frame1.png", folder / "frame2.png"]
    for index in range(60):
        os.link(paths[index % 2], tmp_path / f"{index}.png")
    (tmp_path / "camera.json").write_bytes((folder / "camera.json").read_bytes())
    out = tmp_path / "r.zarr"
    words = [sys.executable, "-m", "jaxsfs.cli", "video", str(tmp_path), "--camera", str(tmp_path / "camera.json")]
    run = subprocess.Popen([*words, "--out", str(out), "--batch", "2", "--threads", "1", "--quiet"])
    deadline = time.monotonic() + 240
    while time.monotonic() < deadline and run.poll() is None:
        if len(list(out.glob("status/c/*"))) >= 3:
            run.send_signal(signal.SIGKILL)
            break
        time.sleep(0.01)
    assert run.wait() == -signal.SIGKILL, "the run was over before it could be killed"
    stored = int((FrameStore(out).statuses() >= 0).sum())
    assert 6 <= stored < 60
    again = subprocess.run([*words, "--out", str(out), "--batch", "2", "--json"], capture_output=True, text=True)
    assert again.returncode == 0, again.stderr
    assert json.loads(again.stdout)["computed"] == 60 - stored
    store = FrameStore(out)
    assert (store.statuses() == 0).all()
    ranges = np.asarray(store._group["range"][:])
    assert np.isfinite(ranges).any(axis=(1, 2)).all()
    np.testing.assert_array_equal(ranges[::2], np.broadcast_to(ranges[0], ranges[::2].shape))


class TestFrames:
    def video(self, path: Path, count: int) -> None:
        writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), 10, (64, 48))
        for index in range(count):
            writer.write(np.full((48, 64, 3), 10 * index, np.uint8))
        writer.release()

    def test_the_frames_of_a_video_by_number(self, tmp_path):
        self.video(tmp_path / "a.avi", 20)
        frames = open_frames(tmp_path / "a.avi")
        assert (frames.count, frames.per_second) == (20, 10)
        for index in (0, 3, 17, 4):
            assert frames.read(index).mean() == pytest.approx(10 * index, abs=3)
        with pytest.raises(files.InputError, match="ends before"):
            frames.read(25)
        frames.close()

    def test_numbers_in_names_count_as_numbers(self, tmp_path):
        for index in (10, 9, 1):
            files.write_png(tmp_path / f"v{index}.png", np.full((4, 4), index, np.uint8))
        frames = open_frames(tmp_path)
        assert [int(frames.read(i)[0, 0]) for i in range(3)] == [1, 9, 10]

    def test_what_is_no_video(self, tmp_path):
        (tmp_path / "a.mp4").write_bytes(b"x" * 300)
        for path, words in (
            (tmp_path / "a.mp4", "no video"),
            (tmp_path / "b.mp4", "no file"),
            (tmp_path, "no picture"),
        ):
            with pytest.raises(files.InputError, match=words):
                open_frames(path)


def test_frames_chosen(folder, tmp_path, capsys):
    assert run(folder, tmp_path / "r.zarr", "--frames", "1:8:2", "--json") == 0
    assert FrameStore(tmp_path / "r.zarr").indices.tolist() == [1, 3, 5, 7]
    for text in ("3", "a:b", "1:2:0", "-3:"):
        assert run(folder, tmp_path / "s.zarr", f"--frames={text}") == 2
    assert run(folder, tmp_path / "s.zarr", "--frames", "20:") == 2
    assert not (tmp_path / "s.zarr").exists()


def test_a_store_that_was_not_finished_being_made_is_none(tmp_path):
    def made():
        return create_store(
            tmp_path / "s.zarr", range(5), (4, 3), statuses=STATUSES, figures=FIGURES, attributes={}, unit="mm", batch=2
        )

    assert made().missing() == [(0, 2), (2, 4), (4, 5)]
    store = made()
    group = store._group
    group.attrs["kind"] = "jaxsfs frames, being made"
    values = {"range": np.ones((2, 3, 4), np.float32), "status": np.zeros(2, np.int8)}
    store.write(0, values)
    assert made().missing() == [(0, 2), (2, 4), (4, 5)]


@pytest.mark.slow
def test_the_experiment_says_how_fast_and_how_still(tmp_path):
    script = Path(__file__).parents[1] / "experiments" / "video.py"
    subprocess.run([sys.executable, str(script), "--quick", "--out", str(tmp_path)], check=True, capture_output=True)
    text = (tmp_path / "video.md").read_text(encoding="utf-8")
    runs = [line.split(" | ")[0].strip("| ") for line in text.splitlines() if line.startswith("| ")][1:]
    assert runs == ["threads", "1 worker", "2 workers"]
    error, deviation = (float(re.search(rf"{words} (0\.\d+)", text)[1]) for words in ("error of range", "deviation of"))
    assert error < 0.15
    assert deviation < 0.1
