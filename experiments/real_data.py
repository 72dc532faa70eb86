"""Reconstructions of real photographs, and how they compare with what is known of their scenes.

    python experiments/real_data.py --out out/real_data
    python experiments/real_data.py --quick --variants

* Sinus endoscopy in vivo, frames 4584 and 4600: points that structure from motion found, with the frames that see
  each of them. Up to one factor of scale, as shape from shading is.
* Colonoscopy rendered in Unity (SimCol3D), frames 0000 and 0004: depth at every pixel. Two readings of its camera
  circulate and the pictures do not tell which is right: both are reported.

The data lie beside the project, under `--data` (see SOURCE.txt there). Prints a table, and writes it with the command
that made it and a picture per frame: photograph | depth (yellow near, violet far) | shaded from the upper left | truth.
"""

import argparse
import csv
import dataclasses
import os
import re
import shlex
import sys
import time
from pathlib import Path
from typing import Any, NamedTuple

import cv2
import jax
import jax.numpy as jnp
import numpy as np
from scipy.stats import spearmanr

from jaxsfs import (
    AbstractCamera,
    Perspective,
    Reconstruction,
    depth_picture,
    evaluate,
    find_field,
    parse_falloff,
    parse_reflectance,
    parse_response,
    read_image,
    read_map,
    read_mask,
    reconstruct,
    shaded_picture,
)
from jaxsfs.files import write_png
from jaxsfs.photo import automatic_response, clipping_limit, parse_channel
from jaxsfs.preparation import prepare
from jaxsfs.specular import Method

SINUS, SIMCOL = "sinus_endoscope", "simcol3d"
SINUS_FRAMES, SIMCOL_FRAMES = (4584, 4600), ("0000", "0004")
# fx, fy, cx, cy: the data set's own script, and what others use.
SIMCOL_CAMERAS = {"A": (227.6, 237.5, 227.6, 237.5), "B": (227.60416, 227.60416, 237.5, 237.5)}
SIMCOL_CM = 20 / 255 / 256  # depth per stored step


class Settings(NamedTuple):
    """What a user can choose, in the words of the command line. `response` "auto": what the stored type stands for.

    `smooth` is σ in px of the photograph's full size; `clip` None: the limit of the stored type.
    """

    name: str
    response: str = "auto"
    falloff: str = "none"
    reflectance: str = "lambertian"
    channel: str = "luminance"
    smooth: float = 0.0
    order: int = 2
    clip: float | None = None
    specular: Method = "auto"
    blood: float = 0.0


DEFAULT = Settings("default options")
PRESET = Settings("preset", response="gamma:2.2", falloff="cos:1.6", reflectance="power:0.65")
EVEN = Settings("even weights, sRGB, cos:1.6", response="srgb", falloff="cos:1.6", channel="1,1,1")
# Mostly red, the channel that blood in the mucosa darkens least. Weights chosen on the two sinus frames.
RED_RICH = Settings("red-rich 6:3:1, sRGB", response="srgb", channel="0.6,0.3,0.1")
# Red, corrected for blood by the optical densities of haemoglobin.
BLOOD = Settings("red, blood 0.15, sRGB", response="srgb", channel="red", blood=0.15)
# Smooth until vessels are no relief: σ of 8 px of the full size chosen on frame 4600, seen once on 4584.
SMOOTH = BLOOD._replace(name="red, blood 0.15, smooth 8, sRGB", smooth=8.0)
SHOWN = {"default": DEFAULT, "preset": PRESET, "even": EVEN, "red-rich": RED_RICH, "blood": BLOOD, "smooth": SMOOTH}
VARIANTS = (
    Settings("sRGB", response="srgb"),
    Settings("sRGB, cos:1.6", response="srgb", falloff="cos:1.6"),
    Settings("sRGB, red", response="srgb", channel="red"),
    Settings("sRGB, green", response="srgb", channel="green"),
    Settings("sRGB, blue", response="srgb", channel="blue"),
    Settings("sRGB, even weights", response="srgb", channel="1,1,1"),
    PRESET._replace(name="preset, even weights", channel="1,1,1"),
    PRESET._replace(name="preset, smooth 4", smooth=4.0),
    PRESET._replace(name="preset, order 1", order=1),
    DEFAULT._replace(name="default, highlights left in", specular="off"),
    PRESET._replace(name="preset, highlights left in", specular="off"),
    PRESET._replace(name="preset, clipped from 0.99", clip=0.99),
)
GAMMAS = (1.8, 2.2, 2.4, 2.6, 2.8, 3.2)


