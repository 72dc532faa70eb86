"""Lengths and areas against geometry: planes, spheres, tubes, ways round holes and over cuts."""

import json

import jax.numpy as jnp
import numpy as np
import pytest

from jaxsfs import files
from jaxsfs.camera import Perspective, Spherical
from jaxsfs.cli import main
from jaxsfs.measuring import measure_area, measure_length
from jaxsfs.surface import Surface

WIDE = Spherical(75.0, 79.5, 59.5, 160, 120)
FLAT = Perspective(75.0, 75.0, 79.5, 59.5, 160, 120)


def sphere(radius: float = 20.0) -> Surface:
    return Surface(WIDE, jnp.full((120, 160), radius), WIDE.field())


def wall(distance: float = 20.0) -> Surface:
    return Surface(FLAT, distance / FLAT.rays()[..., 2], FLAT.field())


def tube() -> tuple[Surface, np.ndarray]:
    """The inside of a tube of radius 1 round the axis; far away it ends."""
    rays = np.asarray(FLAT.rays())
    aside = np.hypot(rays[..., 0], rays[..., 1])
    return Surface(FLAT, jnp.asarray(1 / np.maximum(aside, 0.2)), jnp.asarray(aside > 0.2)), aside


class TestLength:
    @pytest.mark.parametrize("end", [(110, 90), (90.25, 31.75), (31, 31)])
    def test_on_a_sphere_it_is_the_arc(self, end):
        start = (30, 30)
        found = measure_length(sphere(), start, end)
        angle = np.arccos(np.clip(WIDE.ray(jnp.array(start, float)) @ WIDE.ray(jnp.array(end, float)), -1, 1))
        assert found.straight == pytest.approx(40 * np.sin(angle / 2), rel=1e-4)
        assert found.along == pytest.approx(20 * angle, rel=5e-4)
        assert np.isnan(found.straight_sd)

    def test_on_a_wall_both_are_the_same(self):
        found = measure_length(wall(), (10.3, 20), (150, 101.6))
        assert found.straight == pytest.approx(np.hypot(139.7, 81.6) * 20 / 75, rel=1e-9)
        assert found.along == pytest.approx(found.straight, rel=1e-9)

    @pytest.mark.parametrize(("start", "end"), [((5, 50), (75, 8)), ((20, 59), (139, 57)), ((40, 20), (50, 100))])
    def test_in_a_tube_it_is_the_unrolled_line(self, start, end):
        found = measure_length(tube()[0], start, end)
        turn = np.arctan2(found.start[1], found.start[0]) - np.arctan2(found.end[1], found.end[0])
        turn = abs((turn + np.pi) % (2 * np.pi) - np.pi)
        assert found.along == pytest.approx(np.hypot(turn, found.start[2] - found.end[2]), rel=1e-3)
        assert found.straight < found.along

    def test_round_a_hole(self):
        """Past the corners of a square hole: two straight pieces and one along its edge."""
        surface = wall()
        hole = np.zeros((120, 160), bool)
        hole[41:80, 61:100] = True
        found = measure_length(Surface(FLAT, surface.range, surface.valid & ~jnp.asarray(hole)), (50, 45), (110, 45))
        expected = (2 * np.hypot(10, 5) + 40) * 20 / 75  # over the upper edge, v = 40
        assert found.along == pytest.approx(expected, rel=2e-3)

    def test_no_way_over_a_cut(self):
        surface = wall()
        found = measure_length(Surface(FLAT, surface.range, surface.valid.at[:, 80].set(False)), (50, 45), (110, 45))
        assert np.isnan(found.along)
        assert found.straight == pytest.approx(16)

    def test_the_ends_errors_are_the_straight_ones(self):
        surface, sigma = sphere(), np.full((120, 160), 0.1)
        sigma[30, 40], sigma[90, 110] = 0.2, 0.5
        found = measure_length(surface, (40, 30), (110, 90), sigma)
        parts = []
        for u, v in ((40, 30), (110, 90)):
            moved = Surface(WIDE, surface.range.at[v, u].add(1e-4), surface.valid)
            parts.append((measure_length(moved, (40, 30), (110, 90)).straight - found.straight) / 1e-4 * sigma[v, u])
        assert found.straight_sd == pytest.approx(np.hypot(*parts), rel=1e-3)

    def test_a_common_relative_error_scales_the_way(self):
        surface = wall()
        found = measure_length(surface, (40, 30), (110, 90), 0.02 * np.asarray(surface.range))
        larger = measure_length(wall(20.4), (40, 30), (110, 90))
        assert found.along_sd == pytest.approx(larger.along - found.along, rel=1e-6)

    def test_outside_the_surface(self):
        surface = wall()
        surface = Surface(FLAT, surface.range, surface.valid.at[:20].set(False))
        with pytest.raises(ValueError, match=r"pixel \(5, 7\.5\) shows no surface"):
            measure_length(surface, (5, 7.5), (50, 50))


