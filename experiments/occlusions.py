"""What occluding contours cost, and what finding them in the picture saves.

    python experiments/occlusions.py --out out/occlusions
    python experiments/occlusions.py --quick
    python experiments/occlusions.py --rim

Mean relative error of range after median scaling: with the surface taken for continuous (`off`), with contours found
in the picture (`found`), and with those of the renderer (`exact`); from the exact image and from the 8-bit sRGB
photograph with noise of 0.4 % (`photo`). Precision and recall: found pixels within 2 px of a true contour, true ones
within 2 px of a found one. Default scenes and random ones of the report seeds; thresholds were chosen on `--tuning`
seeds. `--rim` instead compares what is assumed at the image's rim, contours cut. Prints a Markdown table and writes
it with the command that made it, and a picture per scene: photograph | found (green), missed (red) | error off |
error found.
"""

import argparse
import shlex
import sys
from pathlib import Path

import cv2
import jax.numpy as jnp
import numpy as np
from scipy import ndimage
from stored import irradiance_of_stored
from tqdm import tqdm

from data_synth import REPORT_SEEDS, TUNING_SEEDS, default_camera, scene_from_text, take_photo
from data_synth.viewing import View, observe
from jaxsfs import Irradiance, Reconstruction, evaluate, reconstruct
from jaxsfs.files import write_png

SMOOTH = ("plane", "tilted-plane", "ball", "hollow-ball", "wavy-wall", "tube")
OCCLUDED = ("ball-in-bowl", "polyps", "colon")
TOLERANCE = 2  # px


def seen(name: str, size: int, half_field_deg: float = 50.0) -> View:
    """The exact view of a scene in a round field."""
    scene = scene_from_text(name)
    return observe(scene, default_camera(scene, size, size, half_field_deg), half_field_deg=half_field_deg)


def photographed(view: View) -> Irradiance:
    """The irradiance of an 8-bit photograph with noise, prepared with the defaults of the command line."""
    valid = np.asarray(view.surface.valid)
    stored = take_photo(view, read_noise=0.004, seed=1).stored / 255.0
    return irradiance_of_stored(stored, view.camera, valid)


def true_contours(view: View) -> np.ndarray:
    """The nearer pixels beside a jump of the renderer's range, with the corners between them."""
    distance, cuts = np.asarray(view.surface.range), np.asarray(view.cuts)
    near = np.zeros(distance.shape, bool)
    for axis, cut in ((1, cuts[:, :-1, 0]), (0, cuts[:-1, :, 1])):
        before, after = (np.take(distance, range(i, distance.shape[axis] - 1 + i), axis) for i in (0, 1))
        here = [slice(None), slice(None)]
        for start, nearer in ((0, before < after), (1, after < before)):
            here[axis] = slice(start, distance.shape[axis] - 1 + start)
            near[tuple(here)] |= cut & nearer
    # diagonal steps closed, as the solver needs
    corners = ndimage.binary_dilation(near) & ndimage.binary_dilation(near, np.ones((3, 3)))
    beside = corners & (distance <= ndimage.maximum_filter(np.where(near, distance, 0), 3) * 1.001)
    return (near | beside) & np.asarray(view.surface.valid)


def abs_rel(view: View, result: Reconstruction) -> float:
    """Mean relative error of range after median scaling."""
    both = np.asarray(result.surface.valid & view.surface.valid)
    masked = [np.where(both, np.asarray(one.range, float), np.nan) for one in (result.surface, view.surface)]
    return float(evaluate(*masked, quantity="range", align="median").abs_rel)


def single(image: Irradiance) -> Irradiance:
    return Irradiance(image.values.astype(jnp.float32), image.valid)


def agreement(found: np.ndarray, true: np.ndarray) -> tuple[float, float]:
    """Precision and recall within TOLERANCE; NaN where there is nothing to be precise about or to recall."""
    near = np.ones((2 * TOLERANCE + 1, 2 * TOLERANCE + 1), bool)
    precise = found & ndimage.binary_dilation(true, near)
    recalled = true & ndimage.binary_dilation(found, near)
    return tuple(float(part.sum() / whole.sum()) if whole.any() else np.nan for part, whole in
                 ((precise, found), (recalled, true)))  # fmt: skip


