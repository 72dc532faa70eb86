"""A mesh that turns, inside a page: data as base64, a small WebGL program beside it, nothing from the network."""

import base64
import json
from html import escape
from importlib import resources

import numpy as np
import trimesh
from jaxtyping import Float, UInt8

from jaxsfs.geometry import Geometry
from jaxsfs.mesh import mesh_from_surface
from jaxsfs.report._scale import Scale
from jaxsfs.surface import Surface

_MOST_TRIANGLES = 150_000  # 4.3 MB in the page, drawn at once on any machine
_STOPS = 32  # of the range's colours
_LIFT = 0.5  # exponent of the photograph's brightness: the far end of a lumen must not be black
_HINT = "Drag turns, wheel or pinch zooms, shift-drag moves, double click resets. Click two points to measure."


def viewer(surface: Surface, rgb: UInt8[np.ndarray, "height width 3"], scale: Scale, unit: str, space: Geometry) -> str:
    """The surface as a mesh of at most 150 000 triangles, with a choice of colours. Distances are in `unit`."""
    step = max(1, int(np.ceil(np.sqrt(2 * np.asarray(surface.valid).sum() / _MOST_TRIANGLES))))
    mesh = mesh_from_surface(surface, step=step, space=space)
    if not len(mesh.faces):
        return "<p>There is no surface to turn.</p>"
    at = mesh.vertex_attributes["pixel"]
    return _element(mesh, _lifted(rgb)[at[:, 1], at[:, 0]], scale, unit)


def script() -> str:
    """The program behind every viewer of a page."""
    folder = resources.files("jaxsfs.report")
    text = "\n".join(folder.joinpath(name).read_text() for name in ("geodesic.js", "viewer.js", "controls.js"))
    return f'<script type="module">\n{text}</script>'


def _element(mesh: trimesh.Trimesh, colours: UInt8[np.ndarray, "count 3"], scale: Scale, unit: str) -> str:
    position = mesh.vertices.astype("<f4")
    centre, radius = _sphere(position)
    low, high = scale.low, scale.high
    about = {
        "vertices": len(position),
        "triangles": len(mesh.faces),
        "centre": centre,
        "radius": radius,
        "unit": unit,
        "range": {"low": low, "high": high, "table": scale.rgb(np.linspace(low, high, _STOPS)).tolist()},
    }
    parts = [
        position,
        mesh.faces.astype("<u4"),
        mesh.vertex_attributes["pixel"].astype("<u2"),
        colours,
    ]
    data = base64.b64encode(b"".join(part.tobytes() for part in parts)).decode()
    choices = "".join(f"<option>{name}</option>" for name in ("photograph", "range", "plaster"))
    return (
        f'<div class="viewer" data-about="{escape(json.dumps(about))}">'
        '<div class="stage"><canvas tabindex="0" role="img" aria-label="the surface as a mesh that turns"></canvas>'
        "<svg></svg></div>"
        f'<div class="tools"><label>Colour <select>{choices}</select></label><button type="button">Reset</button></div>'
        f'<p class="reading" aria-live="polite">{escape(_HINT)}</p>'
        f'<script type="application/octet-stream">{data}</script></div>'
    )


def _sphere(position: Float[np.ndarray, "count 3"]) -> tuple[list[float], float]:
    """Centre and radius of what to show first: without the farthest hundredth, which is often a stray."""
    low, high = np.percentile(position, [1, 99], axis=0)
    centre = (low + high) / 2
    radius = float(np.percentile(np.linalg.norm(position - centre, axis=1), 99))
    return centre.tolist(), max(radius, 1e-9)


def _lifted(rgb: UInt8[np.ndarray, "height width 3"]) -> UInt8[np.ndarray, "height width 3"]:
    """The photograph with its shadows raised, hue kept: the viewer lights the mesh a second time."""
    brightest = np.maximum(rgb.max(axis=-1), 1)
    top = float(np.percentile(brightest, 99))
    gain = np.minimum((brightest / top) ** (_LIFT - 1) * 255 / top, 255 / brightest)
    return (rgb * gain[..., None]).astype(np.uint8)
