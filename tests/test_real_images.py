"""Real photographs, at a quarter of their size: the figures that the reconstruction reaches must not get worse.

The margins are a few hundredths: shrinking the picture and the precision of the numbers move the figures by about
0.01. What the figures are is in `experiments/real_data.py`, which prints them.
"""

from pathlib import Path

import pytest

EXPERIMENTS = Path(__file__).parents[1] / "experiments"


@pytest.fixture
def experiments(monkeypatch):
    monkeypatch.syspath_prepend(EXPERIMENTS)


@pytest.fixture
def real_cases(experiments):
    import real_cases

    return real_cases


@pytest.fixture
def real_solving(experiments):
    import real_solving

    return real_solving


@pytest.fixture
def real_data(experiments):
    import real_data

    return real_data


def folder_of(data: Path, name: str) -> Path:
    if not (data / name).is_dir():
        pytest.skip(f"no {name} in {data}")
    return data / name


@pytest.mark.parametrize(("frame", "visible"), [(4584, 105), (4600, 218)])
def test_structure_points_project_into_the_picture(real_cases, data, frame, visible):
    """Poses inverted and visibility read as the data's own code does: the points fall on the field of the scope."""
    case = real_cases.sinus_case(folder_of(data, real_cases.SINUS), frame, 8)
    u, v = case.pixels().T
    height, width = case.mask.shape
    on = (u >= 0) & (u < width) & (v >= 0) & (v < height)
    on[on] = case.mask[v[on], u[on]]
    assert len(case.points) == visible
    assert (case.points[:, 2] > 0).all()
    assert on.mean() > 0.9


@pytest.mark.parametrize(
    ("frame", "settings", "spearman_depth", "spearman_range", "abs_rel"),
    [
        (4584, "blood", 0.64, 0.85, 0.10),
        pytest.param(4584, "smooth", 0.6, 0.86, 0.10, marks=pytest.mark.slow),
        pytest.param(4600, "blood", 0.82, 0.85, 0.08, marks=pytest.mark.slow),
    ],
)
def test_depth_of_sinus_follows_structure_from_motion(
    real_cases, real_solving, data, frame, settings, spearman_depth, spearman_range, abs_rel
):
    case = real_cases.sinus_case(folder_of(data, real_cases.SINUS), frame, 4)
    result = real_solving.solve(case, real_solving.SHOWN[settings])
    reached = real_solving.score(case, result)
    assert reached["compared"] >= 0.9 * reached["known"]
    assert reached["spearman_depth"] >= spearman_depth
    assert reached["spearman_range"] >= spearman_range
    assert reached["abs_rel"] <= abs_rel


@pytest.mark.parametrize(
    ("frame", "raw", "preset"), [pytest.param("0000", 0.24, 0.125, marks=pytest.mark.slow), ("0004", 0.22, 0.11)]
)
@pytest.mark.parametrize("camera", ["A", pytest.param("B", marks=pytest.mark.slow)])
def test_depth_of_rendered_colon(real_cases, real_solving, data, frame, raw, preset, camera):
    """Both readings of the camera: within 0.13 by the preset photometry, and better than without it."""
    case = real_cases.simcol_case(folder_of(data, real_cases.SIMCOL), frame, camera, 2)
    without = real_solving.score(case, real_solving.solve(case, real_solving.DEFAULT))
    assert without["abs_rel"] <= raw
    assert without["spearman_depth"] >= 0.9
    reached = real_solving.score(case, real_solving.solve(case, real_solving.PRESET))
    assert reached["abs_rel"] <= preset
    assert reached["abs_rel"] < without["abs_rel"]
    assert reached["spearman_depth"] >= 0.92


@pytest.mark.slow
def test_run_writes_table_and_pictures(real_cases, real_data, data, tmp_path, monkeypatch):
    """One small case through the whole script: table, CSV and a picture per setting."""
    case = real_cases.simcol_case(folder_of(data, real_cases.SIMCOL), "0004", "B", 8)
    monkeypatch.setattr(real_data, "cases", lambda data, quick: [case])
    rows = real_data.run(data, tmp_path, quick=True, variants=False, command="python experiments/real_data.py")
    assert len(rows) == len(real_data.SHOWN) + 2
    assert {path.suffix for path in tmp_path.iterdir()} == {".csv", ".md", ".png"}
    assert "python experiments/real_data.py" in (tmp_path / "real_data.md").read_text(encoding="utf-8")
    assert sum("fitted to the truth" in row["settings"] for row in rows) == 2
