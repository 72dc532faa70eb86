"""`jaxsfs watch`: overlays of a folder and of a video, a page for this machine alone, frames dropped, a clean end."""

import http.client
import re
import signal
import subprocess
import sys
import threading
import time
from pathlib import Path

import cv2
import numpy as np
import pytest

from data_synth import WavyWall, render_scene
from jaxsfs import files
from jaxsfs.cli import main
from jaxsfs.watch import Newest, Page


@pytest.fixture(scope="module")
def scene():
    return render_scene(WavyWall(1.4, 0.03, 6.0), width=96, height=96)


@pytest.fixture(scope="module")
def folder(scene, tmp_path_factory) -> Path:
    path = tmp_path_factory.mktemp("frames")
    files.write_camera(path / "camera.json", scene.camera_file)
    for index in range(3):
        files.write_png(path / f"{index}.png", scene.photo.stored)
    return path


@pytest.fixture(scope="module")
def video(scene, tmp_path_factory) -> Path:
    """Forty frames, 100 a second."""
    path = tmp_path_factory.mktemp("video") / "a.avi"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), 100, (96, 96))
    for _ in range(40):
        writer.write(np.ascontiguousarray(scene.photo.stored[..., ::-1]))
    writer.release()
    return path


def camera(folder: Path) -> list[str]:
    return ["--camera", str(folder / "camera.json")]


def test_a_folder_drops_nothing(folder, scene, tmp_path, capsys):
    assert main(["watch", str(folder), *camera(folder), "--out", str(tmp_path / "o"), "--reduce", "1"]) == 0
    assert "3 overlays" in (out := capsys.readouterr().out)
    assert "0 frames dropped" in out
    names = sorted(path.name for path in (tmp_path / "o").iterdir())
    assert names == ["000000.png", "000001.png", "000002.png"]
    shown = cv2.imread(str(tmp_path / "o" / "000000.png"))[..., ::-1].astype(int)
    # viridis: near is yellow (green without blue), far is violet (blue without green)
    colours = shown - 0.4 * scene.photo.stored
    blueness = (colours[..., 2] - colours[..., 1])[scene.valid]
    near, far = (np.nanpercentile(scene.range, share) for share in (10, 90))
    distance = scene.range[scene.valid]
    assert np.median(blueness[distance > far]) > np.median(blueness[distance < near]) + 50
    np.testing.assert_array_equal(shown[0, 0], scene.photo.stored[0, 0])
    assert main(["watch", str(folder), *camera(folder), "--out", str(tmp_path / "o")]) == 2
    assert "not empty" in capsys.readouterr().err


def test_a_video_is_not_slower_than_itself(folder, video, tmp_path, capsys):
    """40 frames in 0.4 s are more than can be solved: the rest is dropped, none is shown twice."""
    assert main(["watch", str(video), *camera(folder), "--out", str(tmp_path / "o"), "--reduce", "1"]) == 0
    shown, dropped = re.findall(r"(\d+) (?:overlays|frames dropped)", capsys.readouterr().out)
    assert int(shown) == len(list((tmp_path / "o").iterdir())) >= 1
    assert int(shown) + int(dropped) == 40
    assert int(dropped) >= 1


def test_newest_skips_to_the_last(video):
    newest = Newest(str(video))
    assert newest.next() is not None
    time.sleep(0.6)
    assert newest.next() is not None
    assert newest.next() is None
    assert newest.dropped == 38
    newest.close()


def test_the_page_is_for_this_machine_alone():
    page = Page(0)
    port = int(page.url.rsplit(":", 1)[1].rstrip("/"))
    try:
        assert page.url.startswith("http://127.0.0.1:")
        for path, host, expected in (
            ("/", "127.0.0.1", 200),
            ("/etc/passwd", "127.0.0.1", 404),
            ("/", "evil.org", 403),
        ):
            connection = http.client.HTTPConnection("127.0.0.1", port, timeout=5)
            connection.request("GET", path, headers={"Host": host})
            assert connection.getresponse().status == expected
            connection.close()
        connection = http.client.HTTPConnection("127.0.0.1", port, timeout=5)
        connection.request("GET", "/stream")
        response = connection.getresponse()
        threading.Timer(0.2, page.show, [np.full((8, 8, 3), 200, np.uint8)]).start()
        head = b"".join(response.readline() for _ in range(4))
        size = int(re.search(rb"Content-Length: (\d+)", head)[1])
        picture = cv2.imdecode(np.frombuffer(response.read(size), np.uint8), cv2.IMREAD_COLOR)
        assert np.abs(picture.astype(int) - 200).max() <= 2
    finally:
        page.close()
    connection.close()


def test_bad_words(folder, capsys):
    assert main(["watch", str(folder), *camera(folder), "--strength", "2"]) == 2
    assert main(["watch", "nowhere", *camera(folder)]) == 2
    assert "there is no file or folder nowhere" in capsys.readouterr().err


def test_a_plateau_below_the_limit_is_warned_of(folder, scene, tmp_path, capsys):
    (tmp_path / "in").mkdir()
    stored = scene.photo.stored
    cut = np.minimum(stored, int(np.percentile(stored.max(axis=-1), 80)))
    files.write_png(tmp_path / "in" / "0.png", cut)
    command = ["watch", str(tmp_path / "in"), *camera(folder), "--reduce", "2"]
    assert main([*command, "--out", str(tmp_path / "a")]) == 0
    assert "--clip-limit highest" in capsys.readouterr().err
    assert main([*command, "--out", str(tmp_path / "b"), "--clip-limit", "highest"]) == 0
    assert "warning" not in capsys.readouterr().err
    as_data, unknown = ((tmp_path / out / "000000.png").read_bytes() for out in "ab")
    assert as_data != unknown
    assert main([*command, "--out", str(tmp_path / "c"), "--clip-limit", "-1"]) == 2
    assert "--clip-limit must be" in capsys.readouterr().err


@pytest.mark.slow
@pytest.mark.usefixtures("heeds_interrupts")
def test_ctrl_c_ends_it(folder, scene, tmp_path):
    writer = cv2.VideoWriter(str(tmp_path / "long.avi"), cv2.VideoWriter.fourcc(*"MJPG"), 25, (96, 96))
    for _ in range(3000):
        writer.write(np.ascontiguousarray(scene.photo.stored[..., ::-1]))
    writer.release()
    words = [sys.executable, "-m", "jaxsfs.cli", "watch", str(tmp_path / "long.avi"), *camera(folder), "--port", "0"]
    run = subprocess.Popen(words, stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    assert run.stderr is not None
    url = re.search(r"http://127\.0\.0\.1:(\d+)/", run.stderr.readline())
    connection = http.client.HTTPConnection("127.0.0.1", int(url[1]), timeout=120)
    connection.request("GET", "/stream")
    assert connection.getresponse().readline().startswith(b"--frame")
    run.send_signal(signal.SIGINT)
    out, err = run.communicate(timeout=30)
    connection.close()
    assert run.returncode == 0, err
    assert "overlays in" in out
    assert "Traceback" not in err
