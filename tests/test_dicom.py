"""DICOM in: stills, several frames and video, of 8 and 12 bits; nothing but pixels comes out."""

import subprocess
from pathlib import Path

import cv2
import numpy as np
import pytest

from data_synth import WavyWall, render_scene
from jaxsfs import files
from jaxsfs.cli import main
from jaxsfs.files._frames import open_frames

pydicom = pytest.importorskip("pydicom", reason="the extra dicom is not installed")

EXPLICIT = "1.2.840.10008.1.2.1"
MPEG4, HEVC = "1.2.840.10008.1.2.4.102", "1.2.840.10008.1.2.4.107"
SECRET = b"DOE^JANE"


def write(path: Path, pixels: bytes, size: tuple[int, int], *, syntax: str = EXPLICIT, **tags) -> Path:
    """A DICOM file of (height, width), as a scope's workstation writes it, a patient's name and all."""
    from pydicom.dataset import Dataset, FileDataset, FileMetaDataset

    meta = FileMetaDataset()
    meta.TransferSyntaxUID = pydicom.uid.UID(syntax)
    meta.MediaStorageSOPClassUID = pydicom.uid.UID("1.2.840.10008.5.1.4.1.1.77.1.1")
    meta.MediaStorageSOPInstanceUID = pydicom.uid.UID("1.2.3.4")
    data = FileDataset(str(path), Dataset(), file_meta=meta, preamble=b"\0" * 128)
    data.PatientName, data.PatientID = SECRET.decode(), "4711-secret"
    data.Rows, data.Columns = size
    data.PixelRepresentation = 0
    for name, value in tags.items():
        setattr(data, name, value)
    data.PixelData = pixels
    data["PixelData"].VR = "OB" if data.BitsAllocated == 8 else "OW"
    if syntax != EXPLICIT:
        data["PixelData"].is_undefined_length = True
    data.save_as(path, enforce_file_format=True)
    return path


COLOUR = {"SamplesPerPixel": 3, "PlanarConfiguration": 0, "PhotometricInterpretation": "RGB",
          "BitsAllocated": 8, "BitsStored": 8, "HighBit": 7}  # fmt: skip
GREY12 = {"SamplesPerPixel": 1, "PhotometricInterpretation": "MONOCHROME2",
          "BitsAllocated": 16, "BitsStored": 12, "HighBit": 11}  # fmt: skip


def test_a_still_is_a_photograph(tmp_path):
    picture = np.random.default_rng(0).integers(0, 256, (4, 6, 3), np.uint8)
    photo = files.read_image(write(tmp_path / "a.dcm", picture.tobytes(), (4, 6), **COLOUR))
    np.testing.assert_array_equal(photo.rgb8(), picture)
    assert photo.dtype == "uint8"


def test_twelve_bits_fill_sixteen_and_inverted_grey_is_turned(tmp_path):
    picture = np.array([[0, 1000], [2048, 4095]], np.uint16)
    photo = files.read_image(write(tmp_path / "a.dcm", picture.tobytes(), (2, 2), **GREY12))
    np.testing.assert_allclose(photo.values, picture / 4095, atol=1e-4)
    assert photo.values.max() == 1  # so that clipping is seen
    turned = GREY12 | {"PhotometricInterpretation": "MONOCHROME1"}
    photo = files.read_image(write(tmp_path / "b.dcm", picture.tobytes(), (2, 2), **turned))
    np.testing.assert_allclose(photo.values, 1 - picture / 4095, atol=1e-4)


def test_several_frames(tmp_path):
    pictures = np.random.default_rng(0).integers(0, 256, (5, 4, 6, 3), np.uint8)
    path = write(tmp_path / "a.dcm", pictures.tobytes(), (4, 6), NumberOfFrames=5, FrameTime=40, **COLOUR)
    frames = open_frames(path)
    assert (frames.count, frames.per_second) == (5, 25)
    for index in (3, 0, 4):
        np.testing.assert_array_equal(frames.read(index), pictures[index])
    with pytest.raises(files.InputError, match="frame 5 cannot be decoded"):
        frames.read(5)
    with pytest.raises(files.InputError, match="holds 5 frames; expected one picture"):
        files.read_image(path)


