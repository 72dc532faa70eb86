"""The C3VD script on a tiny folder in the same format that the test writes itself."""

from pathlib import Path

import cv2
import numpy as np
import pytest
import tifffile

from data_synth import Plane, Tube, observe, take_photo
from jaxsfs import Scaramuzza

FOLDER = Path(__file__).parents[1] / "experiments"
WIDTH, HEIGHT = 60, 48
# the data set's own lens, shrunk
A = (769.2436, 0.0, -8.12770624e-04, 6.25674e-07, -1.196622e-09)
SHRINK = WIDTH / 1350


@pytest.fixture
def c3vd(monkeypatch):
    monkeypatch.syspath_prepend(FOLDER)
    import c3vd

    return c3vd


@pytest.fixture
def root(tmp_path):
    """Two videos of one and two frames: colour PNG, depth TIFF of 16 bit for 0–100 mm, intrinsics as text."""
    root = tmp_path / "c3vd"
    a = tuple(a_n * SHRINK ** (1 - n) for n, a_n in enumerate(A))
    camera = Scaramuzza(a, 29.8, 23.6, WIDTH, HEIGHT)
    scenes = {"cecum_t1_a": [Plane(30.0, 0.1, 0.2)], "trans_t2_b": [Plane(40.0), Tube(20.0, 2.0, 1.0, 70.0)]}
    for video, shapes in scenes.items():
        (root / video).mkdir(parents=True)
        for number, scene in enumerate(shapes):
            view = observe(scene, camera)
            stored = take_photo(view).stored
            cv2.imwrite(str(root / video / f"{number:04d}_color.png"), np.ascontiguousarray(stored[..., ::-1]))
            depth = np.asarray(view.surface.depth())
            coded = np.where(depth <= 100, np.round(depth * 655.35), 0).astype(np.uint16)
            tifffile.imwrite(root / video / f"{number:04d}_depth.tiff", coded)
    lines = [f"width = {WIDTH}", f"height = {HEIGHT}", "cx = 29.8", "cy = 23.6"]
    lines += [f"a{n} = {a_n!r}" for n, a_n in enumerate(a)] + ["c = 1.0", "d = 0.0", "e = 0.0"]
    (root / "camera_intrinsics.txt").write_text("\n".join(lines), encoding="utf-8")
    return root


@pytest.mark.slow
def test_table_per_video_and_total_and_resumes(c3vd, root, tmp_path, monkeypatch):
    rows = c3vd.run(root, tmp_path / "out", 1, None, c3vd.Photometry())
    assert [(row["video"], row["frames"]) for row in rows] == [("cecum_t1_a", 1), ("trans_t2_b", 2), ("all frames", 3)]
    assert float(rows[0]["AbsRel"]) < 0.02
    assert 0.3 < float(rows[0]["RMSE"]) / (30 * float(rows[0]["AbsRel"])) < 10  # mm, not shares
    total = (float(rows[0]["AbsRel"]) + 2 * float(rows[1]["AbsRel"])) / 3
    assert float(rows[2]["AbsRel"]) == pytest.approx(total, rel=1e-3)

    solved = []
    original = c3vd.measured
    monkeypatch.setattr(c3vd, "measured", lambda frame, *rest: solved.append(frame.number) or original(frame, *rest))
    lines = (tmp_path / "out/frames.csv").read_text(encoding="utf-8").splitlines()
    (tmp_path / "out/frames.csv").write_text("\n".join(lines[:-1]) + "\n", encoding="utf-8")
    assert c3vd.run(root, tmp_path / "out", 1, None, c3vd.Photometry()) == rows
    assert solved == ["0001"]


def test_camera_of_the_data_set_is_read(c3vd, root):
    camera = c3vd.camera_at(root)
    assert camera.a == pytest.approx([a_n * SHRINK ** (1 - n) for n, a_n in enumerate(A)])
    assert (camera.cx, camera.width) == (29.8, WIDTH)
    (root / "camera_intrinsics.txt").write_text("width 60\nheight 48\ncx 1\ncy 2\na0 3\na2 0\na3 0\n")
    with pytest.raises(ValueError, match="lacks a4"):
        c3vd.camera_at(root)
    (root / "camera_intrinsics.txt").unlink()
    with pytest.raises(ValueError, match=r"camera\.json"):
        c3vd.camera_at(root)


def test_every_other_frame(c3vd, root):
    assert [(f.video, f.number) for f in c3vd.frames(root, 2)] == [("cecum_t1_a", "0000"), ("trans_t2_b", "0000")]
