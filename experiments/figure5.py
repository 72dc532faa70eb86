"""Figure 5 of the paper, with the error it lacks: synthetic pictures, true geometry, reconstruction, error map.

    python experiments/figure5.py --out out/figure5
    python experiments/figure5.py --quick

Six scenes in a round field of 50°, exact irradiance, albedo 1 known, nothing scaled. Each row of the figure: picture,
true surface and reconstructed surface from the side, relative error of range in per cent. The table also has the
paper's own method (spherical model, cone, first order, range n Δt) on the same pictures.
"""

import sys
from pathlib import Path

import jax.numpy as jnp
import numpy as np
from mesh_view import draw_mesh
from methods_near import paper
from near_scenes import NearImage, errors, near_image
from tables import main, pyplot, save, write_tables
from tqdm import tqdm

from jaxsfs import Irradiance, Reconstruction, Surface, mesh_from_surface, reconstruct

SCENES = ("tilted-plane", "ball", "wavy-wall", "tube", "polyps", "colon")


def solved(image: NearImage) -> Reconstruction:
    values = jnp.asarray(image.values, jnp.float32)
    return reconstruct(Irradiance(values, jnp.asarray(image.mask)), image.camera)


def row_of(name: str, image: NearImage, result: Reconstruction) -> dict:
    found = np.where(np.asarray(result.surface.valid), np.asarray(result.surface.range, float), np.nan)
    relative = np.abs(found / image.truth - 1)[image.mask & np.isfinite(found)]
    own, theirs = errors(image, found), errors(image, paper("cone")(image))
    return {
        "scene": name,
        "mean error %": f"{100 * relative.mean():.3f}",
        "median %": f"{100 * np.median(relative):.3f}",
        "95th percentile %": f"{100 * np.percentile(relative, 95):.3f}",
        "normals °": f"{own.normals_deg:.2f}",
        "AbsRel, median-aligned": f"{own.abs_rel:.5f}",
        "the paper's method, AbsRel": f"{theirs.abs_rel:.5f}",
        "its normals °": f"{theirs.normals_deg:.2f}",
    }


def draw(axes, name: str, image: NearImage, result: Reconstruction) -> None:
    """One row of the figure."""
    bright = np.where(image.mask, image.values, 0)
    axes[0].imshow(bright ** (1 / 2.2), cmap="gray")
    axes[0].set_ylabel(name)
    step = max(1, image.mask.shape[0] // 60)
    exact = Surface(image.camera, jnp.asarray(image.truth, jnp.float32), jnp.asarray(image.mask))
    for axis, surface in ((axes[1], exact), (axes[2], result.surface)):
        draw_mesh(axis, mesh_from_surface(surface, step=step))
    error = 100 * (np.asarray(result.surface.range, float) / image.truth - 1)
    shown = np.where(image.mask & np.asarray(result.surface.valid), error, np.nan)
    limit = max(float(np.nanpercentile(np.abs(shown), 98)), 0.01)
    map_ = axes[3].imshow(shown, cmap="coolwarm", vmin=-limit, vmax=limit)
    axes[3].figure.colorbar(map_, ax=axes[3], label="error of range, %")
    for axis in (axes[0], axes[3]):
        axis.set(xticks=[], yticks=[])


def run(out: Path, quick: bool) -> list[dict]:
    """Writes figure5.png and the table to `out`; returns the rows."""
    size, names = (65, SCENES[1:3]) if quick else (257, SCENES)
    plt = pyplot()
    figure = plt.figure(figsize=(14, 3.2 * len(names)), layout="constrained")
    rows = []
    for index, name in enumerate(tqdm(names, file=sys.stderr, disable=None)):
        image = near_image(name, size)
        result = solved(image)
        axes = [
            figure.add_subplot(len(names), 4, 4 * index + column + 1, projection="3d" if column in (1, 2) else None)
            for column in range(4)
        ]
        if index == 0:
            for axis, title in zip(axes, ("picture", "true geometry", "reconstruction", "error"), strict=True):
                axis.set_title(title)
        draw(axes, name, image, result)
        rows.append(row_of(name, image, result))
    save(figure, out / "figure5.png")
    print(write_tables(out, "figure5", {"figure 5": rows}))
    return rows


if __name__ == "__main__":
    main("Figure 5 of the paper: synthetic pictures, geometry, reconstruction, error.", run, "figure5")
