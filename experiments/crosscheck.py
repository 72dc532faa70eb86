"""An independent renderer against ours: Mitsuba's range and radiance, and meshes written by jaxsfs rendered by it.

    pip install ".[crosscheck]"
    python experiments/crosscheck.py --out out/crosscheck
    python experiments/crosscheck.py --quick

`exact`: three scenes × four cameras; Mitsuba intersects its own rectangle, sphere and cylinder with the camera's rays
and lights them from the origin; largest relative difference of range and radiance from `data_synth`'s formulas and
mean one of `render`, which differences the range map. `mesh`: each exact picture is reconstructed, the mesh written,
read by Mitsuba and rendered; relative difference of its radiance and range from the scene's, and of the ranges that
embree finds on the same mesh from Mitsuba's. Triangles are flat, so their radiance differs by part of a pixel's.
`--golden FILE` stores Mitsuba's answers for the tests.
"""

import argparse
import dataclasses
import json
import math
import sys
import tempfile
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import trimesh
from mitsuba_scenes import installed, mesh, shapes, traced
from tables import write_tables
from tqdm import tqdm

from data_synth import AbstractScene, Ball, Plane, Tube, View, observe
from jaxsfs import AbstractCamera, Irradiance, KannalaBrandt, Perspective, Scaramuzza, Spherical, reconstruct, render
from jaxsfs.files import write_mesh
from jaxsfs.mesh import mesh_from_surface

HALF_FIELD = 45
SHIFT = (0.31, 0.42)  # px
SCENES: dict[str, AbstractScene] = {
    "tilted plane": Plane(1.0, 0.3, -0.2),
    "ball": Ball(9.0, 0.3, -0.2, 10.0),
    "tube": Tube(1.0, 0.2, 0.1, 6.0),
}


def cameras(size: int) -> dict[str, AbstractCamera]:
    """Four lenses whose half field of 45° spans `size` pixels."""
    half, centre = math.radians(HALF_FIELD), (size - 1) / 2
    place = {"cx": centre, "cy": centre, "width": size, "height": size}
    k = (-0.1, 0.01, 0.0, 0.0)
    f = size / 2 / (half * (1 + k[0] * half**2 + k[1] * half**4))
    return {
        "spherical": Spherical(f=size / 2 / math.sin(half), **place),
        "perspective": Perspective(fx=size / 2, fy=size / 2, **place),
        "Kannala–Brandt": KannalaBrandt(fx=f, fy=f, k=k, **place),
        "Scaramuzza": Scaramuzza(
            a=(0.62 * size, 0.0, -0.5 / size, 0.1 / size**2, 0.0), c=1.002, d=0.003, e=-0.002, **place
        ),
    }


def view(scene: AbstractScene, camera: AbstractCamera) -> tuple[View, np.ndarray]:
    """The exact view and the camera's rays, double precision."""
    with jax.enable_x64(True):
        seen = observe(scene, camera, half_field_deg=HALF_FIELD)
        return jax.tree.map(np.asarray, seen), np.asarray(camera.rays())


def samples(seen: View, count: int) -> tuple[np.ndarray, np.ndarray]:
    """(v, u) of about count² pixels, evenly spaced, that the scene covers."""
    height, width = seen.surface.valid.shape
    steps = [np.unique(np.linspace(2, length - 3, count).round().astype(int)) for length in (height, width)]
    v, u = (part.ravel() for part in np.meshgrid(*steps, indexing="ij"))
    covered = seen.surface.valid[v, u]
    return v[covered], u[covered]


def exact_row(name: str, lens: str, size: int, count: int) -> tuple[dict, dict]:
    """The table's row, and Mitsuba's answers."""
    seen, rays = view(SCENES[name], cameras(size)[lens])
    v, u = samples(seen, count)
    distance, radiance = traced(shapes(SCENES[name]), rays[v, u])
    truth, light = seen.surface.range[v, u], seen.irradiance.values[v, u]
    with jax.enable_x64(True):
        made = jax.tree.map(np.asarray, render(jax.tree.map(jnp.asarray, seen.surface)))
    usable = made.valid[v, u]
    differenced = np.abs(made.values[v, u] / radiance - 1)[usable].mean()
    row = {
        "scene": name,
        "camera": lens,
        "rays": len(v),
        "range, max": f"{np.abs(distance / truth - 1).max():.1e}",
        "radiance, max": f"{np.abs(radiance / light - 1).max():.1e}",
        "render, mean": f"{differenced:.1e}",
    }
    golden = {"scene": name, "camera": lens, "size": size, "u": u.tolist(), "v": v.tolist()}
    golden |= {"range": digits(distance), "radiance": digits(radiance)}
    return row, golden


