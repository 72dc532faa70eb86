"""Highlights of real endoscope pictures: is the body as bright inside as around, and is its texture still there?

    python experiments/specular_real.py --out out/specular_real

Highlight pixels are found by a rule of its own, not by the method: the least channel as stored is 0.12 above its
median over a neighbourhood, and no channel is saturated (nor beside such a pixel). Colours are estimated on one half of
the picture (alternate blocks of 4 × 4 px) and everything is measured on the other half.

removed: share of these pixels that the method takes for highlights; the rule also takes pale organs (the tube and the
cyst of fig1_a), whose own light is no error. ratio: body luminance over that of the ring round the highlight (3 to 8 px
away), the median over the pixels; 1 is right; `ratio removed`: over the removed ones; `ratio flanks`: over those within
4 px of a saturated pixel, as far as optics and compression blur a highlight, which pale organs are not (`flanks`: their
number). texture: what is kept of a known texture. The picture is taken a second time with its linear light darkened by
vessel-like lines of up to 20 %, and stored as 8 bit again; the slope of the change of ln body over what was painted,
both without their blur (σ 3 px), over the highlight pixels: 1 keeps all, a fill alone nothing (column `filled`). The
data lie beside the project, see `--data`.
"""

import argparse
import os
from pathlib import Path

import cv2
import jax.numpy as jnp
import numpy as np

from jaxsfs import SRGBResponse, find_field, read_image
from jaxsfs.files import write_png
from jaxsfs.specular import LUMINANCE, RED_MINUS_GREEN, remove_highlights, saturated

SRGB = SRGBResponse()
FEWEST = 240
FLANK = 4  # px


def grown(mask: np.ndarray, radius: int) -> np.ndarray:
    disc = cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * radius + 1, 2 * radius + 1))
    return cv2.dilate(mask.astype(np.uint8), disc).astype(bool)


