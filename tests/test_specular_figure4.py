"""The paper's Figure 4, as a reader makes it."""

from pathlib import Path

EXPERIMENTS = Path(__file__).parents[1] / "experiments"


def test_body_images_of_figure_4_are_nearer_the_truth_than_red_minus_green(tmp_path, monkeypatch, capsys):
    monkeypatch.syspath_prepend(EXPERIMENTS)
    import figure4

    rows = {row["object"]: row for row in figure4.run(tmp_path, tmp_path / "no data", quick=True)}
    assert set(rows) == {"synthetic", "resin-like"}
    for row in rows.values():
        assert float(row["ours"]) > max(40, float(row["R−G"])) > float(row["as stored"]) + 5
    assert "endoscope: left out" in capsys.readouterr().out
    assert (tmp_path / "figure4.png").stat().st_size > 20000
    assert "| resin-like |" in (tmp_path / "table.md").read_text(encoding="utf-8")


def test_figure_4_with_the_real_picture(data, tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(EXPERIMENTS)
    import figure4

    real = next(row for row in figure4.run(tmp_path, data, quick=True) if row["object"] == "endoscope")
    assert float(real["as stored"]) > 1.3
    assert 0.9 <= float(real["ours"]) <= 1.1
