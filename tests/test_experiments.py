"""The experiments run, and print what they say."""

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]


@pytest.mark.slow
def test_what_photographing_costs(tmp_path):
    command = [sys.executable, "experiments/photographs.py", "--quick", "--out", str(tmp_path)]
    run = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
    rows = [line.split(" | ") for line in run.stdout.splitlines()[2:]]
    assert [row[0].strip("| ") for row in rows] == ["plane", "ball", "polyps"]
    assert all(float(row[3]) < float(row[2]) for row in rows)
    assert (tmp_path / "photographs.md").read_text(encoding="utf-8").endswith(run.stdout)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["gradients", "uncertainty"])
def test_derivatives_and_their_use(tmp_path, name):
    command = [sys.executable, f"experiments/{name}.py", "--quick", "--out", str(tmp_path)]
    run = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True)
    assert (tmp_path / f"{name}.md").read_text(encoding="utf-8") in run.stdout
    if name == "uncertainty":
        assert 0.9 < float(run.stdout.splitlines()[-2].split(" | ")[-2]) < 0.99
    else:
        differences = [float(line.split(" | ")[-1].strip("| ")) for line in run.stdout.splitlines()[4:12]]
        assert max(differences) < 1e-3
