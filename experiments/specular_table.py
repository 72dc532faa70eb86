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

`works`: PSNR of the two published rivals on a picture that meets their assumptions: white light, two even colours, no
noise, nothing clipped. Writes table.md, table.csv and a sheet of pictures: stored | body of each method | truth.
"""

import argparse
import csv
import shlex
import sys
from collections.abc import Callable
from itertools import islice
from pathlib import Path
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from baselines_specular import shen_zheng, yang
from skimage.metrics import structural_similarity
from tqdm import tqdm

from data_synth import (
    REPORT_SEEDS,
    TUNING_SEEDS,
    Ball,
    HollowBall,
    Plane,
    View,
    WavyWall,
    default_camera,
    observe,
    random_scene,
    take_photo,
    tissue_colours,
    wet_glints,
)
from jaxsfs import Irradiance, SRGBResponse, evaluate, reconstruct
from jaxsfs.files import write_png
from jaxsfs.specular import (
    LUMINANCE,
    RED_MINUS_GREEN,
    body_colour,
    remove_highlights,
    saturated,
    separate,
)

SRGB = SRGBResponse()
KINDS = ("broad", "glints", "both", "uneven tissue", "tinted light", "grey tissue", "none")
FIGURES = ("PSNR dB, common", "PSNR dB, field", "SSIM, field", "AbsRel, common", "normals °, common")
SMOOTH = (Plane, Ball, HollowBall, WavyWall)
HARD_KINDS = ("both", "uneven tissue")
SIZE, QUICK_SIZE = (240, 180), (120, 96)
TRUTH = "true body"


class Body(NamedTuple):
    """Body image in linear light, and the pixels whose value a method vouches for."""

    linear: np.ndarray
    known: np.ndarray


def off(linear, valid, clipped) -> Body:
    return Body(linear, valid & ~clipped)


def mask_and_fill(linear, valid, clipped) -> Body:
    found = remove_highlights(linear, valid, saturated=clipped, method="mask")
    return Body(found.values, valid & ~found.unknown)


def red_minus_green(linear, valid, clipped) -> Body:
    """The paper's a = (1, −1, 0), brought to the body's scale with its colour."""
    colour = body_colour(linear, valid & ~clipped)
    return Body(np.maximum(separate(linear, colour, vector=RED_MINUS_GREEN)[0], 0), valid & ~clipped)


def automatic(linear, valid, clipped) -> Body:
    return Body(remove_highlights(linear, valid, saturated=clipped, method="dichromatic").values, valid & ~clipped)


def yang_2010(linear, valid, clipped) -> Body:
    return Body(yang.body_image(linear, valid), valid & ~clipped)


def shen_zheng_2013(linear, valid, clipped) -> Body:
    return Body(shen_zheng.body_image(linear, valid), valid & ~clipped)


def ours(linear, valid, clipped) -> Body:
    found = remove_highlights(linear, valid, saturated=clipped)
    return Body(found.values, valid & ~found.unknown)


METHODS: dict[str, Callable[..., Body]] = {
    "off": off,
    "mask + fill": mask_and_fill,
    "R−G": red_minus_green,
    "automatic a": automatic,
    "Yang 2010": yang_2010,
    "Shen–Zheng 2013": shen_zheng_2013,
    "ours": ours,
}


def photograph(view: View, kind: str, seed: int):
    """A photograph of the kind; highlights are drawn from the seed."""
    rng = np.random.default_rng(seed)
    options: dict = {"shine": rng.uniform(0.15, 0.5), "lobe": rng.uniform(20, 120)}
    if kind in ("glints", "none"):
        options = {}
    if kind not in ("broad", "none"):
        options["glints"] = wet_glints(view, seed=seed)
    if kind in ("uneven tissue", "none"):
        options["body_colour"] = tissue_colours(view, seed=seed)
    if kind == "tinted light":
        options["interface_colour"] = (0.85, 1.0, 0.8)
    if kind == "grey tissue":
        options["body_colour"] = (0.45, 0.45, 0.45)
    return take_photo(view, read_noise=0.004, seed=seed, **options)


def stored(linear: np.ndarray) -> np.ndarray:
    return np.asarray(SRGB.encode(jnp.asarray(np.clip(linear, 0, 1))))


def psnr(picture: np.ndarray, truth: np.ndarray, valid: np.ndarray) -> float:
    return float(-10 * np.log10(((picture - truth)[valid] ** 2).mean()))


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


def own_ground() -> dict[str, float]:
    """PSNR of the rivals on a picture that meets their assumptions, over nothing done at all."""
    v, u = np.indices((128, 160)) / 160
    shading = 0.3 + 0.3 * np.exp(-((u - 0.5) ** 2 + (v - 0.4) ** 2) / 0.1)
    body = np.where((u > 0.5)[..., None], [0.75, 0.35, 0.28], [0.7, 0.5, 0.2]) * shading[..., None]
    spots = ((0.3, 0.3, 0.03), (0.7, 0.5, 0.04), (0.52, 0.6, 0.03))
    light = sum(0.4 * np.exp(-((u - x) ** 2 + (v - y) ** 2) / (2 * s * s)) for x, y, s in spots)
    linear, valid = body + np.asarray(light)[..., None], np.ones(u.shape, bool)
    rivals = {"Yang 2010": yang.body_image, "Shen–Zheng 2013": shen_zheng.body_image}
    found = {name: psnr(stored(rival(linear, valid)), stored(body), valid) for name, rival in rivals.items()}
    return {"off": psnr(stored(linear), stored(body), valid)} | found


def chosen(seeds: range, smooth: bool, count: int) -> list[int]:
    """The first `count` seeds of the kind of scene."""
    return list(islice((seed for seed in seeds if isinstance(random_scene(seed), SMOOTH) == smooth), count))


def compare(seeds: list[int], kinds: tuple[str, ...], size: tuple[int, int]):
    """Mean figures by kind and method, and a row of pictures for each kind from the first seed."""
    sums: dict[tuple[str, str], list] = {}
    sheet: dict[str, np.ndarray] = {}
    for seed, kind in tqdm([(seed, kind) for seed in seeds for kind in kinds], file=sys.stderr):
        scene = random_scene(seed)
        view = observe(scene, default_camera(scene, *size), half_field_deg=50)
        valid = np.asarray(view.surface.valid)
        photo = photograph(view, kind, seed)
        values = photo.stored / 255
        clipped = saturated(values) & valid
        linear = np.asarray(SRGB.decode(jnp.asarray(values)))
        # R−G and the automatic a are blind to grey: they say so
        able = [name for name in METHODS if kind != "grey tissue" or name not in ("R−G", "automatic a")]
        bodies = {name: METHODS[name](linear, valid, clipped) for name in able}
        for name, found in figures(bodies | {TRUTH: Body(photo.body, valid)}, photo.body, view).items():
            sums.setdefault((kind, name), []).append(found)
        row = [values, *[stored(body.linear) for body in bodies.values()]]
        sheet.setdefault(kind, np.hstack([*row, *[0 * values] * (len(METHODS) + 1 - len(row)), stored(photo.body)]))
    return {key: np.mean(rows, axis=0) for key, rows in sums.items()}, np.vstack(list(sheet.values()))


def table(scenes: str, means: dict, kinds: tuple[str, ...]) -> list[dict[str, str]]:
    places = (1, 1, 4, 4, 2)
    rows = []
    for kind in kinds:
        for number, figure in enumerate(FIGURES):
            row = {"scenes": scenes, "picture": kind, "figure": figure}
            for name in (*METHODS, TRUTH):
                found = means.get((kind, name))
                there = found is not None and np.isfinite(found[number])
                row[name] = f"{found[number]:.{places[number]}f}" if there else "–"
            rows.append(row)
    return rows


def run(out: Path, quick: bool, count: int, tuning: bool) -> None:
    """Prints the table and writes it, with the pictures, to `out`."""
    kinds = ("both", "none") if quick else KINDS
    seeds = TUNING_SEEDS if tuning else REPORT_SEEDS
    rows, sheets = [], []
    with jax.enable_x64(True), np.errstate(divide="ignore"):  # the true body's PSNR is infinite
        works = own_ground()
        groups = [("smooth", True, 1 if quick else count, kinds)]
        groups += [] if quick else [("occluding", False, max(1, count // 2), HARD_KINDS)]
        for name, smooth, number, those in groups:
            means, sheet = compare(chosen(seeds, smooth, number), those, QUICK_SIZE if quick else SIZE)
            rows += table(f"{name}, {number}", means, those)
            sheets.append(sheet)
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
    write_png(out / "sheet.png", np.rint(255 * np.vstack(sheets)).astype(np.uint8), force=True)
    print(text)


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description="Highlight removal compared on photographs with a known body image.")
    parser.add_argument("--out", type=Path, default=Path("out/specular"), help="folder for the table and the pictures")
    parser.add_argument("--quick", action="store_true", help="one small scene, two kinds of picture")
    parser.add_argument("--seeds", type=int, default=6, help="number of smooth scenes; half as many with occlusions")
    parser.add_argument("--tuning", action="store_true", help="the seeds that defaults were chosen on, not for reports")
    arguments = parser.parse_args()
    run(arguments.out, arguments.quick, arguments.seeds, arguments.tuning)
