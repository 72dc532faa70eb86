"""Figure 4 of the paper: photographs with highlights, their R−G image, and body and interface as separated here.

    python experiments/figure4.py --out out/figure4
    python experiments/figure4.py --quick

Three objects. `synthetic`: a tissue-coloured wall with broad highlights and glints, 8-bit sRGB with noise.
`resin-like`: a ball of one even, strongly coloured body with a strong narrow interface, as the paper's resin object.
`endoscope`: a real picture from `--data` (specular_endoscope), left out where the folder is not there.

R−G: the paper's a = (1, −1, 0), scaled by one body colour for the whole picture. A number: PSNR of the luminance of
the stored body image where the truth is known, over pixels that are not clipped; for the real picture the luminance
inside the highlights over that of the ring round about (1 is right). Writes figure4.png and table.md.
"""

import argparse
import os
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import cv2
import jax.numpy as jnp
import matplotlib
import numpy as np

from data_synth import Ball, WavyWall, default_camera, observe, take_photo, wet_glints
from jaxsfs import SRGBResponse, find_field, read_image
from jaxsfs.specular import LUMINANCE, RED_MINUS_GREEN, body_colour, body_strength, remove_highlights, saturated

SRGB = SRGBResponse()
RESIN = (0.80, 0.22, 0.10)
COLUMNS = ("photograph", "R − G", "body", "interface", "changed")
REAL = "fig5_a.bmp"


class Example(NamedTuple):
    """Stored picture, pixels to look at, and the true body in linear light if known."""

    stored: np.ndarray
    field: np.ndarray
    body: np.ndarray | None


class Separated(NamedTuple):
    """Luminance of the picture, of c_B by R−G and of our body; our body in colour; the changed pixels; report."""

    luminance: np.ndarray
    red_minus_green: np.ndarray
    body: np.ndarray
    colours: np.ndarray
    changed: np.ndarray
    words: str


def synthetic(size: tuple[int, int]) -> Example:
    view = observe(scene := WavyWall(), default_camera(scene, *size), half_field_deg=50)
    glints = wet_glints(view, seed=4, count=20)
    photo = take_photo(view, shine=0.25, lobe=60, glints=glints, read_noise=0.004, seed=4)
    return Example(photo.stored / 255, np.asarray(view.surface.valid), photo.body)


def resin_like(size: tuple[int, int]) -> Example:
    view = observe(scene := Ball(), default_camera(scene, *size), half_field_deg=50)
    glints = wet_glints(view, seed=8, count=5, strength=1.5, size=0.02)
    photo = take_photo(view, body_colour=RESIN, shine=0.8, lobe=150, glints=glints, read_noise=0.004, seed=8)
    return Example(photo.stored / 255, np.asarray(view.surface.valid), photo.body)


def endoscope(data: Path) -> Example | None:
    path = data / "specular_endoscope" / REAL
    if not path.exists():
        return None
    photo = read_image(path)
    return Example(photo.values.astype(np.float64), find_field(photo.values).mask, None)


def separated(example: Example) -> Separated:
    linear = np.asarray(SRGB.decode(jnp.asarray(example.stored)))
    clipped = saturated(example.stored) & example.field
    found = remove_highlights(linear, example.field, saturated=clipped)
    strength = body_strength(linear, RED_MINUS_GREEN, body_colour(linear, example.field & ~clipped))
    luminance, body = (np.where(example.field, image @ LUMINANCE, 0) for image in (linear, found.values))
    paper = np.where(example.field, np.maximum(strength, 0), 0)
    colours = np.where(example.field[..., None], found.values, 0)
    words = f"{found.report.method}, k_s {found.report.interface_origin}"
    return Separated(luminance, paper, body, colours, found.highlights, words)


def encoded(linear: np.ndarray) -> np.ndarray:
    return np.asarray(SRGB.encode(jnp.asarray(np.clip(linear, 0, 1))))


