"""The same scenes as Mitsuba's own shapes, seen along the same rays: nothing of our geometry or shading is used.

Needs the extra `crosscheck`. The light is a point at the origin, I = π, so that a white diffuse wall has E = cos θ/r².
"""

import importlib.util
import math
from pathlib import Path
from typing import Any

import numpy as np

from data_synth import AbstractScene, Ball, Plane, Tube

_EDGE = 20.0  # half the side of a wall, in scene units; its matrix is in single precision


def installed() -> bool:
    """Whether the extra is there."""
    return importlib.util.find_spec("mitsuba") is not None


def mitsuba() -> Any:
    """The package in its plain variant, which needs no compiler on the machine."""
    import mitsuba

    mitsuba.set_variant("scalar_rgb")
    return mitsuba


def light() -> dict:
    """The light at the projection centre."""
    return {"type": "point", "position": [0.0, 0.0, 0.0], "intensity": {"type": "rgb", "value": math.pi}}


def wall(albedo: float) -> dict:
    """A diffuse surface, the same from both sides."""
    return {"type": "twosided", "bsdf": {"type": "diffuse", "reflectance": {"type": "rgb", "value": albedo}}}


def plastic(colour: tuple[float, float, float], roughness: float, coat: float = 1.0) -> dict:
    """A diffuse surface under a rough coat of wet tissue's index, as bright as `coat` of what it reflects."""
    material = {
        "type": "roughplastic",
        "distribution": "ggx",
        "int_ior": 1.4,
        "alpha": roughness,
        "diffuse_reflectance": {"type": "rgb", "value": list(colour)},
        "specular_reflectance": {"type": "rgb", "value": coat},
    }
    return {"type": "twosided", "bsdf": material}


def shapes(scene: AbstractScene, bsdf: dict | None = None) -> dict[str, dict]:
    """`scene` by a rectangle, a sphere, a cylinder with a disk; of a white diffuse wall if no material is given."""
    transform, material = mitsuba().ScalarTransform4f, {"bsdf": wall(1.0) if bsdf is None else bsdf}
    if isinstance(scene, Plane):
        normal = [-float(scene.slope_x), -float(scene.slope_y), 1.0]
        place = transform().look_at([0, 0, float(scene.h)], [*normal[:2], float(scene.h) + 1], [0, 1, 0])
        return {"plane": {"type": "rectangle", "to_world": place @ transform().scale(_EDGE)} | material}
    if isinstance(scene, Ball):
        centre = [float(scene.x), float(scene.y), float(scene.z)]
        return {"ball": {"type": "sphere", "center": centre, "radius": float(scene.radius)} | material}
    if isinstance(scene, Tube):
        x, y, radius, length = float(scene.x), float(scene.y), float(scene.radius), float(scene.length)
        end = transform().translate([x, y, length]) @ transform().scale(radius)
        return {
            "wall": {"type": "cylinder", "p0": [x, y, -length], "p1": [x, y, length], "radius": radius} | material,
            "end": {"type": "disk", "to_world": end} | material,
        }
    raise ValueError(f"no Mitsuba shape for {type(scene).__name__}; there are Plane, Ball and Tube")


def mesh(path: Path, albedo: float = 1.0) -> dict[str, dict]:
    """A written mesh, its triangles flat."""
    return {"mesh": {"type": "ply", "filename": str(path), "face_normals": True, "bsdf": wall(albedo)}}


def traced(things: dict[str, dict], rays: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Range and radiance (direct light) along unit `rays` (count, 3) from the origin; NaN where nothing is met."""
    mi = mitsuba()
    scene = mi.load_dict({"type": "scene", "integrator": {"type": "direct"}, "light": light()} | things)
    sampler = mi.load_dict({"type": "independent"})
    sampler.seed(0)
    integrator = scene.integrator()
    ranges, radiances = np.full(len(rays), np.nan), np.full(len(rays), np.nan)
    for index, direction in enumerate(rays):
        ray = mi.RayDifferential3f(mi.Ray3f([0, 0, 0], direction.tolist()))
        found = scene.ray_intersect(ray)
        if found.is_valid():
            ranges[index] = found.t
            radiances[index] = integrator.sample(scene, sampler, ray)[0][0]
    return ranges, radiances


def pictured(
    things: dict[str, dict], field_deg: float, size: int, bounces: int, samples: int, colour: bool = False
) -> np.ndarray:
    """A pinhole's picture (size, size) of linear radiance, or of three `colour` channels, `field_deg` from side to
    side; light that has met the wall up to `bounces` times."""
    mi = mitsuba()
    transform = mi.ScalarTransform4f
    sensor = {
        "type": "perspective",
        "fov": field_deg,
        # Mitsuba's camera has x to the left of its picture; ours x to the right, y down, z forward
        "to_world": transform().look_at([0, 0, 0], [0, 0, 1], [0, -1, 0]),
        "film": {"type": "hdrfilm", "width": size, "height": size,
                 "pixel_format": "rgb" if colour else "luminance",
                 "rfilter": {"type": "box"}},
        "sampler": {"type": "multijitter", "sample_count": samples, "seed": 1},
    }  # fmt: skip
    integrator = {"type": "path", "max_depth": bounces + 1, "rr_depth": 64}
    scene = mi.load_dict({"type": "scene", "integrator": integrator, "light": light(), "sensor": sensor} | things)
    picture = np.asarray(mi.render(scene)).astype(float)
    return picture if colour else picture[..., 0]
