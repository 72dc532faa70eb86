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
import os
import shlex
import sys
import time
from pathlib import Path
from typing import Any

import cv2
import numpy as np
from real_cases import SIMCOL, SINUS, Case, cases
from real_solving import DEFAULT, PRESET, SHOWN, VARIANTS, fit_gamma, score, solve

from jaxsfs import Reconstruction, depth_picture, shaded_picture
from jaxsfs.files import write_png


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
