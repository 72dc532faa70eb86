"""The benchmarks run, and what they compare is the same scheme. Nothing here judges a time."""

import csv
from pathlib import Path

import jax
import numpy as np
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


@pytest.mark.slow
def test_numba_peer_runs_the_same_front(level_set_step):
    pytest.importorskip("numba", reason="needs the extra bench")
    import level_set_numba

    size = 64
    problem = level_set_step.Problem("wavy-wall", size)
    peer = level_set_numba.program(problem)(4 * size)[1:-1, 1:-1]
    ours, reached = problem.jax(1000)
    there = reached & np.asarray(problem.inside)
    assert np.abs(peer - ours)[there].mean() < 1e-3  # its steps are all of one length


def test_level_set_benchmark_prints_its_table(level_set_step, monkeypatch, capsys):
    monkeypatch.setattr("sys.argv", ["level_set_step.py", "--quick", "--scene", "plane"])
    level_set_step.main()
    printed = capsys.readouterr().out
    assert "| jaxsfs |" in printed
    assert "| numpy |" in printed
    assert "numpy/jaxsfs:" in printed
    assert "triad" in printed


SLOW = [
    pytest.param(name, marks=pytest.mark.slow) for name in ("arrival", "near-light", "orders", "level-set", "sphere")
]


@pytest.mark.parametrize("only", ["round-in-c", *SLOW])
def test_benchmarks_run_at_a_tiny_size(only, monkeypatch, capsys, tmp_path):
    """Every program that this machine has gives a time and an error; peers that it lacks are named with the reason."""
    monkeypatch.syspath_prepend(FOLDER)
    import run

    monkeypatch.setattr("sys.argv", ["run.py", "--quick", "--only", only, "--out", str(tmp_path)])
    with jax.numpy_dtype_promotion("standard"), jax.numpy_rank_promotion("allow"):
        run.main()
    rows = list(csv.DictReader((tmp_path / "benchmarks.csv").read_text().splitlines()))
    assert rows[0]["program"].startswith("jaxsfs")
    for row in rows:
        assert row["ns_per_px"] or row["note"].startswith("skipped: "), row
    assert "| jaxsfs, order" in capsys.readouterr().out
    errors = [float(row["error"]) for row in rows if row["program"].startswith("jaxsfs") and row["error"]]
    assert all(error < 0.03 for error in errors)
