"""The committed samples are what the renderer makes today, and the README beside them names every folder."""

import json
import re
from pathlib import Path

import numpy as np
import pytest
import tifffile

import data_synth
from data_synth import render_scene
from jaxsfs.camera import camera_from_dict

SAMPLES = Path(data_synth.__file__).parent / "samples"
FOLDERS = sorted(path.name for path in SAMPLES.iterdir() if path.is_dir())


@pytest.mark.parametrize("name", FOLDERS)
def test_sample_range_is_reproduced(name):
    folder = SAMPLES / name
    camera = camera_from_dict(json.loads((folder / "camera.json").read_text())).camera
    description = json.loads((folder / "scene.json").read_text())
    rendered = render_scene(description, camera=camera, half_field_deg=description["effects"]["half_field_deg"])
    stored = tifffile.imread(folder / "range.tiff")
    valid = np.isfinite(stored)
    assert valid.sum() > 1000
    np.testing.assert_allclose(np.asarray(rendered.range)[valid], stored[valid], rtol=1e-6)


def test_readme_names_every_folder():
    text = (SAMPLES / "README.md").read_text()
    assert sorted(re.findall(r"^\| `([a-z-]+)` \| `jaxsfs render \1 .*--out \1` \|$", text, flags=re.M)) == FOLDERS
