"""Evaluates jaxsfs on a downloaded C3VD folder (Bobrow et al. 2023), frame by frame, with the field's measures.

    python experiments/c3vd.py --root /data/c3vd --out out/c3vd
    python experiments/c3vd.py --root /data/c3vd --every 20 --width 675

`--root` holds one folder per video with NNNN_color.png (or .jpg) and NNNN_depth.tiff (16 bit, 0–100 mm along z), and
the camera: camera.json (a camera file of jaxsfs), or camera_intrinsics.txt of the data set (width, height, cx, cy, a0,
a1, a2, a3, a4, c, d, e: an OCamCalib polynomial; its pixel origin is taken as it stands). Depth 0 and above 100 mm
does not count; each prediction is scaled by the ratio of medians, as PPSNet and LightDepth do. Resumable: frames.csv
keeps a line per finished frame, `--again` starts afresh. The table has the mean over frames per video, and over all
frames.
"""

import argparse
import csv
import re
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

import cv2
import jax.numpy as jnp
import numpy as np
import tifffile
from tables import write_tables
from tqdm import tqdm

from jaxsfs import AbstractCamera, Scaramuzza, evaluate, find_field, read_camera, read_image, reconstruct
from jaxsfs.comparison import METRIC_SETS, measures_of
from jaxsfs.noise import noise_level, smoothing_for
from jaxsfs.photo import parse_channel
from jaxsfs.photometry import parse_falloff, parse_response
from jaxsfs.preparation import prepare
from jaxsfs.reflectance import parse_reflectance

FULL_SCALE_MM = 100.0
RULES = METRIC_SETS["c3vd"]


class Frame(NamedTuple):
    video: str
    number: str
    colour: Path
    depth: Path


class Photometry(NamedTuple):
    """What is taken for known about the scope, in the words of the command line."""

    response: str = "srgb"
    falloff: str = "none"
    reflectance: str = "lambertian"


def frames(root: Path, every: int) -> list[Frame]:
    """All frames that have a colour picture and a depth, every `every`-th of each video."""
    found = []
    for folder in sorted(path for path in root.iterdir() if path.is_dir()):
        mine = []
        for depth in sorted(folder.glob("*_depth.tif*")):
            number = depth.name.split("_depth")[0]
            colours = [folder / f"{number}_color{suffix}" for suffix in (".png", ".jpg")]
            colour = next((path for path in colours if path.is_file()), None)
            if colour is not None:
                mine.append(Frame(folder.name, number, colour, depth))
        found += mine[::every]
    return found


def camera_at(root: Path) -> AbstractCamera:
    """The camera of the data set. Raises ValueError that says which file is wanted."""
    if (root / "camera.json").is_file():
        return read_camera(root / "camera.json").camera
    path = root / "camera_intrinsics.txt"
    if not path.is_file():
        raise ValueError(f"{root} has neither camera.json nor camera_intrinsics.txt")
    number = r"([-+]?\d*\.?\d+(?:[eE][-+]?\d+)?)"
    values = dict(re.findall(rf"\b(width|height|cx|cy|a[0-4]|[cde])\b\W+?{number}", path.read_text(encoding="utf-8")))
    missing = {"width", "height", "cx", "cy", "a0", "a2", "a3", "a4"} - values.keys()
    if missing:
        raise ValueError(f"{path} lacks {', '.join(sorted(missing))}; expected lines such as 'a0 769.24'")
    get = {key: float(text) for key, text in values.items()}
    a = tuple(get.get(f"a{n}", 0.0) for n in range(5))
    stretch = {"c": get.get("c", 1.0), "d": get.get("d", 0.0), "e": get.get("e", 0.0)}
    return Scaramuzza(a, get["cx"], get["cy"], int(get["width"]), int(get["height"]), **stretch)


