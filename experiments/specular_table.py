"""Highlight removal compared, on synthetic photographs whose body image is known.

    python experiments/specular_table.py --out out/specular
    python experiments/specular_table.py --quick

Photographs: 8-bit sRGB, noise 0.4 %, highlights that clip; scenes and noise of REPORT_SEEDS, on which nothing was
tuned. A number is a mean over the scenes. Smooth scenes are apart from scenes with occlusions (and tubes), where the
solver's own error, column `true body`, covers what the methods differ in.

Two sets of pixels, the same for all methods of a picture. `common`: known to every method, so without clipped ones,
which several cannot restore. `field`: all that the surface fills; a method that cannot restore a pixel is judged by
the value it leaves there. PSNR and SSIM are of the body image as stored (sRGB), AbsRel and normal error of the surface
reconstructed from the luminance of the body image in the pixels that the method vouches for.

Last column: ours against the best of the others, by the difference's mean and standard error over the scenes; within
two of these they count as equal. Rough plastic: Mitsuba's own pictures (extra crosscheck, left out without it).

`works`: PSNR of the two published rivals on a picture that meets their assumptions: white light, two even colours, no
noise, nothing clipped. Writes table.md, table.csv and a sheet of pictures: stored | body of each method | truth.
"""

import argparse
import csv
import shlex
import sys
from collections.abc import Iterable
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
from mitsuba_scenes import installed
from skimage.metrics import structural_similarity
from specular_methods import METHODS, SRGB, Body, own_ground, psnr, stored
from specular_photographs import KINDS, PLASTIC, chosen, photograph
from tqdm import tqdm

from data_synth import REPORT_SEEDS, TUNING_SEEDS, Ball, Plane, View
from jaxsfs import Irradiance, evaluate, reconstruct
from jaxsfs.files import write_png
from jaxsfs.specular import LUMINANCE, saturated

FIGURES = ("PSNR dB, common", "PSNR dB, field", "SSIM, field", "AbsRel, common", "normals °, common")
HARD_KINDS = ("both", "uneven tissue")
SIZE, QUICK_SIZE = (240, 180), (120, 96)
PLACES = (1, 1, 4, 4, 2)
HIGHER_IS_BETTER = (True, True, True, False, False)
TRUTH, OURS = "true body", "ours"


def figures(bodies: dict[str, Body], truth: np.ndarray, view: View) -> dict[str, tuple[float, ...]]:
    """FIGURES of every method, on pixels that are the same for all."""
    valid = np.asarray(view.surface.valid)
    surfaces = {}
    for name, body in bodies.items():
        light = np.maximum(body.linear, 0) @ LUMINANCE
        known = body.known & (light > 1e-5)
        surfaces[name] = reconstruct(
            Irradiance(jnp.asarray(np.where(known, light, 0)), jnp.asarray(known)), view.camera
        ).surface
    common = valid & np.logical_and.reduce(
        [body.known & np.asarray(surfaces[name].valid) for name, body in bodies.items()]
    )
    wanted = np.where(valid[..., None], stored(truth), 0)
    found = {}
    for name, body in bodies.items():
        picture = np.where(valid[..., None], stored(body.linear), 0)
        similar = structural_similarity(picture, wanted, channel_axis=2, data_range=1, full=True)[1]
        errors = evaluate(
            np.where(common, surfaces[name].range, np.nan),
            np.where(common, view.surface.range, np.nan),
            camera=view.camera,
            truth_normals=np.where(common[..., None], view.normals, np.nan),
        )
        assert errors.normals is not None
        ratios = psnr(picture, wanted, common), psnr(picture, wanted, valid)
        found[name] = (*ratios, float(similar[valid].mean()), errors.abs_rel, errors.normals.mean_deg)
    return found


def compare(seeds: list[int], kinds: tuple[str, ...], size: tuple[int, int]):
    """Figures by kind and method for each seed, and a row of pictures for each kind from the first seed."""
    found: dict[tuple[str, str], list] = {}
    sheet: dict[str, np.ndarray] = {}
    for seed, kind in tqdm([(seed, kind) for seed in seeds for kind in kinds], file=sys.stderr):
        view, values, body = photograph(seed, kind, size)
        valid = np.asarray(view.surface.valid)
        clipped = saturated(values) & valid
        linear = np.asarray(SRGB.decode(jnp.asarray(values)))
        # R−G and the automatic a are blind to grey: they say so
        able = [name for name in METHODS if kind != "grey tissue" or name not in ("R−G", "automatic a")]
        bodies = {name: METHODS[name](linear, valid, clipped) for name in able}
        for name, row in figures(bodies | {TRUTH: Body(body, valid)}, body, view).items():
            found.setdefault((kind, name), []).append(row)
        row = [values, *[stored(one.linear) for one in bodies.values()]]
        sheet.setdefault(kind, np.hstack([*row, *[0 * values] * (len(METHODS) + 1 - len(row)), stored(body)]))
    return {key: np.array(rows) for key, rows in found.items()}, list(sheet.values())