def quality(example: Example, parts: Separated) -> Callable[[np.ndarray], float]:
    """Of a luminance image: PSNR in dB against the truth, or inside over round about."""
    if example.body is not None:
        truth = encoded(example.body @ LUMINANCE)
        counted = example.field & ~saturated(example.stored)
        return lambda light: float(-10 * np.log10(((encoded(light) - truth)[counted] ** 2).mean()))
    inside = parts.changed & ~cv2.dilate(saturated(example.stored).astype(np.uint8), np.ones((3, 3))).astype(bool)
    inside &= parts.luminance > 1.2 * parts.body
    near, far = (cv2.dilate(parts.changed.astype(np.uint8), np.ones((k, k))).astype(bool) for k in (7, 17))
    ring = (far & ~near & example.field).astype(float)

    def ratio(light: np.ndarray) -> float:
        around = cv2.GaussianBlur(light * ring, (0, 0), 5) / np.maximum(cv2.GaussianBlur(ring, (0, 0), 5), 1e-6)
        counted = inside & (cv2.GaussianBlur(ring, (0, 0), 5) > 0.02)
        return float(np.median(light[counted] / np.maximum(around[counted], 1e-6)))

    return ratio


def sheet(rows: dict[str, tuple[Example, Separated]], path: Path) -> None:
    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    figure, axes = plt.subplots(len(rows), len(COLUMNS), figsize=(15, 3.1 * len(rows)), squeeze=False)
    for line, (name, (example, parts)) in zip(axes, rows.items(), strict=True):
        interface = np.maximum(parts.luminance - parts.body, 0)
        pictures = (example.stored, encoded(parts.red_minus_green), encoded(parts.colours), encoded(interface))
        for axis, title, picture in zip(line, COLUMNS, (*pictures, parts.changed), strict=True):
            axis.imshow(picture, cmap="gray", vmin=0, vmax=1)
            axis.set(xticks=[], yticks=[], title=title)
        line[0].set_ylabel(name)
    figure.tight_layout()
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=80)
    plt.close(figure)


def run(out: Path, data: Path, quick: bool) -> list[dict[str, str]]:
    """Writes the sheet and the table to `out`, prints the table, and returns its rows."""
    size = (160, 120) if quick else (480, 360)
    examples = {"synthetic": synthetic(size), "endoscope": endoscope(data), "resin-like": resin_like(size)}
    rows, table = {}, []
    for name, example in examples.items():
        if example is None:
            print(f"{name}: left out, {data / 'specular_endoscope' / REAL} is not there")
            continue
        parts = separated(example)
        rows[name] = (example, parts)
        figure = quality(example, parts)
        values = {"as stored": parts.luminance, "R−G": parts.red_minus_green, "ours": parts.body}
        unit = "PSNR dB" if example.body is not None else "inside/ring"
        row = {"object": name, "figure": unit} | {key: f"{figure(light):.2f}" for key, light in values.items()}
        table.append(row | {"changed px": str(int(parts.changed.sum())), "method": parts.words})
    head = list(table[0])
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    lines += ["| " + " | ".join(row.values()) + " |" for row in table]
    sheet(rows, out / "figure4.png")
    (out / "table.md").write_text("\n".join(lines) + "\n", encoding="utf-8")
    print("\n".join(lines))
    return table


if __name__ == "__main__":
    default = Path(os.environ.get("JAXSFS_DATA", Path(__file__).parents[1] / "../shared/data"))
    parser = argparse.ArgumentParser(
        description="Figure 4 of the paper: R−G image, body and interface of three objects."
    )
    parser.add_argument("--out", type=Path, default=Path("out/figure4"), help="folder for figure4.png and table.md")
    parser.add_argument("--data", type=Path, default=default, help="folder of the real images")
    parser.add_argument("--quick", action="store_true", help="small pictures")
    arguments = parser.parse_args()
    run(arguments.out, arguments.data, arguments.quick)
