"""Figure 3 of the paper: a photographed square grid before and after warping with the fitted f, and how straight it is.

    python experiments/figure3.py --out out/figure3
    python experiments/figure3.py --quick

The paper warps with several f (eq. 15) and takes the one that looks straightest. Here `calibrate_grid` finds it, and
the figure shows the picture, its warp with f 20 % too small, fitted and 25 % too large, and three scores against f:
the distance from great circles in px of the picture (Sampson), whose least value is the fit, and two simpler ones,
lines in the warped picture over its scale, and angles from the great circle times f. Synthetic 8-bit photograph with
blur and noise, tilted by 10°; no size, height or pose is given. The table has the error of f.
"""

from pathlib import Path

import cv2
import jax
import numpy as np
from tables import main, pyplot, save, write_tables

from data_synth.target_patterns import LineGrid
from data_synth.targets import Studio, photograph
from jaxsfs import Spherical, perspective_like, rectification_map
from jaxsfs.calibration import calibrate_grid, tilted

F = 320.0
SHARES = (0.8, 1.0, 1.25)


def warped(picture: np.ndarray, camera: Spherical, f: float) -> np.ndarray:
    """The picture as a pinhole would have taken it if the lens had the distortion f."""
    lens = Spherical(f=f, cx=camera.cx, cy=camera.cy, width=camera.width, height=camera.height)
    table = np.asarray(rectification_map(lens, perspective_like(lens, 55)), np.float32)
    return cv2.remap(picture, np.nan_to_num(table[..., 0], nan=-1), np.nan_to_num(table[..., 1], nan=-1),
                     cv2.INTER_LINEAR)  # fmt: skip


def sheet(picture: np.ndarray, result, path: Path) -> None:
    plt = pyplot()
    figure, axes = plt.subplots(1, 5, figsize=(19, 4), layout="constrained")
    camera, f = result.camera, result.fit.f
    pictures = [("photograph", picture)] + [(f"warped, f = {k * f:.0f} px", warped(picture, camera, k * f))
                                            for k in SHARES]  # fmt: skip
    for axis, (title, one) in zip(axes, pictures, strict=False):
        axis.imshow(one, cmap="gray", vmin=0, vmax=255)
        axis.set(xticks=[], yticks=[], title=title)
    curves = result.extras["straightness"]
    for key, words in (("sampson_px", "great circles, px (ours)"), ("unwarped", "lines in the warped picture"),
                       ("angle_px", "f × angle from the great circle")):  # fmt: skip
        values = np.asarray(curves[key])
        axes[4].plot(curves["f"], values / values.max(), label=words)
    axes[4].axvline(f, color="k", lw=0.8, ls="--", label="fitted f")
    axes[4].set(xscale="log", yscale="log", xlabel="f in px", ylabel="score / its largest value", title="straightness")
    axes[4].legend(fontsize=7)
    save(figure, path)


def run(out: Path, quick: bool) -> list[dict]:
    """Writes figure3.png and the table to `out`; returns the row."""
    width, height = (400, 300) if quick else (640, 480)
    with jax.enable_x64(True):
        truth = Spherical(f=F * width / 640, cx=width / 2 + 3, cy=height / 2 - 5, width=width, height=height)
        pose = tilted(10.0, 20.0, 20.0, (1.0, -1.5))
        picture = photograph(truth, LineGrid(4.0, 0.6), pose, Studio(noise=0.005), seed=3)
        result = calibrate_grid([picture])
    curves = result.extras["straightness"]
    best = curves["f"][int(np.argmin(curves["sampson_px"]))]
    straightest = curves["f"][int(np.argmin(curves["unwarped"]))]
    rows = [
        {
            "true f": f"{float(truth.f):.2f}",
            "fitted f": f"{result.fit.f:.2f}",
            "error %": f"{100 * (result.fit.f / float(truth.f) - 1):+.3f}",
            "1σ %": f"{100 * result.f_sd / float(truth.f):.3f}",
            "least Sampson distance of the scan at": f"{best:.0f}",
            "straightest warped lines of the scan at": f"{straightest:.0f}",
            "scan": f"{curves['f'][0]:.0f}–{curves['f'][-1]:.0f}",
        }
    ]
    sheet(picture, result, out / "figure3.png")
    print(write_tables(out, "figure3", {"figure 3": rows}))
    return rows


if __name__ == "__main__":
    main("Figure 3 of the paper: grid before and after warping with the fitted f.", run, "figure3")
