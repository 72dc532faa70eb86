"""`jaxsfs convert`: camera files of other programs."""

import dataclasses
import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from tyro.conf import Positional

from jaxsfs.cli._options import FLAT, value
from jaxsfs.cli._terminal import jax_session, say

if TYPE_CHECKING:
    from jaxsfs.camera import CameraFile

_OWN = "jaxsfs"


@dataclasses.dataclass(frozen=True)
class ConvertOptions:
    # The camera: one of ours, or OpenCV's, Kalibr's, ROS's, COLMAP's or nerfstudio's.
    source: Annotated[Positional[Path], value("SOURCE")]
    # The camera to write.
    target: Annotated[Positional[Path], value("TARGET")]
    # Format of the source: jaxsfs, opencv, opencv-fisheye, opencv-radtan, kalibr, ros, colmap or nerfstudio.
    from_: Annotated[str | None, value("FORMAT", default="told from the content", option="from")] = None
    # Format of the target: jaxsfs, opencv, kalibr, ros, colmap or nerfstudio.
    to: Annotated[str | None, value("FORMAT", default="told from the name")] = None
    # Image size in px, where the source does not say it.
    size: Annotated[tuple[int, int] | None, value("WIDTH HEIGHT", default="the source's")] = None
    # Largest misfit in px of the camera that stands for a lens with radial and tangential distortion.
    tolerance: Annotated[float, value("PX")] = 0.5
    # Replace the target.
    force: bool = False
    # Print what was done as JSON.
    json: bool = False


def convert(options: Annotated[ConvertOptions, FLAT]) -> int:
    """A camera file for another program, or another program's as one of ours.

    .yaml is OpenCV's (Kalibr's with "camchain" in the name, ROS's with "camera_info"), .txt COLMAP's, .json ours, or
    nerfstudio's where the source is ours. Lenses that a format lacks are fitted, and the misfit is printed.

    For example:
      jaxsfs render plane --out view
      jaxsfs convert view/camera.json camera.yaml
    """
    with jax_session(64):
        return _convert(options)


def _convert(options: ConvertOptions) -> int:
    from jaxsfs import files

    source = _source_format(options)
    target = _target_format(options, source)
    done: dict[str, Any] = {"source": str(options.source), "target": str(options.target), "from": source, "to": target}
    camera, done["imported"] = _read(options, source)
    text, done["exported"] = _written(camera, target, done["imported"]["misfit"])
    files.write_bytes(options.target, text.encode(), force=options.force)
    _say(done, options.json)
    return 0


def _source_format(options: ConvertOptions) -> str:
    from jaxsfs import files
    from jaxsfs.convert import format_of_text

    if options.from_ is not None:
        return options.from_
    text = _text(options.source)
    if text.lstrip().startswith("{") and "model" in files.read_json(options.source):
        return _OWN
    try:
        return format_of_text(text)
    except ValueError as error:
        raise files.InputError(f"{options.source}: {error}") from None


def _target_format(options: ConvertOptions, source: str) -> str:
    from jaxsfs.convert import format_of_name

    if options.to is not None:
        return options.to
    return format_of_name(options.target) or ("nerfstudio" if source == _OWN else _OWN)


def _read(options: ConvertOptions, source: str) -> tuple["CameraFile", dict[str, Any]]:
    from jaxsfs import files
    from jaxsfs.camera import CameraFile
    from jaxsfs.convert import import_camera

    if source == _OWN:
        return files.read_camera(options.source), {"misfit": None, "not_read": []}
    try:
        found = import_camera(_text(options.source), source, options.size, options.tolerance)
    except ValueError as error:
        raise files.InputError(f"{options.source}: {error}") from None
    record = {"misfit": found.misfit and found.misfit._asdict(), "not_read": list(found.unused)}
    return CameraFile(found.camera, {}, {}), record


def _written(camera: "CameraFile", target: str, misfit: dict[str, float] | None) -> tuple[str, dict[str, Any]]:
    from jaxsfs.camera import camera_to_dict
    from jaxsfs.convert import export_camera

    if target == _OWN:
        record = camera_to_dict(camera) | ({"import_misfit_px": misfit} if misfit else {})
        return json.dumps(record, indent=2) + "\n", {"misfit": None, "not_written": []}
    made = export_camera(camera, target, f"imported as the nearest fisheye: {_in_words(misfit)}" if misfit else "")
    return made.text, {"misfit": made.misfit and made.misfit._asdict(), "not_written": list(made.lost)}


def _text(path: Path) -> str:
    from jaxsfs import files

    try:
        return files.read_bytes(path).decode("utf-8-sig")
    except UnicodeDecodeError:
        raise files.InputError(f"{path} is not a text file; expected a camera as JSON, YAML, XML or text") from None


def _say(done: dict[str, Any], as_json: bool) -> None:
    if as_json:
        print(json.dumps(done, indent=2))
    else:
        say(f"{done['target']}: {done['to']} camera from {done['source']} ({done['from']})")
    for step in ("imported", "exported"):
        if not as_json and (misfit := done[step]["misfit"]) is not None:
            say(f"{step} as the nearest fisheye: {_in_words(misfit)}")
    if skipped := done["imported"]["not_read"]:
        print(f"jaxsfs: not read: {', '.join(skipped)}", file=sys.stderr)
    if lost := done["exported"]["not_written"]:
        print(f"jaxsfs: not written, {done['to']} has no place for it: {', '.join(lost)}", file=sys.stderr)


def _in_words(misfit: dict[str, float]) -> str:
    from jaxsfs.convert import Misfit

    return str(Misfit(**misfit))