def test_a_video_inside(tmp_path):
    """The stream is unpacked and told by its content; the container's tags stay behind, the unpacked file goes."""
    from pydicom.encaps import encapsulate

    writer = cv2.VideoWriter(str(tmp_path / "a.mp4"), cv2.VideoWriter.fourcc(*"mp4v"), 10, (64, 48))
    for index in range(6):
        writer.write(np.full((48, 64, 3), 40 * index, np.uint8))
    writer.release()
    pixels = encapsulate([(tmp_path / "a.mp4").read_bytes()])
    frames = open_frames(write(tmp_path / "a.dcm", pixels, (48, 64), syntax=MPEG4, NumberOfFrames=6, **COLOUR))
    unpacked = Path(frames._unpacked.name)
    assert (frames.count, frames.per_second) == (6, 10)
    for index in (0, 4, 1):
        assert frames.read(index).mean() == pytest.approx(40 * index, abs=4)
    frames.close()
    assert not unpacked.exists()
    broken = write(tmp_path / "b.dcm", encapsulate([b"no stream at all"]), (48, 64), syntax=MPEG4, **COLOUR)
    with pytest.raises(files.InputError, match="cannot be decoded by this OpenCV"):
        open_frames(broken)


@pytest.mark.parametrize(("container", "syntax"), [("mp4", MPEG4), ("mpegts", MPEG4), ("mpegts", HEVC)])
def test_the_streams_that_workstations_write(tmp_path, container, syntax):
    """H.264 and H.265 by FFmpeg's own encoders, in the two containers that the standard allows."""
    from pydicom.encaps import encapsulate

    ffmpeg = pytest.importorskip("imageio_ffmpeg", reason="the extra dev is not installed").get_ffmpeg_exe()
    levels = np.full((6, 48, 64, 3), 40 * np.arange(6)[:, None, None, None], np.uint8)
    codec = "libx264" if syntax == MPEG4 else "libx265"
    words = [ffmpeg, "-loglevel", "error", "-f", "rawvideo", "-pix_fmt", "rgb24", "-s", "64x48", "-r", "10", "-i", "-"]
    words += ["-c:v", codec, "-pix_fmt", "yuv420p", "-f", container, str(tmp_path / "stream")]
    subprocess.run(words, input=levels.tobytes(), check=True, capture_output=True)
    pixels = encapsulate([(tmp_path / "stream").read_bytes()])
    frames = open_frames(write(tmp_path / "a.dcm", pixels, (48, 64), syntax=syntax, NumberOfFrames=6, **COLOUR))
    assert (frames.count, frames.per_second) == (6, 10)
    for index in (0, 4, 1, 5):
        assert frames.read(index).mean() == pytest.approx(40 * index, abs=4)
    frames.close()


@pytest.mark.slow
def test_tags_never_come_out(tmp_path):
    scene = render_scene(WavyWall(1.4, 0.03, 6.0), width=96, height=96)
    source = write(tmp_path / "a.dcm", scene.photo.stored.tobytes(), (96, 96), **COLOUR)
    assert SECRET in source.read_bytes()
    files.write_camera(tmp_path / "camera.json", scene.camera_file)
    common = ["--camera", str(tmp_path / "camera.json"), "--quiet", "--out"]
    assert main(["reconstruct", str(source), "--also", "npz", "png16", *common, str(tmp_path / "still")]) == 0
    if pytest.importorskip("zarr", reason="the extra cluster is not installed"):
        assert main(["video", str(source), *common, str(tmp_path / "r.zarr")]) == 0
    written = [path for folder in ("still", "r.zarr") for path in (tmp_path / folder).rglob("*") if path.is_file()]
    assert len(written) > 15
    for path in written:
        content = path.read_bytes()
        assert SECRET not in content, path
        assert b"4711-secret" not in content, path


def test_what_is_no_picture(tmp_path, monkeypatch):
    path = write(tmp_path / "a.dcm", bytes(24), (2, 4), **COLOUR)
    path.write_bytes(path.read_bytes()[:200])
    with pytest.raises(files.InputError, match="cannot read the DICOM file"):
        open_frames(path)
    monkeypatch.setitem(__import__("sys").modules, "pydicom", None)
    with pytest.raises(files.InputError, match=r"pip install 'jaxsfs\[dicom\]'"):
        open_frames(path)
