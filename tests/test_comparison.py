"""Where errors lie: curves and bins by hand, distances between meshes of known shape, benchmark rules."""

import json

import numpy as np
import pytest
import tifffile
import trimesh

from jaxsfs.camera import Perspective
from jaxsfs.cli import main
from jaxsfs.comparison import METRIC_SETS, by_angle, by_length, cumulative, measures_of, mesh_distances
from jaxsfs.evaluation import compare, evaluate

TRUTH = np.array([[1.0, 2.0], [4.0, 10.0]])
PREDICTED = np.array([[1.125, 1.75], [4.0, np.nan]])


def test_relative_errors_have_a_sign_and_gaps():
    found = compare(PREDICTED, TRUTH, align="none")
    np.testing.assert_allclose(found.relative(), [[0.125, -0.125], [0.0, np.nan]])
    assert (found.fraction, found.scale, found.quantity) == (0.75, 1.0, "range")


def test_least_squares_factor_leaves_the_smallest_rms():
    found = evaluate(PREDICTED, TRUTH, align="scale-ls")
    p, d = PREDICTED[np.isfinite(PREDICTED)], TRUTH[np.isfinite(PREDICTED)]
    assert found.scale == pytest.approx(p @ d / (p @ p))
    assert all(found.rmse < np.sqrt(np.mean((d - s * found.scale * p) ** 2)) for s in (0.99, 1.01))


def test_cumulative_curve_counts_pixels():
    rows = cumulative(compare(PREDICTED, TRUTH, align="none"), (0.0, 0.1, 0.125, 1.0))
    assert [row["share"] for row in rows] == pytest.approx([1 / 3, 1 / 3, 1, 1])


def test_bins_by_distance_and_angle_hold_their_pixels():
    camera = Perspective(20.0, 20.0, 20.0, 15.0, 41, 31)
    truth = np.broadcast_to(np.geomspace(1, 16, 40), (31, 40))
    error = np.where(truth < 4, 0.1, 0.3)
    found = compare(truth * (1 + error), truth, align="none")
    rows = by_length(found, bins=2)
    assert [row["abs_rel"] for row in rows] == pytest.approx([0.1, 0.3], abs=0.005)
    assert sum(row["pixels"] for row in rows) == truth.size
    assert rows[0]["from"] == 1
    assert rows[1]["to"] == pytest.approx(16)

    axial = np.asarray(camera.rays())[..., 2]
    away = np.rad2deg(np.arccos(axial))
    found = compare(np.where(away < 20, 1.0, 1.5), np.ones_like(away), align="none")
    rows = by_angle(found, camera)
    assert [row["abs_rel"] for row in rows] == pytest.approx([0, 0] + [0.5] * (len(rows) - 2))
    assert rows[0]["pixels"] == int((away < 10).sum())


def test_distances_between_concentric_spheres_are_the_gap():
    inner, outer = (trimesh.creation.icosphere(4, radius=r) for r in (1.0, 1.1))
    found = mesh_distances(inner, outer, samples=8000)
    assert found["chamfer"] == pytest.approx(0.1, abs=0.01)
    assert found["hausdorff"] == pytest.approx(0.1, abs=0.02)
    assert mesh_distances(inner, outer, samples=8000) == found
    aligned = mesh_distances(inner, outer, samples=8000, align="median")
    assert aligned["scale"] == pytest.approx(1.1, rel=1e-3)
    assert aligned["chamfer"] < aligned["resolution"] * 2 < 0.05
    with pytest.raises(ValueError, match="no faces"):
        mesh_distances(inner, trimesh.Trimesh(), samples=10)


def test_part_of_a_surface_is_accurate_but_not_complete():
    whole = trimesh.creation.box((2, 2, 2))
    upper = whole.face_normals[:, 2] > 0.5
    part = trimesh.Trimesh(whole.vertices, whole.faces[upper])
    found = mesh_distances(part, whole, samples=8000)
    assert found["accuracy"] < 0.03 < 0.15 < found["completeness"]


def test_benchmark_measures_are_those_of_the_fields():
    found = evaluate(PREDICTED, TRUTH, quantity="depth", align="none")
    assert measures_of(found, "simcol") == {"L1": found.mae, "median relative": 0.125, "RMSE": found.rmse}
    assert list(measures_of(found, "c3vd"))[:3] == ["AbsRel", "SqRel", "RMSE"]
    assert METRIC_SETS["c3vd"].high == 100
    with pytest.raises(ValueError, match="c3vd, simcol"):
        measures_of(found, "all")


@pytest.fixture
def maps(tmp_path):
    camera = {"model": "perspective", "fx": 30.0, "fy": 30.0, "cx": 15.5, "cy": 11.5, "width": 32, "height": 24}
    (tmp_path / "camera.json").write_text(json.dumps(camera))
    depth = np.linspace(20, 140, 32 * 24, dtype=np.float32).reshape(24, 32)
    tifffile.imwrite(tmp_path / "truth.tiff", depth)
    tifffile.imwrite(tmp_path / "depth.tiff", 2.2 * depth)
    return tmp_path


def test_evaluate_writes_maps_and_curves(maps, capsys):
    words = ["evaluate", str(maps / "depth.tiff"), str(maps / "truth.tiff"), "--camera", str(maps / "camera.json")]
    words += ["--quantity", "depth", "--align", "none", "--out", str(maps / "errors"), "--json"]
    assert main(words) == 0
    said = json.loads(capsys.readouterr().out)
    assert said["abs_rel"] == pytest.approx(1.2, rel=1e-5)
    np.testing.assert_allclose(tifffile.imread(maps / "errors/error_map.tiff"), 1.2, rtol=1e-5)
    assert (maps / "errors/errors.png").read_bytes().startswith(b"\x89PNG")
    record = json.loads((maps / "errors/evaluation.json").read_text())
    assert record["by_angle_deg"][0]["abs_rel"] == pytest.approx(1.2, rel=1e-5)
    assert sum(row["pixels"] for row in record["by_depth"]) == 32 * 24
    assert record["cumulative"][-1]["share"] == 0
    assert main(words) == 2  # the folder is there


def test_evaluate_by_a_benchmark_s_rules(maps, capsys):
    words = ["evaluate", str(maps / "depth.tiff"), str(maps / "truth.tiff"), "--metric-set", "c3vd"]
    assert main(words) == 0
    table = capsys.readouterr().out
    assert "median, prediction times 0.4545" in table
    assert "delta < 1.1" in table
    assert main([*words, "--json"]) == 0
    said = json.loads(capsys.readouterr().out)
    assert said["pixels"] == int((tifffile.imread(maps / "truth.tiff") <= 100).sum())
    assert said["measures"]["AbsRel"] < 1e-6


def test_evaluate_meshes(tmp_path, capsys):
    for name, radius in (("a.ply", 1.0), ("b.stl", 1.1)):
        trimesh.creation.icosphere(3, radius=radius).export(tmp_path / name)
    words = ["evaluate", str(tmp_path / "a.ply"), str(tmp_path / "b.stl")]
    assert main([*words, "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["meshes"]["chamfer"] == pytest.approx(0.1, abs=0.015)
    assert main([*words, "--metric-set", "c3vd"]) == 2
    assert main(["evaluate", str(tmp_path / "a.ply"), str(tmp_path)]) == 2
    (tmp_path / "b.stl").write_text("solid x\nendsolid x\n")
    capsys.readouterr()
    assert main(words) == 2
    assert "b.stl" in capsys.readouterr().err