@dataclasses.dataclass(frozen=True)
class Case:
    """A photograph with what is known of its scene: depth at every pixel, or points in the camera frame.

    `shrink`: how many pixels of the original make one here.
    """

    name: str
    photo: np.ndarray
    mask: np.ndarray
    camera: AbstractCamera
    dtype: str
    shrink: int
    depth: np.ndarray | None = None
    points: np.ndarray | None = None

    def pixels(self) -> np.ndarray:
        """(u, v) of the pixel nearest to each point."""
        return np.round(np.asarray(jax.vmap(self.camera.project)(jnp.asarray(self.points)))).astype(int)


def cases(data: Path, quick: bool) -> list[Case]:
    """All photographs; `quick`: the sinus at a quarter of its size, the colon at half of it."""
    sinus = [sinus_case(data / SINUS, frame, 4 if quick else 2) for frame in SINUS_FRAMES]
    colon = [
        simcol_case(data / SIMCOL, frame, camera, 2 if quick else 1)
        for frame in SIMCOL_FRAMES
        for camera in SIMCOL_CAMERAS
    ]
    return sinus + colon


def sinus_case(folder: Path, frame: int, shrink: int) -> Case:
    """An endoscopic frame with the points it sees, cut to what its mask and the scope's round field have in common
    (the data's mask also covers some of the black border)."""
    photo = read_image(folder / f"{frame:08d}.jpg")
    mask = read_mask(folder / "undistorted_mask.jpg") & find_field(photo.values).mask
    fx, fy, cx, cy = (float(x) for x in (folder / "camera_intrinsics_per_view").read_text().split())
    height, width = mask.shape
    rows, columns = np.flatnonzero(mask.any(axis=1)), np.flatnonzero(mask.any(axis=0))
    left, top = int(columns[0]), int(rows[0])
    # whole blocks of shrink × shrink px
    wide, high = ((int(last) - first + 1) // shrink * shrink for first, last in ((left, columns[-1]), (top, rows[-1])))
    cut = np.s_[top : top + high, left : left + wide]
    camera = Perspective(fx, fy, cx, cy, width, height).cropped(left, top, wide, high)
    return Case(
        name=f"sinus {frame}",
        photo=_shrunk(photo.values[cut], shrink),
        mask=_shrunk(mask[cut].astype(np.float32), shrink) > 0.99,
        camera=camera.resized(wide // shrink, high // shrink),
        dtype=photo.dtype,
        shrink=shrink,
        points=structure_points(folder, frame).astype(np.float32),
    )


def structure_points(folder: Path, frame: int) -> np.ndarray:
    """Points (n, 3) that structure from motion saw in `frame`, in its camera frame.

    motion.yaml has the camera's position t and orientation R (a quaternion) in the world, for the frames of
    selected_indexes in turn: X_camera = Rᵀ (X_world − t). view_indexes_per_point has a −1 before each point's frames.
    """
    order = [int(word) for word in (folder / "selected_indexes").read_text().split()]
    numbers = re.findall(r"^\s+[xyzw]: (\S+)", (folder / "motion.yaml").read_text(), re.MULTILINE)
    poses = np.array(numbers, float).reshape(-1, 7)
    if len(poses) != len(order):
        raise ValueError(f"motion.yaml has {len(poses)} poses for {len(order)} frames of selected_indexes")
    position, (x, y, z, w) = np.split(poses[order.index(frame)], [3])
    rotation = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )
    header, _, rows = (folder / "structure.ply").read_text().partition("end_header\n")
    count = int(re.search(r"element vertex (\d+)", header)[1])
    world = np.array([line.split() for line in rows.splitlines()[:count]], float)
    seen_by = (folder / "view_indexes_per_point").read_text().split("-1")[1:]
    if len(seen_by) != count:
        raise ValueError(f"view_indexes_per_point has {len(seen_by)} points, structure.ply {count}")
    visible = [str(frame) in frames.split() for frames in seen_by]
    return ((world - position) @ rotation)[visible]


def simcol_case(folder: Path, frame: str, camera: str, shrink: int) -> Case:
    """A rendered colonoscopy frame with its depth; `camera`: a reading of SIMCOL_CAMERAS."""
    photo = read_image(folder / f"FrameBuffer_{frame}.png")
    depth = read_map(folder / f"Depth_{frame}.png", scale=SIMCOL_CM)
    height, width = photo.valid.shape
    wide, high = width // shrink, height // shrink
    cut = np.s_[: high * shrink, : wide * shrink]
    whole = Perspective(*SIMCOL_CAMERAS[camera], width, height).cropped(0, 0, wide * shrink, high * shrink)
    return Case(
        name=f"simcol {frame} {camera}",
        photo=_shrunk(photo.values[cut], shrink),
        mask=np.ones((high, wide), bool),
        camera=whole.resized(wide, high),
        dtype=photo.dtype,
        shrink=shrink,
        # a mean of depths across an occlusion is the depth of nothing
        depth=depth[cut][shrink // 2 :: shrink, shrink // 2 :: shrink],
    )


def solve(case: Case, settings: Settings) -> Reconstruction:
    """The surface in `case.photo`."""
    response = automatic_response(case.dtype) if settings.response == "auto" else settings.response
    prepared = prepare(
        case.photo,
        case.camera,
        valid=case.mask,
        response=parse_response(response),
        falloff=parse_falloff(settings.falloff),
        weights=parse_channel(settings.channel),
        smooth_px=settings.smooth / case.shrink,
        clip_limit=clipping_limit(case.dtype) if settings.clip is None else settings.clip,
        specular=settings.specular,
        blood=settings.blood,
    )
    return reconstruct(
        prepared.irradiance, case.camera, reflectance=parse_reflectance(settings.reflectance), order=settings.order
    )


def score(case: Case, result: Reconstruction) -> dict[str, Any]:
    """Figures of a result. Relative errors are those of depth after one factor, the ratio of the medians."""
    surface = result.surface
    valid = np.asarray(surface.valid)
    estimated_range = np.where(valid, np.asarray(surface.range), np.nan).astype(float)
    estimated = np.where(valid, np.asarray(surface.depth()), np.nan).astype(float)
    if case.depth is not None:
        both = valid & np.isfinite(case.depth)
        rays = np.asarray(case.camera.rays())[..., 2]
        z, r, true_z, true_r = estimated[both], estimated_range[both], case.depth[both], (case.depth / rays)[both]
    else:
        u, v = case.pixels().T
        height, width = valid.shape
        on = (u >= 0) & (u < width) & (v >= 0) & (v < height)
        on[on] = valid[v[on], u[on]]
        z, r = estimated[v[on], u[on]], estimated_range[v[on], u[on]]
        true_z, true_r = case.points[on, 2].astype(float), np.linalg.norm(case.points[on].astype(float), axis=1)
    errors = evaluate(z[None], true_z[None], quantity="depth", align="median")
    known = case.depth.size if case.depth is not None else len(case.points)
    return {
        "spearman_depth": float(spearmanr(z, true_z).statistic),
        "spearman_range": float(spearmanr(r, true_r).statistic),
        "abs_rel": errors.abs_rel,
        "median_rel": errors.median_rel,
        "compared": len(z),
        "known": known,
        "residual": result.statistics.residual_mean,
        "status": result.status.name,
    }


def fit_gamma(case: Case, settings: Settings) -> Settings:
    """`settings` with the gamma of GAMMAS whose depth is nearest to the truth: this uses the truth of the frame."""
    tried = [settings._replace(response=f"gamma:{gamma:g}") for gamma in GAMMAS]
    best = min(tried, key=lambda one: score(case, solve(case, one))["abs_rel"])
    return best._replace(name=f"{settings.name}, {best.response} fitted to the truth")


def panel(case: Case, result: Reconstruction) -> np.ndarray:
    """Photograph | depth | shaded | truth side by side."""
    photo = np.round(255 * np.clip(case.photo, 0, 1)).astype(np.uint8)
    if case.depth is not None:
        truth = depth_picture(case.depth, np.isfinite(case.depth))
    else:
        spots = np.zeros(case.mask.shape, np.float32)
        for (u, v), point in zip(case.pixels(), case.points, strict=True):
            cv2.circle(spots, (int(u), int(v)), max(2, 10 // case.shrink), float(point[2]), -1)
        truth = np.where((spots > 0)[..., None], depth_picture(spots, spots > 0), photo // 3)
    surface = result.surface
    return np.hstack([photo, depth_picture(surface.depth(), surface.valid), shaded_picture(surface), truth])


# Seen on the pictures of `--quick`; look again when the reconstruction changes.
LOOKED_AT = {
    "sinus 4584": (
        "agrees. The tongue-shaped turbinate stands forward between two grooves, which are the two dark gaps of the "
        "photograph: one on its left up to the top right, one on its right, the farthest place of all. The wall at the "
        "lower left, the brightest of the photograph, is the nearest; the wall at the right edge comes forward again. "
        "Wrong: the wet highlight in the middle becomes a small cone with a ring on top, as bright means near, with "
        "fine ridges that run away from it; the vessels, painted on in truth, become fine relief; at the sharp limbs "
        "of the turbinate the surface slopes down to the gap where really it ends."
    ),
    "sinus 4600": (
        "agrees in the same way, with the right wall, now larger and brighter, as near as the left one. Wrong: the "
        "highlight is a cone again, and a second, small one at the top right makes a peak where the passage goes on."
    ),
    "simcol 0000": (
        "agrees in the large. The lumen is a pit at the right place, left of and above the centre; the nearest wall is "
        "the bright one at the lower left, and the fold before the lumen is a ledge whose edge the shaded picture "
        "shows, clearer with the preset than with default options. Wrong: the depth does not step at that edge but "
        "slopes down; the pit is one wide cone, where the truth has rings with a far, sharply bordered end; the lower "
        "right corner comes out too near; the vessels become fine relief."
    ),
    "simcol 0004": (
        "agrees in the same way: pit at the right place, bright lower wall nearest, the step at the fold's edge "
        "present with the preset and washed out with default options; the lumen's end a cone instead of rings."
    ),
}


def run(data: Path, out: Path, quick: bool, variants: bool, command: str) -> list[dict[str, Any]]:
    """Solves, scores, prints and writes everything; the rows of the table."""
    out.mkdir(parents=True, exist_ok=True)
    rows = []
    for case in cases(data, quick):
        chosen = [*SHOWN.values(), *(VARIANTS if variants else ())]
        if case.depth is not None:
            chosen += [fit_gamma(case, DEFAULT), fit_gamma(case, PRESET)]
        for settings in chosen:
            begin = time.perf_counter()
            result = solve(case, settings)
            seconds = time.perf_counter() - begin
            rows.append({"picture": case.name, "settings": settings.name, **score(case, result), "seconds": seconds})
            print(_line(rows[-1]), flush=True)
            label = next((label for label, shown in SHOWN.items() if shown == settings), None)
            if label is not None:
                write_png(out / f"{case.name.replace(' ', '_')}_{label}.png", panel(case, result), force=True)
    with (out / "real_data.csv").open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, rows[0])
        writer.writeheader()
        writer.writerows(rows)
    (out / "real_data.md").write_text(_markdown(rows, quick, command), encoding="utf-8")
    return rows


_HEAD = (
    "| picture | settings | Spearman depth | Spearman range | AbsRel | median | compared | residual | status |\n"
    "|---|---|---|---|---|---|---|---|---|"
)


def _line(row: dict[str, Any]) -> str:
    return (
        f"| {row['picture']} | {row['settings']} | {row['spearman_depth']:.3f} | {row['spearman_range']:.3f} | "
        f"{row['abs_rel']:.3f} | {row['median_rel']:.3f} | {row['compared']} of {row['known']} | "
        f"{row['residual']:.3f} | {row['status']} |"
    )


def _markdown(rows: list[dict[str, Any]], quick: bool, command: str) -> str:
    size = "sinus at 1/4, simcol at 1/2 of its size" if quick else "sinus at 1/2 of its size, simcol full"
    seen = "\n".join(f"* **{name}**: {words}" for name, words in LOOKED_AT.items())
    table = "\n".join([_HEAD, *map(_line, rows)])
    return (
        f"# Real photographs\n\nMade by `{command}` ({size}).\n\n"
        "AbsRel and median: relative error of depth after one factor, the ratio of the medians. The truth is points of "
        "structure from motion (sinus) or depth at every pixel (simcol; A: fx 227.6, fy 237.5, cx 227.6, cy 237.5; B: "
        "fx = fy = 227.60416, cx = cy = 237.5). Preset: gamma 2.2, fall-off cos^1.6, reflectance cos^0.65. A row that "
        f"says fitted chose gamma by the truth of its own frame; the red-rich weights were "
        f"chosen on the sinus frames, the smoothing on 4600.\n\n{table}\n\n## What the pictures show\n\n{seen}\n"
    )


def _shrunk(image: np.ndarray, shrink: int) -> np.ndarray:
    height, width = image.shape[:2]
    return cv2.resize(image, (width // shrink, height // shrink), interpolation=cv2.INTER_AREA)


def main() -> int:
    """Reads the options and runs everything; exit code 2 without the data."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    beside = Path(__file__).resolve().parents[1] / "../shared/data"
    default = Path(os.environ.get("JAXSFS_DATA", beside))
    parser.add_argument("--data", type=Path, default=default, help="default: JAXSFS_DATA, or ../shared/data")
    parser.add_argument("--out", type=Path, default=Path("out/real_data"), help="folder for table and pictures")
    parser.add_argument("--quick", action="store_true", help="smaller pictures")
    parser.add_argument("--variants", action="store_true", help="other channels, smoothing, order, clipping limit too")
    options = parser.parse_args()
    missing = [name for name in (SINUS, SIMCOL) if not (options.data / name).is_dir()]
    if missing:
        print(f"no {' or '.join(missing)} in {options.data}; set --data or JAXSFS_DATA", file=sys.stderr)
        return 2
    command = shlex.join(["python", "experiments/real_data.py", *sys.argv[1:]])
    print(_HEAD)
    run(options.data, options.out, options.quick, options.variants, command)
    print(f"\nTo look at: {options.out}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
