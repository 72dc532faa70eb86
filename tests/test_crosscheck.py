"""Our geometry and shading against Mitsuba's: its stored answers, and Mitsuba itself where it is installed."""

import json
import sys
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).parents[1]
CASES = json.loads((ROOT / "tests/golden/crosscheck.json").read_text(encoding="utf-8"))
FEW = {("tilted plane", "Scaramuzza"), ("ball", "Kannala–Brandt"), ("tube", "spherical"), ("tube", "perspective")}


@pytest.fixture
def crosscheck(monkeypatch):
    monkeypatch.syspath_prepend(str(ROOT / "experiments"))
    import crosscheck

    yield crosscheck
    for name in ("crosscheck", "mitsuba_scenes", "tables"):
        sys.modules.pop(name, None)


def marked(case: dict):
    few = (case["scene"], case["camera"]) in FEW
    return pytest.param(case, id=f"{case['scene']}, {case['camera']}", marks=() if few else pytest.mark.slow)


@pytest.mark.parametrize("case", [marked(case) for case in CASES])
def test_the_formulas_agree_with_mitsuba(crosscheck, case):
    seen, _ = crosscheck.view(crosscheck.SCENES[case["scene"]], crosscheck.cameras(case["size"])[case["camera"]])
    v, u = np.array(case["v"]), np.array(case["u"])
    assert len(v) > 20
    np.testing.assert_allclose(seen.surface.range[v, u], case["range"], rtol=2e-6)
    np.testing.assert_allclose(seen.irradiance.values[v, u], case["radiance"], rtol=2e-5)


def test_every_scene_and_camera_is_stored(crosscheck):
    stored = {(case["scene"], case["camera"]) for case in CASES}
    assert stored == {(scene, camera) for scene in crosscheck.SCENES for camera in crosscheck.cameras(65)}


@pytest.mark.slow
def test_mitsuba_gives_what_is_stored_and_renders_our_meshes(crosscheck, tmp_path):
    pytest.importorskip("mitsuba", reason="the extra crosscheck is not installed")
    tables = crosscheck.run(tmp_path, quick=True, golden=tmp_path / "golden.json")
    for new, old in zip(json.loads((tmp_path / "golden.json").read_text(encoding="utf-8")), CASES, strict=True):
        np.testing.assert_allclose(new["radiance"], old["radiance"], rtol=1e-5)
    for row in tables["mesh"]:
        assert float(row["radiance, median"]) < 0.02
        assert float(row["embree, max"]) < 1e-5


def test_without_mitsuba_it_says_what_to_install(crosscheck, monkeypatch, capsys):
    monkeypatch.setattr(crosscheck, "installed", lambda: False)
    monkeypatch.setattr(sys, "argv", ["crosscheck.py"])
    assert crosscheck.main() == 2
    assert 'pip install ".[crosscheck]"' in capsys.readouterr().err