def contours_table(names: list[str], size: int, out: Path) -> list[tuple[str, ...]]:
    """Rows: scene, kind, clean off/found/exact, photograph off/found, precision and recall of both."""
    rows = []
    for name in tqdm(names, file=sys.stderr, disable=None):
        view = seen(name, size)
        true = true_contours(view)
        cells = [name, type(scene_from_text(name)).__name__]
        scores = []
        for image in (single(view.irradiance), single(photographed(view))):
            off, found = (reconstruct(image, view.camera, occlusions=choice) for choice in ("off", "auto"))
            cells += [f"{abs_rel(view, off):.4f}", f"{abs_rel(view, found):.4f}"]
            if len(scores) == 0:
                exact = reconstruct(image, view.camera, occlusions=jnp.asarray(true))
                cells.append(f"{abs_rel(view, exact):.4f}" if true.any() else "")
            scores.append(agreement(np.asarray(found.surface.contours), true))
        cells += ["" if np.isnan(value) else f"{value:.2f}" for pair in scores for value in pair]
        rows.append(tuple(cells))
        write_png(out / f"{name.replace(':', '_')}.png", picture(view, true, off, found), force=True)
    return rows


def rim_table(names: list[str], size: int) -> list[tuple[str, ...]]:
    """Rows: scene, kind, half field, error with the rim closed and straight, clean and photographed."""
    rows = []
    for name in tqdm(names, file=sys.stderr, disable=None):
        for half_field in (50.0, 60.0):
            view = seen(name, size, half_field)
            cells = [name, type(scene_from_text(name)).__name__, f"{half_field:.0f}°"]
            for image in (single(view.irradiance), single(photographed(view))):
                for rim in ("closed", "straight"):
                    cells.append(f"{abs_rel(view, reconstruct(image, view.camera, rim=rim)):.4f}")
            rows.append(tuple(cells))
    return rows


def picture(view: View, true: np.ndarray, off: Reconstruction, found: Reconstruction) -> np.ndarray:
    """Photograph | contours | error without | error with contours (red: too near by up to 20 %, blue: too far)."""
    photo = take_photo(view, read_noise=0.004, seed=1).stored
    marks = np.zeros_like(photo)
    near = np.ones((2 * TOLERANCE + 1, 2 * TOLERANCE + 1), bool)
    contours = np.asarray(found.surface.contours)
    marks[true & ~ndimage.binary_dilation(contours, near)] = (255, 60, 60)
    marks[contours] = (60, 220, 60)
    return np.hstack([photo, marks, _error(view, off), _error(view, found)])


def _error(view: View, result: Reconstruction) -> np.ndarray:
    both = np.asarray(result.surface.valid & view.surface.valid)
    ratio = np.where(both, np.asarray(result.surface.range) / np.where(both, view.surface.range, 1), 1)
    log = np.clip(np.log(ratio / np.median(ratio[both])) / 0.2, -1, 1)
    white = np.full((*log.shape, 3), 255.0)
    white[..., 1:] *= (1 - np.clip(-log, 0, 1))[..., None]
    white[..., :2] *= (1 - np.clip(log, 0, 1))[..., None]
    return np.where(both[..., None], white, 0).astype(np.uint8)


def markdown(header: tuple[str, ...], rows: list[tuple[str, ...]]) -> str:
    lines = [header, ("---",) * len(header), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines) + "\n"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, default=Path("out/occlusions"))
    parser.add_argument("--quick", action="store_true", help="three scenes, small pictures")
    parser.add_argument("--rim", action="store_true", help="compare rules at the image's rim instead")
    parser.add_argument("--tuning", action="store_true", help="random scenes of the tuning seeds")
    parser.add_argument("--random", type=int, default=20, help="number of random scenes")
    options = parser.parse_args()
    cv2.setNumThreads(1)
    size = 161 if options.quick else 257
    seeds = TUNING_SEEDS if options.tuning else REPORT_SEEDS
    names = [*SMOOTH, *OCCLUDED, *(f"random:{seed}" for seed in seeds[: options.random])]
    names = ["tube", "ball-in-bowl", "polyps"] if options.quick else names
    options.out.mkdir(parents=True, exist_ok=True)
    if options.rim:
        header = ("scene", "kind", "half field", "closed", "straight", "photo closed", "photo straight")
        table, file = markdown(header, rim_table(names, size)), "rim.md"
    else:
        header = ("scene", "kind", "off", "found", "exact", "photo off", "photo found", "P", "R", "photo P", "photo R")
        table, file = markdown(header, contours_table(names, size, options.out)), "occlusions.md"
    command = shlex.join(["python", *sys.argv])
    (options.out / file).write_text(f"`{command}`\n\n{table}", encoding="utf-8")
    print(table, end="")


if __name__ == "__main__":
    main()