def digits(values: np.ndarray) -> list[float]:
    """What is worth storing of single precision."""
    return [float(f"{value:.7g}") for value in values]


def mesh_row(name: str, lens: str, size: int, count: int) -> dict:
    """Reconstruct, write the mesh, render it: back to the picture? Along rays between the pixels, which are the
    mesh's corners, where a ray may slip through."""
    camera = cameras(size)[lens]
    seen, _ = view(SCENES[name], camera)
    between, rays = view(SCENES[name], dataclasses.replace(camera, cx=camera.cx - SHIFT[0], cy=camera.cy - SHIFT[1]))
    irradiance = Irradiance(jnp.asarray(seen.irradiance.values, jnp.float32), jnp.asarray(seen.irradiance.valid))
    surface = reconstruct(irradiance, camera).surface
    v, u = samples(seen, count)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "mesh.ply"
        write_mesh(path, mesh_from_surface(surface), "scene units")
        distance, radiance = traced(mesh(path), rays[v, u])
        met, embree = embree_ranges(path, rays[v, u])
    hit = np.isfinite(distance)
    off = np.abs(radiance / between.irradiance.values[v, u] - 1)[hit]
    far = np.abs(distance / between.surface.range[v, u] - 1)[hit]
    return {"scene": name, "camera": lens, "rays met": f"{hit.mean():.3f}",
            "radiance, median": f"{np.median(off):.1e}", "radiance, 95 %": f"{np.percentile(off, 95):.1e}",
            "range, mean": f"{far.mean():.1e}", "range, max": f"{far.max():.1e}",
            "embree, max": f"{np.abs(embree / distance[met] - 1).max():.1e}"}  # fmt: skip


def embree_ranges(path: Path, rays: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Which rays meet the mesh, and where, by a third program."""
    from trimesh.ray.ray_pyembree import RayMeshIntersector

    points, met, _ = RayMeshIntersector(trimesh.load_mesh(path)).intersects_location(
        np.zeros_like(rays), rays, multiple_hits=False
    )
    return met, np.linalg.norm(points, axis=1)


def run(out: Path, quick: bool, golden: Path | None = None) -> dict[str, list[dict]]:
    """Writes the tables to `out` and returns their rows."""
    size, count = (65, 7) if quick else (257, 33)
    pairs = [(name, lens) for name in SCENES for lens in cameras(size)]
    exact, kept, meshes = [], [], []
    for name, lens in tqdm(pairs, file=sys.stderr, disable=None):
        row, answers = exact_row(name, lens, size, count)
        exact.append(row)
        kept.append(answers)
        meshes.append(mesh_row(name, lens, size, count))
    if golden is not None:
        golden.write_text("[\n" + ",\n".join(json.dumps(case) for case in kept) + "\n]\n", encoding="utf-8")
    tables = {"exact": exact, "mesh": meshes}
    print(write_tables(out, "crosscheck", tables))
    return tables


def main() -> int:
    parser = argparse.ArgumentParser(description="Mitsuba against our renderer and our meshes.")
    parser.add_argument("--out", type=Path, default=Path("out/crosscheck"), help="folder for the tables")
    parser.add_argument("--quick", action="store_true", help="small pictures and few rays, seconds")
    parser.add_argument("--golden", type=Path, help="also store Mitsuba's answers in this file (with --quick)")
    options = parser.parse_args()
    if not installed():
        print('Mitsuba is not installed (pip install ".[crosscheck]"): nothing was checked', file=sys.stderr)
        return 2
    run(options.out, options.quick, options.golden)
    return 0


if __name__ == "__main__":
    sys.exit(main())
