"""The benchmarks run, and what they compare is the same scheme. Nothing here judges a time."""

from pathlib import Path

import pytest

FOLDER = Path(__file__).parents[1] / "experiments" / "benchmarks"


@pytest.fixture
def level_set_step(monkeypatch):
    monkeypatch.syspath_prepend(FOLDER)
    import level_set_step

    return level_set_step


@pytest.mark.parametrize("scene", ["plane", "wavy-wall"])
def test_numpy_peer_runs_the_same_front(level_set_step, scene):
    problem = level_set_step.Problem(scene, 40)
    difference, apart = level_set_step.largest_difference(problem, 210)  # as --quick: compiled once for both tests
    assert difference < 1e-5
    assert apart == 0


def test_level_set_benchmark_prints_its_table(level_set_step, monkeypatch, capsys):
    monkeypatch.setattr("sys.argv", ["level_set_step.py", "--quick", "--scene", "plane"])
    level_set_step.main()
    printed = capsys.readouterr().out
    assert "| jaxsfs |" in printed
    assert "| numpy |" in printed
    assert "numpy/jaxsfs:" in printed
    assert "triad" in printed
