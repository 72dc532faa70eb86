"""Figure 6 of the paper: a real endoscope picture, its reconstruction as a mesh from the side, its depth map.

    python experiments/figure6.py --out out/figure6
    JAXSFS_DATA=/data python experiments/figure6.py --quick

Pictures from ../shared/data (or JAXSFS_DATA); those that are absent are left out, with the reason printed. `sinus`:
a frame with its pinhole camera and structure-from-motion points, so that an error can be given (Spearman's rank
correlation and scale-aligned relative error of depth at the points). `gastric`: a published picture of unknown
camera, taken for a spherical one with a half field of 60° across its width: a look at the surface, not a measurement.
"""

import os
import sys
from pathlib import Path
from typing import NamedTuple

import numpy as np
from mesh_view import draw_mesh, face_colours
from real_cases import SINUS, Case, sinus_case
from real_solving import DEFAULT, SMOOTH, Settings, score, solve
from tables import main, pyplot, save, write_tables
from tqdm import tqdm

from jaxsfs import Reconstruction, Spherical, find_field, mesh_from_surface, read_image

DATA = Path(os.environ.get("JAXSFS_DATA", Path(__file__).parents[1] / "../shared/data"))
GASTRIC = Path("specular_endoscope") / "fig5_a.bmp"


class Example(NamedTuple):
    case: Case
    settings: Settings


def sinus(quick: bool) -> Example:
    return Example(sinus_case(DATA / SINUS, 4584, 4 if quick else 2), SMOOTH)


def gastric(quick: bool) -> Example:
    photo = read_image(DATA / GASTRIC)
    step = 2 if quick else 1
    values = photo.values[::step, ::step]
    height, width = values.shape[:2]
    f = width / 2 / np.sin(np.deg2rad(60))
    camera = Spherical(f=f, cx=(width - 1) / 2, cy=(height - 1) / 2, width=width, height=height)
    return Example(Case("gastric", values, find_field(values).mask, camera, photo.dtype, 1), DEFAULT)


EXAMPLES = {"sinus": (SINUS, sinus), "gastric": (GASTRIC, gastric)}


def row_of(name: str, example: Example, result: Reconstruction) -> dict:
    row = {"picture": name, "size": "{1} × {0}".format(*example.case.mask.shape), "settings": example.settings.name}
    row["status"] = result.status.name.lower()
    row |= dict.fromkeys(("Spearman, range", "Spearman, depth", "AbsRel of depth", "points"), "–")
    if example.case.points is not None:
        found = score(example.case, result)
        row |= {
            "Spearman, range": f"{found['spearman_range']:.3f}",
            "Spearman, depth": f"{found['spearman_depth']:.3f}",
            "AbsRel of depth": f"{found['abs_rel']:.3f}",
            "points": str(found["compared"]),
        }
    return row


def draw(axes, name: str, example: Example, result: Reconstruction) -> None:
    """Picture, mesh from the side in the picture's colours, z(u, v)."""
    picture = np.round(255 * np.clip(example.case.photo, 0, 1)).astype(np.uint8)
    if picture.ndim == 2:
        picture = np.repeat(picture[..., None], 3, axis=2)
    axes[0].imshow(picture)
    axes[0].set_ylabel(name)
    surface = result.surface
    mesh = mesh_from_surface(surface, step=max(1, min(picture.shape[:2]) // 110))
    draw_mesh(axes[1], mesh, elevation=30, azimuth=-65, colours=face_colours(mesh, picture))
    depth = np.where(np.asarray(surface.valid), np.asarray(surface.depth()), np.nan)
    low, high = np.nanpercentile(depth, [1, 99])
    map_ = axes[2].imshow(depth, cmap="viridis_r", vmin=low, vmax=high)
    axes[2].figure.colorbar(map_, ax=axes[2], label="z(u, v), scene units")
    for axis in (axes[0], axes[2]):
        axis.set(xticks=[], yticks=[])


def run(out: Path, quick: bool) -> list[dict]:
    """Writes figure6.png and the table to `out`, as far as the pictures are there; returns the rows."""
    found = {}
    for name, (path, make) in EXAMPLES.items():
        if (DATA / path).exists():
            found[name] = make
        else:
            print(f"{name}: left out, {DATA / path} is not there (set JAXSFS_DATA)")
    if not found:
        return []
    plt = pyplot()
    figure = plt.figure(figsize=(14, 4.2 * len(found)), layout="constrained")
    rows = []
    for index, (name, make) in enumerate(tqdm(found.items(), file=sys.stderr, disable=None)):
        example = make(quick)
        result = solve(example.case, example.settings)
        axes = [
            figure.add_subplot(len(found), 3, 3 * index + column + 1, projection="3d" if column == 1 else None)
            for column in range(3)
        ]
        draw(axes, name, example, result)
        rows.append(row_of(name, example, result))
    save(figure, out / "figure6.png")
    print(write_tables(out, "figure6", {"figure 6": rows}))
    return rows


if __name__ == "__main__":
    main("Figure 6 of the paper: a real endoscope picture, its mesh and its depth map.", run, "figure6")