class TestArea:
    def test_of_a_cap(self):
        """2πr²(1 − cos α) of the sphere inside a cone; the mask's edge is uneven by half a pixel at random."""
        cosine = np.where(WIDE.field(), WIDE.rays()[..., 2], 0)
        found = measure_area(sphere(), cosine > np.cos(0.6))
        assert found.area == pytest.approx(2 * np.pi * 400 * (1 - np.cos(0.6)), rel=5e-3)
        assert found.pixels == found.marked == (cosine > np.cos(0.6)).sum()

    def test_of_pixels_on_a_wall(self):
        mask = np.zeros((120, 160), bool)
        mask[40:70, 30:100] = True
        found = measure_area(wall(), mask, 0.03 * np.asarray(wall().range))
        assert found.area == pytest.approx(30 * 70 * (20 / 75) ** 2, rel=1e-3)
        assert found.sd == pytest.approx(0.06 * found.area)

    def test_where_there_is_no_surface(self):
        surface = wall()
        surface = Surface(FLAT, surface.range, surface.valid.at[:20].set(False))
        mask = np.zeros((120, 160), bool)
        mask[10:30, 5:15] = True
        found = measure_area(surface, mask)
        assert (found.pixels, found.marked) == (100, 200)
        with pytest.raises(ValueError, match="none of the 10 marked pixels"):
            measure_area(surface, np.eye(120, 160, dtype=bool) & (np.arange(160) < 10))
        with pytest.raises(ValueError, match="the mask is 5 x 4 px, but the surface 160 x 120 px"):
            measure_area(surface, np.ones((4, 5), bool))


class TestCommand:
    @pytest.fixture
    def folder(self, tmp_path):
        """A result as reconstruct writes it, of the wall at 20 mm."""
        surface = wall()
        files.write_tiff(tmp_path / "range.tiff", np.asarray(surface.range), np.asarray(surface.valid))
        camera = {"model": "perspective", "fx": 75, "fy": 75, "cx": 79.5, "cy": 59.5, "width": 160, "height": 120}
        record = {"camera": camera, "unit": "mm", "status": {"trustworthy": True, "message": "fine"}}
        files.write_json(tmp_path / "result.json", record)
        return tmp_path

    def test_a_length_and_an_area(self, folder, capsys):
        mask = np.zeros((120, 160), np.uint8)
        mask[40:70, 30:100] = 255
        files.write_png(folder / "polyp.png", mask)
        words = ["measure", str(folder), "--between", "30,40", "105,40", "--area", str(folder / "polyp.png")]
        assert main(words) == 0
        assert (
            capsys.readouterr().out
            == "straight           20 mm\nalong the surface  20 mm\narea               149.31 mm²\n"
        )
        assert main([*words, "--json"]) == 0
        said = json.loads(capsys.readouterr().out)
        assert said["between"]["straight"] == pytest.approx(20, rel=1e-6)
        assert said["between"]["straight_sd"] is None
        assert said["area"]["area"] == pytest.approx(2100 * (20 / 75) ** 2, rel=1e-3)
        assert said["unit"] == "mm"

    def test_with_the_uncertainty_of_the_range(self, folder, capsys):
        distance = np.asarray(wall().range)
        files.write_tiff(folder / "range_sigma.tiff", 0.01 * distance, np.ones_like(distance, bool))
        assert main(["measure", str(folder), "--between", "30,40", "105,40"]) == 0
        assert "along the surface  20 ± 0.2 mm" in capsys.readouterr().out

    def test_an_untrustworthy_result_is_exit_code_3(self, folder, capsys):
        record = files.read_json(folder / "result.json")
        record["status"] = {"trustworthy": False, "message": "It did not settle."}
        files.write_json(folder / "result.json", record, force=True)
        assert main(["measure", str(folder), "--between", "30,40", "105,40"]) == 3
        said = capsys.readouterr()
        assert said.out.startswith("straight")
        assert said.err == "jaxsfs: warning: the result is not to be trusted: It did not settle.\n"

    @pytest.mark.parametrize(
        ("words", "message"),
        [
            ([], "nothing to measure: give --between U,V U,V or --area MASK.png"),
            (["--between", "1,2", "3"], "--between needs 2 numbers in the form U,V, got '3'"),
            (["--between", "1,nan", "3,4"], "--between needs finite pixels"),
            (["--between", "1,2", "300,4"], "pixel (300, 4) shows no surface"),
            (["--area", "missing.png"], "there is no file missing.png"),
        ],
    )
    def test_bad_input(self, folder, capsys, words, message):
        assert main(["measure", str(folder), *words]) == 2
        assert message in capsys.readouterr().err

    def test_a_folder_without_a_result(self, tmp_path, capsys):
        assert main(["measure", str(tmp_path), "--between", "1,2", "3,4"]) == 2
        assert "has no range.tiff; give a folder that jaxsfs reconstruct wrote" in capsys.readouterr().err

    def test_files_of_two_runs(self, folder, capsys):
        files.write_tiff(folder / "range.tiff", np.ones((9, 9)), np.ones((9, 9), bool), force=True)
        assert main(["measure", str(folder), "--between", "1,2", "3,4"]) == 2
        assert "the range has shape (9, 9), but the camera (120, 160)" in capsys.readouterr().err