def measured(frame: Frame, camera: AbstractCamera, width: int | None, scope: Photometry) -> dict[str, float]:
    """The measures of one frame, at `width` px across."""
    photo = read_image(frame.colour).values.astype(np.float64)
    depth = tifffile.imread(frame.depth).astype(np.float64) * (FULL_SCALE_MM / 65535)
    if width is not None and width < photo.shape[1]:
        height = round(photo.shape[0] * width / photo.shape[1])
        photo = cv2.resize(photo, (width, height), interpolation=cv2.INTER_AREA)
        # a mean of depths across an edge is the depth of nothing
        depth = cv2.resize(depth, (width, height), interpolation=cv2.INTER_NEAREST)
    size = photo.shape[1], photo.shape[0]
    camera = camera if size == (camera.width, camera.height) else camera.resized(*size)
    mask = find_field(photo).mask
    made = prepare(
        photo, camera, response=parse_response(scope.response), falloff=parse_falloff(scope.falloff),
        weights=parse_channel("luminance"), valid=mask, smooth_px=smoothing_for(noise_level(photo, mask)),
    ).irradiance  # fmt: skip
    made = type(made)(made.values.astype(jnp.float32), made.valid)
    surface = reconstruct(made, camera, reflectance=parse_reflectance(scope.reflectance)).surface
    counted = (depth > RULES.low) & (depth <= RULES.high)
    predicted = np.where(np.asarray(surface.valid), np.asarray(surface.depth()), np.nan)
    truth = np.where(counted, depth, np.nan)
    found = evaluate(predicted, truth, quantity=RULES.quantity, align=RULES.align)
    return measures_of(found, "c3vd") | {"fraction": found.fraction}


def finished(path: Path) -> Iterator[dict[str, str]]:
    """Lines of an earlier run."""
    if path.is_file():
        with path.open(encoding="utf-8", newline="") as lines:
            yield from csv.DictReader(lines)


def run(root: Path, out: Path, every: int, width: int | None, scope: Photometry, again: bool = False) -> list[dict]:
    """Evaluates what is not done yet, writes frames.csv and the table to `out`; returns the table's rows."""
    camera, listed = camera_at(root), frames(root, every)
    if not listed:
        raise ValueError(f"{root} has no folder with NNNN_color.png and NNNN_depth.tiff")
    out.mkdir(parents=True, exist_ok=True)
    path = out / "frames.csv"
    settings = " ".join([str(width or "full"), *scope])
    done = {} if again else {(r["video"], r["frame"]): r for r in finished(path) if r["settings"] == settings}
    names = [name for name, _ in RULES.measures] + ["fraction"]
    with path.open("w", encoding="utf-8", newline="") as lines:
        writer = csv.DictWriter(lines, ["video", "frame", *names, "settings"], lineterminator="\n")
        writer.writeheader()
        writer.writerows(done.values())
        for frame in tqdm(listed, file=sys.stderr, disable=None):
            if (frame.video, frame.number) not in done:
                numbers = {name: f"{value:.6g}" for name, value in measured(frame, camera, width, scope).items()}
                row = {"video": frame.video, "frame": frame.number} | numbers | {"settings": settings}
                writer.writerow(row)
                lines.flush()
                done[frame.video, frame.number] = row
    wanted = [done[frame.video, frame.number] for frame in listed]
    rows = [
        _mean(video, [r for r in wanted if r["video"] == video], names) for video in sorted({f.video for f in listed})
    ]
    rows.append(_mean("all frames", wanted, names))
    print(write_tables(out, "c3vd", {"C3VD": rows}))
    return rows


def _mean(video: str, rows: list[dict[str, str]], names: list[str]) -> dict:
    means = {name: f"{np.mean([float(row[name]) for row in rows]):.4g}" for name in names}
    return {"video": video, "frames": len(rows)} | means


def main() -> None:
    parser = argparse.ArgumentParser(description="Evaluates jaxsfs on a downloaded C3VD folder; resumable.")
    parser.add_argument("--root", type=Path, required=True, help="folder with one folder per video, and the camera")
    parser.add_argument("--out", type=Path, default=Path("out/c3vd"), help="folder for frames.csv and the table")
    parser.add_argument("--every", type=int, default=1, help="only every so many-th frame of a video")
    parser.add_argument("--width", type=int, default=675, help="pixels across to shrink the pictures to")
    parser.add_argument("--response", default=Photometry().response)
    parser.add_argument("--falloff", default=Photometry().falloff)
    parser.add_argument("--reflectance", default=Photometry().reflectance)
    parser.add_argument("--again", action="store_true", help="forget earlier results in --out")
    parser.add_argument("--quick", action="store_true", help="every 50th frame, 135 px across")
    options = parser.parse_args()
    if options.quick:
        options.every, options.width = max(options.every, 50), min(options.width, 135)
    scope = Photometry(options.response, options.falloff, options.reflectance)
    run(options.root, options.out, options.every, options.width, scope, options.again)


if __name__ == "__main__":
    main()
