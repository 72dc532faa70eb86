"""Figure 2 of the paper: f from a photographed sheet of concentric circles, by eqs. (19)–(20) and by our fit.

    python experiments/figure2.py --out out/figure2
    python experiments/figure2.py --quick

Synthetic photographs of rings of 5 mm steps from a known height (blur 1 px, noise 1 %, 8-bit sRGB, known lens).
Square-on, as the paper wants it, and tilted by 5° and 15°, as it happens. The figure: the photograph, image radius
against α = atan(R/h) of each ring with eq. (19) for the fitted f, and what is left of it. The table: errors of f by
eq. (20) for the height as measured, and for one measured 5 % wrong (from the glass instead of from the entrance
pupil), and by `calibrate_circles`, which knows the measured height to 2 %.
"""

import sys
from pathlib import Path

import jax
import numpy as np
from tables import main, pyplot, save, write_tables
from tqdm import tqdm

from data_synth.target_patterns import Rings
from data_synth.targets import Studio, photograph
from jaxsfs import Spherical
from jaxsfs.calibration import calibrate_circles, tilted

F, HEIGHT, RINGS = 320.0, 20.0, tuple(5.0 * (i + 1) for i in range(6))


def shot(tilt: float, size: tuple[int, int]):
    """(camera, photograph) of the sheet from HEIGHT mm."""
    width, height = size
    camera = Spherical(f=F * width / 640, cx=(width - 1) / 2 + 4, cy=(height - 1) / 2 - 3, width=width, height=height)
    picture = photograph(camera, Rings(RINGS, 0.8, 1.0), tilted(tilt, 30.0, HEIGHT), Studio(), seed=2)
    return camera, picture


def radii_of(result) -> tuple[np.ndarray, np.ndarray]:
    """Printed radius in mm and mean image radius in px about the fitted centre, of the rings that were found."""
    found = result.fit
    seen = found.setup.observations
    kept = found.weight > 0
    away = np.hypot(*(seen.pixel[kept] - found.parameters[1:3]).T)
    rings = seen.target[kept, 0]
    names = np.unique(rings)
    return names, np.array([away[rings == ring].mean() for ring in names])


def eq20(rings: np.ndarray, radii: np.ndarray, height: float) -> float:
    """f̄ = mean of √(u² + v²)/sin α, α = atan(R/h)."""
    return float(np.mean(radii / (rings / np.hypot(rings, height))))


def measure(tilt: float, size: tuple[int, int]) -> tuple[dict, tuple]:
    """A row of the table and what the figure draws."""
    camera, picture = shot(tilt, size)
    result = calibrate_circles([picture], RINGS, HEIGHT)
    rings, radii = radii_of(result)
    truth = float(camera.f)
    row = {"tilt °": tilt, "true f": f"{truth:.2f}"}
    for name, height in (("eq. 20", HEIGHT), ("eq. 20, height 5 % wrong", 1.05 * HEIGHT)):
        row[f"{name}, error %"] = f"{100 * (eq20(rings, radii, height) / truth - 1):+.2f}"
    row["fit, error %"] = f"{100 * (result.fit.f / truth - 1):+.3f}"
    row["fit, 1σ %"] = f"{100 * result.f_sd / truth:.3f}"
    view = result.views[0]
    row["rings' edges matched"] = f"{view.matched}/{view.expected}"
    return row, (picture, rings, radii, eq20(rings, radii, HEIGHT), result.fit.f)


def sheet(parts: tuple, path: Path) -> None:
    picture, rings, radii, f20, fitted = parts
    plt = pyplot()
    figure, (photo, curve, rest) = plt.subplots(1, 3, figsize=(14, 4), layout="constrained")
    photo.imshow(picture, cmap="gray", vmin=0, vmax=255)
    photo.set(xticks=[], yticks=[], title=f"circles of {RINGS[0]:g}–{RINGS[-1]:g} mm from {HEIGHT:g} mm")
    alpha = np.arctan(rings / HEIGHT)
    fine = np.linspace(0, alpha.max() * 1.05, 100)
    curve.plot(np.rad2deg(fine), f20 * np.sin(fine), label=f"f sin α, eq. (20): f = {f20:.1f} px")
    curve.plot(np.rad2deg(alpha), radii, "o", label="rings")
    curve.set(xlabel="α = atan(R/h) in °", ylabel="√(u² + v²) in px", title="eq. (19)")
    curve.legend()
    for f, name in ((f20, "eq. (20)"), (fitted, "fit")):
        rest.plot(np.rad2deg(alpha), radii - f * np.sin(alpha), "o-", label=name)
    rest.axhline(0, color="k", lw=0.5)
    rest.set(xlabel="α in °", ylabel="radius − f sin α in px", title="what is left")
    rest.legend()
    save(figure, path)


def run(out: Path, quick: bool) -> list[dict]:
    """Writes figure2.png and the table to `out`; returns the rows."""
    size, tilts = ((320, 240), (0.0,)) if quick else ((640, 480), (0.0, 5.0, 15.0))
    rows = []
    with jax.enable_x64(True):
        for tilt in tqdm(tilts, file=sys.stderr, disable=None):
            row, parts = measure(tilt, size)
            rows.append(row)
            if tilt == 0:
                sheet(parts, out / "figure2.png")
    print(write_tables(out, "figure2", {"figure 2": rows}))
    return rows


if __name__ == "__main__":
    main("Figure 2 of the paper: f from concentric circles.", run, "figure2")