def highlight_pixels(stored: np.ndarray, field: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Unsaturated highlight pixels, and the ring of 3 to 8 px round highlights and saturated pixels."""
    least = np.rint(255 * stored.min(axis=-1)).astype(np.uint8)
    size = 2 * int(0.06 * min(least.shape)) + 1
    rises = (least.astype(float) - cv2.medianBlur(least, size) > 0.12 * 255) & field
    clipped = saturated(stored, 250 / 255)
    return rises & ~grown(clipped, 1), grown(rises | clipped, 8) & ~grown(rises | clipped, 3) & field


def level_around(light: np.ndarray, ring: np.ndarray) -> np.ndarray:
    share = cv2.GaussianBlur(ring.astype(float), (0, 0), 5)
    return cv2.GaussianBlur(np.where(ring, light, 0), (0, 0), 5) / np.maximum(share, 1e-6)


def vessels(shape: tuple[int, int], depth: float = 0.2) -> np.ndarray:
    """ln of the share of light that is left, 0 to ln(1 − depth): dark lines some 3 px wide, always the same."""
    noise = np.random.default_rng(1).standard_normal(shape)
    smooth = cv2.GaussianBlur(noise, (0, 0), 3)
    return np.log(1 - depth * np.exp(-((smooth / (0.4 * smooth.std())) ** 2)))


def detail(log: np.ndarray) -> np.ndarray:
    return log - cv2.GaussianBlur(log, (0, 0), 3)


def texture_kept(plain: np.ndarray, painted: np.ndarray, texture: np.ndarray, where: np.ndarray) -> float:
    """Slope of the change of ln luminance over the painted one, details only; clipped to the changes paint can make."""
    change = np.log(np.maximum(painted, 1e-4)) - np.log(np.maximum(plain, 1e-4))
    wanted = detail(texture)[where]
    return float(wanted @ detail(np.clip(change, -0.5, 0.5))[where] / (wanted @ wanted))


def stored_again(linear: np.ndarray) -> np.ndarray:
    return np.rint(255 * np.asarray(SRGB.encode(jnp.asarray(np.clip(linear, 0, 1))))) / 255


def measure(path: Path, out: Path | None = None) -> dict[str, float | str]:
    """The figures of one picture; with `out` also a picture: stored | changed outlined | body."""
    photo = read_image(path)
    stored = photo.values.astype(np.float64)
    field = find_field(photo.values).mask
    linear = np.asarray(SRGB.decode(jnp.asarray(stored)))
    v, u = np.indices(field.shape) // 4
    seen = (u + v) % 2 == 0
    clipped = saturated(stored) & field
    texture = np.where(clipped, 0.0, vessels(field.shape))
    painted = np.asarray(SRGB.decode(jnp.asarray(stored_again(linear * np.exp(texture)[..., None]))))
    options = {"saturated": clipped, "sample": seen}
    auto, filled = (remove_highlights(linear, field, method=method, **options) for method in ("auto", "mask"))
    inside, ring = highlight_pixels(stored, field)
    inside &= ~seen & (level_around(ring.astype(float), field) > 0.02)
    figures: dict[str, float | str] = {"picture": path.name, "pixels": int(inside.sum())}
    versions = {"stored": linear @ LUMINANCE, "R−G": linear @ RED_MINUS_GREEN}
    versions |= {"filled": filled.values @ LUMINANCE, "ours": auto.values @ LUMINANCE}
    for name, light in versions.items():
        figures[f"ratio {name}"] = float(np.median(light[inside] / level_around(light, ring)[inside]))
    removed = inside & auto.highlights
    figures["removed"] = float(removed.sum() / max(1, inside.sum()))
    figures["ratio removed"] = float(
        np.median(versions["ours"][removed] / level_around(versions["ours"], ring)[removed])
    )
    flanks = inside & grown(saturated(stored, 250 / 255), FLANK)
    figures["flanks"] = int(flanks.sum())
    for name in ("filled", "ours"):
        light = versions[name]
        figures[f"ratio flanks {name}"] = float(np.median(light[flanks] / level_around(light, ring)[flanks]))
    for name, method in (("filled", "mask"), ("ours", "auto")):
        again = remove_highlights(painted, field, method=method, **options).values @ LUMINANCE
        figures[f"texture {name}"] = texture_kept(versions[name], again, texture, inside & auto.highlights)
    if out is not None:
        out.mkdir(parents=True, exist_ok=True)
        shown = stored.copy()
        shown[auto.highlights & ~cv2.erode(auto.highlights.astype(np.uint8), np.ones((3, 3))).astype(bool)] = (0, 1, 0)
        body = np.asarray(SRGB.encode(jnp.asarray(np.clip(auto.values, 0, 1))))
        write_png(
            out / f"{path.stem}.png", np.rint(255 * np.hstack([stored, shown, body])).astype(np.uint8), force=True
        )
    return figures


def pictures(data: Path) -> list[Path]:
    return sorted((data / "specular_endoscope").glob("*.bmp"))


if __name__ == "__main__":
    default = Path(os.environ.get("JAXSFS_DATA", Path(__file__).parents[1] / "../shared/data"))
    parser = argparse.ArgumentParser(description="Highlights of real endoscope pictures, inside against around.")
    parser.add_argument("--out", type=Path, default=Path("out/specular_real"), help="folder for the pictures")
    parser.add_argument("--data", type=Path, default=default, help="folder of the real images")
    parser.add_argument("--quick", action="store_true", help="the first picture only")
    arguments = parser.parse_args()
    paths = pictures(arguments.data)
    rows = [measure(path, arguments.out) for path in (paths[:1] if arguments.quick else paths)]
    print("| " + " | ".join(rows[0]) + " |\n|" + "---|" * len(rows[0]))
    for row in rows:
        print("| " + " | ".join(f"{x:.2f}" if isinstance(x, float) else str(x) for x in row.values()) + " |")