def verdict(found: dict, kind: str, number: int) -> str:
    """Ours against the best mean of the others: by how much it is better, with the standard error over the scenes of
    the difference; `equal` within two of them."""
    others = {name: found[kind, name][:, number] for name in METHODS if name != OURS and (kind, name) in found}
    sign = 1 if HIGHER_IS_BETTER[number] else -1
    rival = max(others, key=lambda name: sign * others[name].mean())
    ahead = sign * (found[kind, OURS][:, number] - others[rival])
    error = ahead.std(ddof=1) / np.sqrt(len(ahead)) if len(ahead) > 1 else np.inf
    least = 0.5 * 10.0 ** -PLACES[number]
    word = "equal" if abs(ahead.mean()) <= max(2 * error, least) else "best" if ahead.mean() > 0 else "WORSE"
    digits = PLACES[number] + 1
    return f"{word}: {ahead.mean():+.{digits}f} ± {error:.{digits}f} to {rival}"


def table(scenes: str, found: dict, kinds: tuple[str, ...]) -> list[dict[str, str]]:
    rows = []
    for kind in kinds:
        for number, figure in enumerate(FIGURES):
            row = {"scenes": scenes, "picture": kind, "figure": figure}
            for name in (*METHODS, TRUTH):
                mean = found[kind, name][:, number].mean() if (kind, name) in found else np.nan
                row[name] = f"{mean:.{PLACES[number]}f}" if np.isfinite(mean) else "–"
            rows.append(row | {"ours against the best other": verdict(found, kind, number)})
    return rows


def groups(seeds: range, quick: bool, count: int) -> Iterable[tuple[str, list[int], tuple[str, ...], tuple[int, int]]]:
    """Name, seeds, kinds of picture and size of each part of the table."""
    if quick:
        yield "smooth", chosen(seeds, True, 1), ("both", "none"), QUICK_SIZE
        return
    yield "smooth", chosen(seeds, True, count), KINDS, SIZE
    yield "occluding", chosen(seeds, False, max(1, count // 2)), HARD_KINDS, SIZE
    if installed():
        yield "plane or ball, Mitsuba", chosen(seeds, True, count, (Plane, Ball)), (PLASTIC,), (SIZE[1], SIZE[1])
    else:
        print("rough plastic is left out: Mitsuba is not installed (the extra crosscheck)", file=sys.stderr)


def run(out: Path, quick: bool, count: int, tuning: bool) -> None:
    """Prints the table and writes it, with the pictures, to `out`."""
    rows, sheets = [], []
    with jax.enable_x64(True), np.errstate(divide="ignore"):  # the true body's PSNR is infinite
        works = own_ground()
        for name, seeds, kinds, size in groups(TUNING_SEEDS if tuning else REPORT_SEEDS, quick, count):
            found, pictures = compare(seeds, kinds, size)
            rows += table(f"{name}, {len(seeds)}", found, kinds)
            sheets += pictures
    head = list(rows[0])
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    lines += ["| " + " | ".join(row.values()) + " |" for row in rows]
    proof = ", ".join(f"{name} {value:.1f} dB" for name, value in works.items())
    text = f"Made by `{shlex.join(['python', *sys.argv])}`.\n\n" + "\n".join(lines) + f"\n\nworks: {proof}\n"
    out.mkdir(parents=True, exist_ok=True)
    (out / "table.md").write_text(text, encoding="utf-8")
    with open(out / "table.csv", "w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, head)
        writer.writeheader()
        writer.writerows(rows)
    width = max(one.shape[1] for one in sheets)
    whole = np.vstack([np.pad(one, ((0, 0), (0, width - one.shape[1]), (0, 0))) for one in sheets])
    write_png(out / "sheet.png", np.rint(255 * whole).astype(np.uint8), force=True)
    print(text)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="Highlight removal compared on photographs with a known body image.")
    parser.add_argument("--out", type=Path, default=Path("out/specular"), help="folder for the table and the pictures")
    parser.add_argument("--quick", action="store_true", help="one small scene, two kinds of picture")
    parser.add_argument("--seeds", type=int, default=6, help="number of smooth scenes; half as many with occlusions")
    parser.add_argument("--tuning", action="store_true", help="the seeds that defaults were chosen on, not for reports")
    arguments = parser.parse_args()
    run(arguments.out, arguments.quick, arguments.seeds, arguments.tuning)
