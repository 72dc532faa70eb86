"""Draws kept in a JSON lines file, so that a table of many hours can be made in pieces.

Each line holds a draw with its row, seed, and the version of the source that it depends on: a digest of the module that
calibrates, of all that this imports from here, and of what makes the photographs. Draws of other versions stay in the
file and are not used.
"""

import ast
import functools
import hashlib
import json
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[1]
_PACKAGES = ("jaxsfs", "data_synth")
_ALWAYS = ("data_synth.targets", "data_synth.target_patterns")


def module_for(row: str) -> str:
    """The module that calibrates the photographs of a row."""
    kind = row.split("-")[0]
    return "jaxsfs.calibration." + {"grid": "lines", "white": "white"}.get(kind, "circles")


@functools.cache
def version_of(module: str) -> str:
    """Digest of the sources on which the draws of a module depend."""
    files, waiting = {Path(__file__).with_name("calibration_draws.py")}, [module, *_ALWAYS]
    while waiting:
        path = _file(waiting.pop())
        if path is not None and path not in files:
            files.add(path)
            waiting += _imported(path)
    digest = hashlib.sha256()
    for path in sorted(files):
        digest.update(path.read_bytes())
    return digest.hexdigest()[:12]


def _file(module: str) -> Path | None:
    base = ROOT.joinpath(*module.split("."))
    return next((path for path in (base.with_suffix(".py"), base / "__init__.py") if path.is_file()), None)


def _imported(path: Path) -> list[str]:
    """Modules of this project that a file imports by `from … import …`, at its top or in functions."""
    names = []
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.module and node.module.split(".")[0] in _PACKAGES:
            # the public package only forwards names, and all of them
            if node.module not in _FORWARDING:
                names.append(node.module)
            names += [f"{node.module}.{name.name}" for name in node.names]
    return names


_FORWARDING = {"jaxsfs", "jaxsfs.calibration"}


class Store:
    """The file of draws."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self._draws: dict[tuple[str, int, str], dict[str, Any]] = {}
        if path.exists():
            for line in path.read_text(encoding="utf-8").splitlines():
                draw = json.loads(line)
                self._draws[draw["row"], draw["seed"], draw["version"]] = draw

    def get(self, row: str, seed: int) -> dict[str, Any] | None:
        """The draw of the present version, if it is there."""
        return self._draws.get((row, seed, version_of(module_for(row))))

    def add(self, draw: dict[str, Any]) -> None:
        """Keeps the draw under the present version, in the file at once."""
        draw = draw | {"version": version_of(module_for(draw["row"]))}
        self._draws[draw["row"], draw["seed"], draw["version"]] = draw
        self.path.parent.mkdir(parents=True, exist_ok=True)
        with self.path.open("a", encoding="utf-8") as file:
            file.write(json.dumps(draw, default=float) + "\n")
