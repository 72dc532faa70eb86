"""The programs of docs/viewers.md read what is written, at the place, size and colour that the page says.

None is an extra: Blender alone is 300 MB. With Python 3.11:

    pip install pymeshlab bpy==4.2.0 napari
    python -m pytest -W ignore tests/test_viewers.py
"""

import importlib.util
import json
import subprocess
import sys
from pathlib import Path

import jax.numpy as jnp
import numpy as np
import pytest

from jaxsfs import files
from jaxsfs.camera import Perspective
from jaxsfs.mesh import mesh_from_surface
from jaxsfs.surface import Surface

SHAPE = (12, 16)
COLOURS = np.full((*SHAPE, 3), (200, 40, 80), np.uint8)


@pytest.fixture(scope="module")
def written(tmp_path_factory) -> tuple[Path, np.ndarray]:
    """A folder with a mesh in mm in every format, and its vertices: off the axis, so that no two axes look alike."""
    folder = tmp_path_factory.mktemp("meshes")
    lengths = 30 + np.arange(12 * 16.0).reshape(SHAPE) / 20
    surface = Surface(Perspective(20.0, 20.0, 3.0, 8.0, 16, 12), jnp.asarray(lengths), jnp.ones(SHAPE, bool))
    mesh = mesh_from_surface(surface, COLOURS)
    for name in ("mesh.ply", "mesh.glb"):
        files.write_mesh(folder / name, mesh, "mm")
    files.write_stl(folder / "mesh.stl", mesh, "mm")
    files.write_obj(folder / "mesh.obj", mesh, COLOURS, "mm")
    return folder, np.asarray(mesh.vertices)


@pytest.mark.parametrize("name", ["mesh.ply", "mesh.stl", "mesh.obj"])
def test_meshlab(written, name):
    """As in the file, and turned by 180° about x as the page says: y up, towards the viewer."""
    pymeshlab = pytest.importorskip("pymeshlab", reason="MeshLab is not there: pip install pymeshlab")
    folder, vertices = written
    scene = pymeshlab.MeshSet()
    scene.load_new_mesh(str(folder / name))
    box = scene.current_mesh().bounding_box()
    np.testing.assert_allclose([box.min(), box.max()], [vertices.min(0), vertices.max(0)], atol=1e-4)
    if name == "mesh.ply":
        np.testing.assert_allclose(
            scene.current_mesh().vertex_color_matrix()[:, :3] * 255, np.broadcast_to(COLOURS[0, 0], vertices.shape)
        )
    scene.apply_filter("compute_matrix_from_rotation", rotaxis="X axis", angle=180.0)
    box = scene.current_mesh().bounding_box()
    turned = vertices * [1, -1, -1]
    np.testing.assert_allclose([box.min(), box.max()], [turned.min(0), turned.max(0)], atol=1e-4)


BLENDER = """
import bpy, json, sys
bpy.ops.wm.read_factory_settings(use_empty=True)
path = sys.argv[1]
if path.endswith("glb"):
    bpy.ops.import_scene.gltf(filepath=path)
else:
    read = getattr(bpy.ops.wm, path[-3:] + "_import")
    read(filepath=path, forward_axis="Z", up_axis="NEGATIVE_Y", global_scale=0.001)
shown = next(one for one in bpy.data.objects if one.type == "MESH")
print("found", json.dumps([list(shown.matrix_world @ vertex.co) for vertex in shown.data.vertices]), flush=True)
"""


@pytest.mark.skipif(importlib.util.find_spec("bpy") is None, reason="Blender is not there: pip install bpy==4.2.0")
@pytest.mark.parametrize("name", ["mesh.glb", "mesh.obj", "mesh.ply", "mesh.stl"])
def test_blender(written, name):
    """X right, Y forward, Z up, in metres. In a process of its own: its libraries and MeshLab's do not go together."""
    folder, vertices = written
    words = [sys.executable, "-c", BLENDER, str(folder / name)]
    # its exit status says nothing: as a module it may crash on its way out
    said = subprocess.run(words, capture_output=True, text=True, check=False)
    assert "found " in said.stdout, said.stderr
    found = np.array(json.loads(said.stdout.split("found ")[1].splitlines()[0]))
    wanted = vertices[:, [0, 2, 1]] * [1, 1, -1] / 1000
    np.testing.assert_allclose([found.min(0), found.max(0)], [wanted.min(0), wanted.max(0)], atol=1e-7)


@pytest.mark.filterwarnings("ignore")
def test_napari(written):
    """Vertices as (z, y, x), colours at the vertices; the model of the viewer, without a window."""
    components = pytest.importorskip("napari.components", reason="napari is not there: pip install napari")
    import trimesh

    folder, vertices = written
    mesh = trimesh.load(folder / "mesh.ply", process=False)
    viewer = components.ViewerModel(ndisplay=3, axis_labels=["z", "y", "x"])
    layer = viewer.add_surface((mesh.vertices[:, ::-1], mesh.faces), vertex_colors=mesh.visual.vertex_colors / 255)
    np.testing.assert_allclose(layer.extent.data, np.array([vertices.min(0), vertices.max(0)])[:, ::-1], atol=1e-4)
    np.testing.assert_allclose(layer.vertex_colors[0, :3] * 255, COLOURS[0, 0])
