"""Where each value of a reconstruction came from."""

import json
from pathlib import Path

import numpy as np
import pytest
import tifffile
from cli_folders import record

from jaxsfs import files
from jaxsfs.cli import main


def with_photometry(view: Path, path: Path, **photometry) -> Path:
    """A copy of the view's camera file with other photometry."""
    camera = json.loads((view / "camera.json").read_text())
    path.write_text(json.dumps(camera | {"photometry": photometry}))
    return path


class TestProvenance:
    """Command line beats camera file beats default; each value says where it came from."""

    def options(self, view, tmp_path, *more, **photometry):
        camera = with_photometry(view, tmp_path / "camera.json", **photometry)
        words = ["reconstruct", str(view / "image.png"), "--camera", str(camera), "--out", str(tmp_path / "out")]
        assert main([*words, "--force", *more]) in (0, 3)
        said = record(tmp_path / "out")
        return {name: (entry["value"], entry["origin"]) for name, entry in said["options"].items()} | {
            "unit": said["unit"]
        }

    def test_defaults(self, view, tmp_path):
        options = self.options(view, tmp_path)
        assert options["response"] == ("linear", "automatic (uint16 image)")
        assert options["falloff"] == ("none", "default")
        assert options["reflectance"] == ("lambertian", "default")
        assert options["channel"] == ("luminance", "default")
        assert options["albedo"] == (1.0, "default: the surface is known up to one scale factor")
        assert options["mask"][1] == "automatic"
        assert options["initial"] == ("deadline", "default")

    def test_the_camera_file(self, view, tmp_path):
        photometry = {"response": "gamma:2.2", "falloff": "exp:1", "reflectance": "power:0.65", "gain_albedo": 2.5}
        options = self.options(view, tmp_path, **photometry, unit="mm")
        for name in ("response", "falloff", "reflectance"):
            assert options[name] == (photometry[name], "camera file")
        assert options["albedo"] == (2.5, "camera file")
        assert options["unit"] == "mm"

    def test_the_command_line(self, view, tmp_path):
        given = {"response": "srgb", "falloff": "none", "reflectance": "power:0.8", "channel": "green"}
        words = [word for name, text in given.items() for word in (f"--{name}", text)]
        photometry = {"response": "gamma:2.2", "falloff": "exp:1", "reflectance": "power:0.65", "gain_albedo": 2.5}
        options = self.options(view, tmp_path, *words, **photometry)
        for name, text in given.items():
            assert options[name] == (text, "command line")
        # the product was measured for luminance and says nothing about green
        assert options["albedo"][1].startswith("default")

    def test_auto_on_the_command_line_beats_the_camera_file(self, view, tmp_path):
        options = self.options(view, tmp_path, "--response", "auto", response="gamma:2.2")
        assert options["response"] == ("linear", "automatic (uint16 image)")

    def test_albedo(self, view, tmp_path):
        options = self.options(view, tmp_path, "--albedo", "4", gain_albedo=2.5)
        assert options["albedo"] == (4.0, "command line")

    def test_a_mask_file(self, view, tmp_path):
        mask = np.zeros((96, 96), np.uint8)
        mask[30:60, 30:70] = 1
        files.write_png(tmp_path / "mask.png", mask)
        options = self.options(view, tmp_path, "--mask", str(tmp_path / "mask.png"))
        assert options["mask"] == (f"{tmp_path}/mask.png, 13% of the image", "command line")
        assert np.isfinite(tifffile.imread(tmp_path / "out/range.tiff")).sum() == 30 * 40

    @pytest.mark.parametrize(
        ("photometry", "message"),
        [
            ({"response": 2.2}, "'response' must be a text such as 'srgb', got 2.2"),
            ({"falloff": "cosine"}, "falloff 'cosine' is unknown"),
            ({"gain_albedo": -1}, "'gain_albedo' must be a positive number, got -1"),
            ({"gain_albedo": 1, "unit": "cm"}, "'unit' must be mm or scene units, got 'cm'"),
        ],
    )
    def test_bad_photometry_names_file_and_key(self, view, tmp_path, capsys, photometry, message):
        camera = with_photometry(view, tmp_path / "camera.json", **photometry)
        words = ["reconstruct", str(view / "image.png"), "--camera", str(camera), "--out", str(tmp_path / "out")]
        assert main(words) == 2
        said = capsys.readouterr().err
        assert "camera.json" in said
        assert message in said
