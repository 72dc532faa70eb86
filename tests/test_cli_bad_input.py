"""What a user can get wrong, and pictures of every kind: one clear line and exit code 2, or a correct result."""

import json

import cv2
import numpy as np
import pytest
import tifffile

from jaxsfs.cli import main
from jaxsfs.cli._terminal import _cache_folder

WIDTH, HEIGHT = 40, 32
CAMERA = {"model": "perspective", "fx": 30, "fy": 30, "cx": 19.5, "cy": 15.5, "width": WIDTH, "height": HEIGHT}


@pytest.fixture
def work(tmp_path, monkeypatch):
    """A folder to work in, with image.png (a plane seen square-on), camera.json and nothing else."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "camera.json").write_text(json.dumps(CAMERA))
    cv2.imwrite("image.png", stored(np.uint16))
    return tmp_path


def plane() -> np.ndarray:
    """Irradiance of the plane z = 1.1 under a light at the camera: cos^3 of the ray over z^2."""
    v, u = np.indices((HEIGHT, WIDTH))
    cosine = 1 / np.sqrt(1 + ((u - 19.5) ** 2 + (v - 15.5) ** 2) / 30**2)
    return (cosine**3 / 1.1**2).astype(np.float32)


def stored(dtype, channels: int = 1) -> np.ndarray:
    """The plane as whole numbers: linear for 16 bit, sRGB for 8 bit."""
    value = plane()
    if dtype == np.uint8:
        value = 1.055 * value ** (1 / 2.4) - 0.055
    value = np.round(np.iinfo(dtype).max * value).astype(dtype)
    return value if channels == 1 else np.repeat(value[..., None], channels, axis=2)


def run(image="image.png", *more, camera="camera.json") -> int:
    return main(["reconstruct", str(image), "--camera", camera, "--out", "out", *more])


def check_refused(work, capsys, *parts):
    """Exit code 2 was given with one line on stderr that has `parts`; nothing was written."""
    said = capsys.readouterr()
    assert said.out == ""
    assert said.err.startswith("jaxsfs: error: ")
    assert said.err.count("\n") == 1
    for part in parts:
        assert part in said.err
    assert not (work / "out").exists()
    assert not [p for p in work.iterdir() if p.name.endswith(".tmp")]


def check_plane(valid=None, tolerance=0.02):
    """The plane was found where `valid`, and nothing elsewhere."""
    depth = tifffile.imread("out/depth.tiff")
    valid = np.ones_like(depth, bool) if valid is None else valid
    np.testing.assert_array_equal(np.isfinite(depth), valid)
    np.testing.assert_allclose(depth[valid], 1.1, rtol=tolerance)


@pytest.mark.parametrize("channels", [1, 3, 4])
@pytest.mark.parametrize("dtype", [np.uint8, np.uint16])
def test_grey_colour_and_alpha_of_8_and_16_bit(work, dtype, channels):
    picture = stored(dtype, channels)
    valid = np.ones((HEIGHT, WIDTH), bool)
    if channels == 4:
        picture[..., 3] = np.iinfo(dtype).max
        picture[5, 7:9] = 0  # transparent
        valid[5, 7:9] = False
    cv2.imwrite("photo.png", picture)
    assert run("photo.png") == 0
    check_plane(valid)


def test_nan_negative_and_infinite_values_are_left_out(work):
    values = plane()
    values[3, 4:8] = [np.nan, -0.2, np.inf, 0.0]
    tifffile.imwrite("photo.tiff", values)
    assert run("photo.tiff") == 0
    valid = np.ones((HEIGHT, WIDTH), bool)
    valid[3, 4:8] = False
    check_plane(valid)


def test_a_float_picture_of_any_scale(work):
    np.save("photo.npy", 1e4 * plane())
    assert run("photo.npy", "--albedo", "1e4") == 0
    check_plane()


def test_a_mask_out_of_several_pieces(work):
    mask = np.zeros((HEIGHT, WIDTH), np.uint8)
    mask[5:25, 5:25] = 255
    mask[10:20, 30:38] = 1
    cv2.imwrite("mask.png", mask)
    assert run("image.png", "--mask", "mask.png") in (0, 3)
    assert (np.isfinite(tifffile.imread("out/range.tiff")) == (mask > 0)).all()


def test_one_pixel(work, capsys):
    cv2.imwrite("one.png", np.full((1, 1), 120, np.uint8))
    (work / "one.json").write_text(json.dumps(CAMERA | {"width": 1, "height": 1, "cx": 0, "cy": 0}))
    assert run("one.png", camera="one.json") == 3
    assert "Too few valid pixels" in capsys.readouterr().out
    assert np.isnan(tifffile.imread("out/range.tiff")).all()


@pytest.mark.slow
@pytest.mark.parametrize("shape", [(1, 40), (2, 2), (3, 3)])
def test_tiny_pictures_never_end_in_a_traceback(work, shape, capsys):
    cv2.imwrite("tiny.png", np.full(shape, 120, np.uint8))
    (work / "tiny.json").write_text(json.dumps(CAMERA | {"width": shape[1], "height": shape[0], "cx": 1, "cy": 1}))
    assert run("tiny.png", camera="tiny.json") in (0, 2, 3)


class TestFiles:
    def test_missing_image(self, work, capsys):
        assert run("photo.png") == 2
        check_refused(work, capsys, "there is no file photo.png", "looked from")

    def test_missing_camera(self, work, capsys):
        assert run("image.png", camera="cam.json") == 2
        check_refused(work, capsys, "there is no file cam.json")

    def test_an_image_that_is_none(self, work, capsys):
        (work / "photo.png").write_text("not an image")
        assert run("photo.png") == 2
        check_refused(work, capsys, "photo.png is not an image that can be read", "expected PNG, JPEG")

    def test_an_image_that_is_cut_short(self, work, capsys):
        (work / "photo.jpg").write_bytes(cv2.imencode(".jpg", stored(np.uint8))[1].tobytes()[:-200])
        assert run("photo.jpg") == 2
        check_refused(work, capsys, "photo.jpg is cut short")

    def test_an_image_that_is_a_folder_or_empty(self, work, capsys):
        assert run(".") == 2
        check_refused(work, capsys, "is a folder")
        (work / "photo.png").touch()
        assert run("photo.png") == 2
        check_refused(work, capsys, "photo.png is empty")

    def test_a_camera_that_is_no_json(self, work, capsys):
        (work / "camera.json").write_text("{'model': 1}")
        assert run() == 2
        check_refused(work, capsys, "camera.json is not JSON", "line 1")

    @pytest.mark.parametrize(
        ("change", "part"),
        [
            ({"model": "pinhole"}, "camera model 'pinhole' is unknown; 'model' must be one of: spherical, perspective"),
            ({"fx": None}, "camera key 'fx' must be a finite number"),
            ({"fy": -3}, "camera key 'fy' must be positive"),
            ({"photometry": 3}, "'photometry' must be an object"),
        ],
    )
    def test_a_camera_that_is_wrong(self, work, capsys, change, part):
        (work / "camera.json").write_text(json.dumps(CAMERA | change))
        assert run() == 2
        check_refused(work, capsys, "camera.json", part)

    def test_results_where_a_file_is(self, work, capsys):
        (work / "out").write_text("mine")
        assert run() == 2
        assert "expected a folder for the results, but out is a file" in capsys.readouterr().err
        assert (work / "out").read_text() == "mine"

    def test_results_below_a_file(self, work, capsys):
        assert main(["reconstruct", "image.png", "--camera", "camera.json", "--out", "camera.json/out"]) == 2
        check_refused(work, capsys, "cannot write the results to camera.json/out")


class TestPictures:
    def test_black(self, work, capsys):
        cv2.imwrite("black.png", np.zeros((HEIGHT, WIDTH, 3), np.uint8))
        assert run("black.png") == 2
        check_refused(work, capsys, "no usable pixel", "1280 black", "the light was on")

    def test_white(self, work, capsys):
        cv2.imwrite("white.png", np.full((HEIGHT, WIDTH, 3), 255, np.uint8))
        assert run("white.png") == 2
        check_refused(work, capsys, "no usable pixel", "1280 clipped", "lower the exposure")

    def test_nothing_but_nan(self, work, capsys):
        tifffile.imwrite("nan.tiff", np.full((HEIGHT, WIDTH), np.nan, np.float32))
        assert run("nan.tiff") == 2
        check_refused(work, capsys, "nan.tiff has no usable pixel", "expected values from 0 upwards")

    def test_another_size_of_the_same_aspect(self, work, capsys):
        cv2.imwrite("large.png", np.full((2 * HEIGHT, 2 * WIDTH), 99, np.uint8))
        assert run("large.png") == 2
        check_refused(
            work, capsys, "large.png is 80 x 64 px", "for 40 x 32 px", "the aspect is the same: resize the camera"
        )

    def test_another_size(self, work, capsys):
        cv2.imwrite("wide.png", np.full((HEIGHT, 2 * WIDTH), 99, np.uint8))
        assert run("wide.png") == 2
        check_refused(work, capsys, "wide.png is 80 x 32 px", "for 40 x 32 px", "crop the camera")

    def test_an_empty_mask(self, work, capsys):
        cv2.imwrite("mask.png", np.zeros((HEIGHT, WIDTH), np.uint8))
        assert run("image.png", "--mask", "mask.png") == 2
        check_refused(work, capsys, "the mask mask.png is empty", "expected non-zero where valid")

    def test_a_mask_of_another_size(self, work, capsys):
        cv2.imwrite("mask.png", np.full((WIDTH, HEIGHT), 255, np.uint8))
        assert run("image.png", "--mask", "mask.png") == 2
        check_refused(work, capsys, "the mask mask.png is 32 x 40 px and the photograph 40 x 32 px")

    def test_a_mask_without_light(self, work, capsys):
        picture = stored(np.uint16)
        picture[:, :10] = 0
        mask = np.zeros((HEIGHT, WIDTH), np.uint8)
        mask[:, :10] = 255
        cv2.imwrite("photo.png", picture)
        cv2.imwrite("mask.png", mask)
        assert run("photo.png", "--mask", "mask.png") == 2
        check_refused(work, capsys, "960 outside the mask, 320 black")


class TestOptions:
    @pytest.mark.parametrize(
        ("words", "part"),
        [
            (["--albedo", "2", "--known-range", "1,2,3"], "--albedo and --known-range both set the scale"),
            (["--albedo", "0"], "--albedo must be positive and finite, got 0"),
            (["--albedo", "nan"], "--albedo must be positive and finite, got nan"),
            (["--smooth", "much"], "--smooth must be auto or 0 or more pixels, got much"),
            (["--preset", "gastroscope"], "write one of: colonoscope"),
            (["--smooth", "-1"], "--smooth must be auto or 0 or more pixels, got -1"),
            (["--known-range", "1,2"], "--known-range needs 3 numbers in the form U,V,R, got '1,2'"),
            (["--known-range", "a,b,c"], "--known-range needs numbers in the form U,V,R, got 'a,b,c'"),
            (["--known-range", "1,2,-3"], "--known-range needs a range R above 0"),
            (["--known-range", "40,2,3"], "U from 0 to 39, V from 0 to 31), got 40,2"),
            (["--heights", "h.csv"], "--heights belongs to --light distant"),
            (["--light", "distant", "--heights", "h.csv", "--initial", "deadline"], "give one of them"),
            (["--concave"], "--concave belongs to --light distant"),
            (["--light", "distant"], "a distant light the orthographic one"),
            (["--response", "srbg"], "--response: response 'srbg' is unknown; write one of: srgb, linear, gamma:G"),
            (["--response", "gamma:-1"], "--response: a response's gamma must be positive, got -1"),
            (["--falloff", "cos"], "--falloff: falloff 'cos' needs 1 finite number(s)"),
            (["--falloff", "cosexp:1"], "needs 2 finite number(s); write one of: none, cos:MU, exp:MU, cosexp:A,B"),
            (["--reflectance", "oren-nayar:0.9"], "--reflectance: Oren-Nayar roughness must lie in [0, 0.622]"),
            (["--channel", "grey"], "--channel: channel 'grey' is unknown"),
            (["--channel", "0,0,0"], "--channel: channel '0,0,0' needs three weights"),
            (["--solver", "level-set", "--order", "3"], "the level set has order 1 or 2"),
            (["--initial", "front"], "--initial 'front' is unknown; write one of: deadline, singular-point"),
            (["--initial", "singular-point:3"], "--initial singular-point needs 2 numbers in the form U,V"),
            (["--initial", "singular-point:3,99"], "V from 0 to 31), got 3,99"),
            (["--initial", "singular-point:3,4,0"], "the range of --initial singular-point must be above 0"),
            (["--initial", "threshold:x"], "--initial threshold needs numbers in the form E"),
            (["--initial", "threshold:50"], "no valid pixel reaches the threshold 50"),
            (["--initial", "curve:mask.png"], "--initial 'curve:mask.png' is unknown; write one of"),
            (["--initial", "curve:mask.png,2"], "there is no file mask.png"),
        ],
    )
    def test_refused_in_one_line(self, work, capsys, words, part):
        assert run("image.png", *words) == 2
        check_refused(work, capsys, part)

    @pytest.mark.parametrize("words", [["--order", "4"], ["--solver", "magic"], ["--nonsense"]])
    def test_words_that_make_no_sense(self, work, capsys, words):
        assert run("image.png", *words) == 2
        said = capsys.readouterr()
        assert said.out == ""
        assert words[0] in said.err
        assert "Traceback" not in said.err
        assert not (work / "out").exists()

    @pytest.mark.parametrize(
        ("text", "part"),
        [
            ("x,y,z\n1,2,3\n", "h.csv must begin with the header u,v,z, got 'x,y,z'"),
            ("", "h.csv is empty"),
            ("u,v,z\n", "h.csv has no line below its header"),
            ("u,v,z\n1,2\n", "line 2 of h.csv needs 3 numbers in the form U,V,Z"),
            ("u,v,z\n1,2,3\n1,99,3\n", "line 3 of h.csv needs a pixel"),
            ("u,v,z\n1,2,nan\n", "line 2 of h.csv needs finite numbers"),
        ],
    )
    def test_heights(self, work, capsys, text, part):
        (work / "h.csv").write_text(text)
        orthographic = {"model": "orthographic", "scale": 30} | {k: CAMERA[k] for k in ("cx", "cy", "width", "height")}
        (work / "camera.json").write_text(json.dumps(orthographic))
        assert run("image.png", "--light", "distant", "--heights", "h.csv") == 2
        check_refused(work, capsys, part)


class TestOtherCommands:
    @pytest.mark.parametrize(
        ("words", "part"),
        [
            (["render", "cave", "--out", "out"], "scene 'cave' is unknown; write one of: ball"),
            (["render", "random:x", "--out", "out"], "scene 'random:x' is unknown"),
            (["render", "scene.json", "--out", "out"], "there is no file scene.json"),
            (["render", "effects.json", "--out", "out"], "got 'shine': 'a lot'"),
            (["render", "plane", "--camera", "photometry.json", "--out", "out"], "'response' must be a text"),
            (["render", "plane", "--half-field", "95", "--out", "out"], "half_field_deg must lie between 0 and 90"),
            (
                ["render", "plane", "--camera", "camera.json", "--width", "9", "--out", "out"],
                "the camera file has a size",
            ),
            (
                ["rectify", "image.png", "--camera", "camera.json", "--half-field", "90", "--out", "out"],
                "half_field_deg",
            ),
            (["rectify", "image.png", "--camera", "camera.json", "--out", "image.png"], "image.png exists already"),
            (["evaluate", ".", "image.png"], "has neither range.tiff nor depth.tiff"),
            (["evaluate", "image.png", "image.png"], "holds whole numbers (uint16), which have no unit"),
            (["evaluate", "a.tiff", "b.tiff"], "there is no file a.tiff"),
        ],
    )
    def test_refused_in_one_line(self, work, capsys, words, part):
        (work / "effects.json").write_text(json.dumps({"name": "plane", "effects": {"shine": "a lot"}}))
        (work / "photometry.json").write_text(json.dumps(CAMERA | {"photometry": {"response": 2.2}}))
        assert main(words) == 2
        check_refused(work, capsys, part)

    def test_maps_of_different_size(self, work, capsys):
        np.save("a.npy", np.ones((4, 5)))
        np.save("b.npy", np.ones((4, 6)))
        assert main(["evaluate", "a.npy", "b.npy"]) == 2
        check_refused(work, capsys, "(4, 5) and (4, 6)")


def test_a_machine_without_a_writable_home_runs_without_a_cache(work, monkeypatch):
    assert _cache_folder() is not None
    monkeypatch.setenv("XDG_CACHE_HOME", str(work / "camera.json"))
    assert _cache_folder() is None


def test_a_traceback_is_there_for_those_who_ask(work, monkeypatch):
    monkeypatch.setenv("JAXSFS_TRACEBACK", "1")
    with pytest.raises(ValueError, match="there is no file"):
        run("photo.png")
