"""The table of calibration figures: its sums by hand, and two real draws."""

from pathlib import Path

import pytest

FOLDER = Path(__file__).parents[1] / "experiments"


@pytest.fixture
def figures(monkeypatch):
    monkeypatch.syspath_prepend(FOLDER)
    import calibration_figures

    return calibration_figures


def draw(f_error: float, f_sd: float = 1e-3, warnings: int = 0, failed: str = "") -> dict:
    return {"failed": failed, "f_error": f_error, "f_sd": f_sd, "warnings": warnings}


def cell(lines, name: str):
    return next((line["median / 95 %"], line[""]) for line in lines if line["figure"] == name)


def test_median_and_percentile_are_of_the_absolute_error(figures):
    lines = figures.summary("circles-known", [draw(-1e-3), draw(2e-3), draw(3e-3)])
    assert cell(lines, "f") == ("0.200 / 0.290 %", "missed")
    assert cell(figures.summary("circles-known", [draw(1e-4), draw(-1e-4)]), "f") == ("0.010 / 0.010 %", "met")


def test_coverage_counts_draws_within_one_and_two_sigma(figures):
    errors = [0.5e-3] * 68 + [1.5e-3] * 27 + [3e-3] * 5
    lines = figures.summary("circles-known", [draw(error) for error in errors])
    assert cell(lines, "1σ of f: truth within 1 / 1.96 σ") == ("68 % / 95 %", "met")
    lines = figures.summary("circles-known", [draw(error, f_sd=1e-2) for error in errors])
    assert cell(lines, "1σ of f: truth within 1 / 1.96 σ") == ("100 % / 100 %", "missed")


def test_a_silent_error_fails_and_a_warned_one_does_not(figures):
    assert figures.is_failure(draw(0.02))
    assert not figures.is_failure(draw(0.02, warnings=1))
    assert figures.is_failure(draw(0.0, failed="no rings"))


def test_a_table_is_made_in_pieces(figures, tmp_path, monkeypatch):
    made = []

    def one_draw(row, seed):
        made.append((row, seed))
        return draw(1e-4) | {"row": row, "seed": seed}

    monkeypatch.setattr(figures, "one_draw", one_draw)
    path = tmp_path / "out" / "draws.jsonl"
    rows = ["circles-known", "grid"]
    figures.run(rows, range(2), 1e3, print, figures.Store(path))
    again = figures.run(rows, range(3), 1e3, print, figures.Store(path))
    assert made == [(row, seed) for seed in range(3) for row in rows]
    assert len(again) == 6
    assert len(figures.run(rows, range(9), -1.0, print, figures.Store(path))) == 6
    said = []
    assert len(figures.run(rows, range(9), 0.0, said.append, figures.Store(path))) == 6
    assert said == ["no new draws after 1 a row: 0 s are spent"]


def test_draws_of_another_source_are_not_used(figures, tmp_path, monkeypatch):
    import calibration_store

    store = figures.Store(tmp_path / "draws.jsonl")
    store.add({"row": "grid", "seed": 3})
    assert store.get("grid", 3)
    monkeypatch.setattr(calibration_store, "version_of", lambda module: "another")
    assert figures.Store(tmp_path / "draws.jsonl").get("grid", 3) is None


def test_a_version_depends_on_what_the_row_uses_and_on_nothing_else(figures):
    import calibration_store as store

    versions = {store.version_of(store.module_for(row)) for row in ("circles-one", "grid", "white-two")}
    assert len(versions) == 3
    assert store.module_for("circles-three-k") == store.module_for("equisolid")


@pytest.mark.slow
def test_the_command_draws_and_writes_the_table(figures, tmp_path, monkeypatch, capsys):
    rows = ["--rows", "white-one", "circles-one"]
    monkeypatch.setattr("sys.argv", ["calibration_figures.py", "--quick", *rows, "--out", str(tmp_path)])
    figures.main()
    assert "white paper, one square view" in capsys.readouterr().out
    assert (tmp_path / "draws.csv").read_text().count("\n") == 5
    assert (tmp_path / "figures.md").read_text().startswith("| row |")
