"""What tests of the command line share: a rendered view, the words that reconstruct it, and what was written."""

import json
from pathlib import Path

from jaxsfs.cli import main

SMALL = ["--width", "96", "--height", "96"]


def rendered(folder: Path) -> Path:
    """`folder`, with a small view of a wavy wall in it."""
    assert main(["render", "wavy-wall", *SMALL, "--falloff", "cos:1", "--bits", "16", "--out", str(folder)]) == 0
    return folder


def reconstruct(view: Path, out: Path, *more: str) -> list[str]:
    return ["reconstruct", str(view / "image.png"), "--camera", str(view / "camera.json"), "--out", str(out), *more]


def record(folder: Path) -> dict:
    return json.loads((folder / "result.json").read_text())
