"""The advancing front: where it is in each frame, and what other programs read in the files."""

import cv2
import numpy as np
import pytest
from PIL import Image

from jaxsfs import files
from jaxsfs.animation import front_frames

FRONT = np.array([255, 225, 80])


def cone() -> tuple[np.ndarray, np.ndarray]:
    """A grey photograph, and a front that arrives at distance ρ from the middle at ρ; outside the disc never."""
    v, u = np.indices((120, 160))
    time = np.hypot(u - 80, v - 60)
    return np.full((120, 160, 3), 200, np.uint8), np.where(time < 55, time, np.nan)


def frames(**more) -> list[np.ndarray]:
    rgb, time = cone()
    return list(front_frames(rgb, time, frames=12, logarithmic=False, **more))


def test_the_front_stands_where_its_time_says():
    _, time = cone()
    found = frames()
    assert len(found) == 12
    for frame, moment in list(zip(found, np.linspace(0, np.nanquantile(time, 0.995), 12), strict=True))[2:]:
        on_front = (np.abs(frame[:100].astype(int) - FRONT) < 40).all(axis=-1)  # below is the label
        assert on_front.sum() > 50
        assert np.nanmax(np.abs(time[:100][on_front] - moment)) < 3
        ahead = time[:100] > moment + 3
        behind = time[:100] < moment - 3
        assert frame[:100][ahead].max(initial=0) < 130  # dimmed to 60, but for earlier fronts
        assert np.median(frame[:100][behind]) == 200


def test_large_photographs_are_made_smaller_and_even():
    rgb, time = np.zeros((700, 999, 3), np.uint8), np.add.outer(np.arange(700.0), np.arange(999.0))
    first = next(front_frames(rgb, time, logarithmic=False))
    assert first.shape == (336, 480, 3)


def test_nothing_to_animate():
    with pytest.raises(ValueError, match="the front reaches no pixel"):
        next(front_frames(np.zeros((9, 9, 3), np.uint8), np.full((9, 9), np.nan)))
    with pytest.raises(ValueError, match="at least 2 frames, got 1"):
        next(front_frames(np.zeros((9, 9, 3), np.uint8), np.ones((9, 9)), frames=1))


def test_a_gif_as_pillow_reads_it(tmp_path):
    found = frames()
    files.write_animation(tmp_path / "front.gif", iter(found), per_second=10)
    with Image.open(tmp_path / "front.gif") as gif:
        assert (gif.n_frames, gif.size, gif.info["loop"]) == (12, (160, 120), 0)
        assert gif.info["duration"] == 100
        gif.seek(8)
        error = np.abs(np.asarray(gif.convert("RGB")).astype(int) - found[8])
        assert error.mean() < 6
        gif.seek(11)
        assert gif.info["duration"] == 1500


def test_an_mp4_as_opencv_reads_it(tmp_path):
    found = frames()
    files.write_animation(tmp_path / "front.mp4", found, per_second=10)
    video = cv2.VideoCapture(str(tmp_path / "front.mp4"))
    assert video.get(cv2.CAP_PROP_FPS) == 10
    assert video.get(cv2.CAP_PROP_FRAME_COUNT) == 12 + 15
    for frame in found:
        good, read = video.read()
        assert good
        assert np.abs(read[..., ::-1].astype(int) - frame).mean() < 12
    video.release()


def test_other_endings(tmp_path):
    with pytest.raises(files.InputError, match=r"\.gif or \.mp4, got 'front.avi'"):
        files.write_animation(tmp_path / "front.avi", frames())
    with pytest.raises(ValueError, match="at least one frame"):
        files.write_animation(tmp_path / "front.gif", [])
