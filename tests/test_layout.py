"""The layout of the package: imports point to a lower layer only, and the façade names everything once."""

import ast
from pathlib import Path

import pytest

import jaxsfs

ROOT = Path(jaxsfs.__file__).parent
LAYERS = (
    ("_arrays",),
    ("_lazy", "_once", "forms", "differences", "native"),
    ("camera", "reflectance", "upwind"),
    ("photometry", "irradiance", "surface", "shading", "window"),
    ("updates",),
    ("geometry", "arrival", "levelset", "sweeping", "initial", "lights", "occlusion", "rim", "status", "enclosed"),
    ("implicit",),
    ("front",),
    ("rendering", "reconstruction", "photo", "field", "specular", "noise"),
    ("evaluation", "mesh", "pictures", "animation", "calibration", "refinement", "preparation", "uncertainty"),
    ("comparison",),
    ("files", "convert", "target", "report", "estimation", "measuring", "frames"),
    ("video", "watch"),
    ("cli",),
    ("__main__",),
)
HEIGHT = {name: height for height, names in enumerate(LAYERS) for name in names}


def modules() -> list[Path]:
    return sorted(path for path in ROOT.rglob("*.py") if path != ROOT / "__init__.py")


def part(path: Path) -> str:
    """Top-level module or package of a file: jaxsfs/camera/_radial.py → camera."""
    return path.relative_to(ROOT).parts[0].removesuffix(".py")


def imports(path: Path) -> set[str]:
    found = set()
    for node in ast.walk(ast.parse(path.read_text())):
        if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] == "jaxsfs":
            # `from jaxsfs import files` names a module, `from jaxsfs import reconstruct` would be the façade
            found |= {f"jaxsfs.{alias.name}" if node.module == "jaxsfs" else node.module for alias in node.names}
        elif isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names if alias.name.split(".")[0] == "jaxsfs"}
    return found


def test_every_module_has_a_layer():
    assert {part(path) for path in modules()} <= HEIGHT.keys()


@pytest.mark.parametrize("path", modules(), ids=lambda path: str(path.relative_to(ROOT)))
def test_imports_point_to_a_lower_layer(path):
    own = part(path)
    for name in imports(path):
        target = name.removeprefix("jaxsfs").removeprefix(".").split(".")[0]
        assert target in HEIGHT, f"{path.name} imports the façade"
        assert target == own or HEIGHT[target] < HEIGHT[own], f"{own} (layer {HEIGHT[own]}) imports {target}"


def test_only_the_outermost_layers_touch_files():
    """Reading and writing live in files and cli, so the library works on arrays alone."""
    for path in modules():
        if HEIGHT[part(path)] < HEIGHT["files"]:
            calls = {
                node.func.attr if isinstance(node.func, ast.Attribute) else getattr(node.func, "id", "")
                for node in ast.walk(ast.parse(path.read_text()))
                if isinstance(node, ast.Call)
            }
            assert not calls & {"open", "imread", "imwrite", "write_text", "write_bytes", "read_text", "mkdir"}, path


def test_facade_names_exist_and_come_from_one_place():
    for name in jaxsfs.__all__:
        assert getattr(jaxsfs, name).__name__ == name
    with pytest.raises(AttributeError, match="no attribute 'Manager'"):
        _ = jaxsfs.Manager
