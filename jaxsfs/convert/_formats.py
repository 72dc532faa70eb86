"""Other programs' formats by name, by file ending and by content."""

import functools
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from jaxsfs.convert._colmap import read_colmap, read_nerfstudio, write_colmap, write_nerfstudio
from jaxsfs.convert._opencv import read_opencv, write_opencv
from jaxsfs.convert._read import Read
from jaxsfs.convert._standard import Standard
from jaxsfs.convert._yaml import read_kalibr, read_ros, write_kalibr, write_ros


class Format(NamedTuple):
    """How a format is read and written; `write` None: read only."""

    read: Callable[[str], Read]
    write: Callable[[Standard, str], str] | None


FORMATS: dict[str, Format] = {
    "opencv": Format(read_opencv, write_opencv),
    "opencv-fisheye": Format(functools.partial(read_opencv, fisheye=True), None),
    "opencv-radtan": Format(functools.partial(read_opencv, fisheye=False), None),
    "kalibr": Format(read_kalibr, write_kalibr),
    "ros": Format(read_ros, write_ros),
    "colmap": Format(read_colmap, write_colmap),
    "nerfstudio": Format(read_nerfstudio, write_nerfstudio),
}
WRITABLE = tuple(name for name, entry in FORMATS.items() if entry.write is not None)


def format_of_text(text: str) -> str:
    """The format that `text` is in: the program's own marks are looked for. Raises ValueError where there are none."""
    lines = [line for line in text.splitlines() if line.strip() and not line.lstrip().startswith("#")]
    starts = {line.split(":")[0].strip() for line in lines if line[0].isalpha()}
    if text.lstrip().startswith(("%YAML", "<?xml")):
        return "opencv"
    if text.lstrip().startswith("{"):
        return "nerfstudio"
    if "cam0" in starts:
        return "kalibr"
    if starts & {"distortion_model", "projection_matrix", "rectification_matrix"}:
        return "ros"
    if any(key.lower() in ("camera_matrix", "cameramatrix", "k") for key in starts):
        return "opencv"
    if lines and len(lines[0].split()) > 4 and lines[0].split()[0].isdigit():
        return "colmap"
    raise ValueError(f"the format cannot be told from the content; name it (--from): {', '.join(FORMATS)}")


def format_of_name(path: str | Path) -> str | None:
    """The format that a file to be written is in by its name, None for one of ours (.json)."""
    name = Path(path).name.lower()
    if name.endswith((".yaml", ".yml")):
        return "kalibr" if "camchain" in name else "ros" if "camera_info" in name else "opencv"
    if name.endswith(".txt"):
        return "colmap"
    if name.endswith(".json"):
        return "nerfstudio" if name.startswith("transforms") else None
    raise ValueError(f"the format cannot be told from the name {name!r}; name it (--to): {', '.join(WRITABLE)}")
