"""The pictures of a calibration's report."""

from itertools import pairwise

import cv2
import numpy as np
from jaxtyping import Float, UInt8
from matplotlib.figure import Figure

from jaxsfs.calibration import Calibration, Observations
from jaxsfs.calibration._fit import Fit, rays_of

_NEARLY_FLAT = 89.0  # degrees: tan α beyond says nothing
_PREVIEW = 480  # px: width of the rectified preview
_SHOWN = 880  # px: width of the pictures of photographs
_ARROW_PX = 0.04  # of the image width: length of the 95th-percentile residual in the picture


def detections(
    found: Calibration, seen: Observations, photograph: UInt8[np.ndarray, "height width 3"], view: int
) -> Figure:
    """Used and left-out observations over the photograph, with the residuals as magnified arrows."""
    mine = seen.view == view
    used, left = mine & seen.used, mine & ~seen.used
    size = np.hypot(*seen.residual[used].T)
    scale = _ARROW_PX * photograph.shape[1] / max(float(np.percentile(size, 95)) if size.size else 1.0, 1e-9)
    figure = Figure(figsize=(8, 8 * photograph.shape[0] / photograph.shape[1] + 0.4), layout="constrained")
    axes = figure.subplots()
    axes.imshow(_smaller(photograph), extent=(-0.5, photograph.shape[1] - 0.5, photograph.shape[0] - 0.5, -0.5))
    axes.plot(*seen.pixel[left].T, "x", color="#ff5a4f", ms=3, label=f"left out ({left.sum()})")
    axes.plot(*seen.pixel[used].T, ".", color="#29d3ff", ms=2, label=f"used ({used.sum()})")
    every = max(1, int(used.sum()) // 400)
    at, arrow = seen.pixel[used][::every], seen.residual[used][::every] * scale
    axes.quiver(*at.T, *arrow.T, angles="xy", scale_units="xy", scale=1, color="#ffd21f", width=0.002)
    axes.plot(found.fit.parameters[1], found.fit.parameters[2], "+", color="#ff3df0", ms=14, mew=1.5)
    axes.set(xlim=(-0.5, photograph.shape[1] - 0.5), ylim=(photograph.shape[0] - 0.5, -0.5))
    axes.set_title(f"photograph {found.views[view].photograph + 1}: residuals ×{scale:.0f}, + principal point")
    axes.legend(loc="lower right", fontsize="small")
    return figure


def _smaller(photograph: UInt8[np.ndarray, "height width 3"]) -> UInt8[np.ndarray, "_ _ 3"]:
    """No larger than what the page shows."""
    scale = min(1.0, _SHOWN / photograph.shape[1])
    return cv2.resize(photograph, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA)


def residual_against_angle(found: Calibration, seen: Observations) -> Figure:
    """Signed residual, outward from the principal point, against the angle from the axis. A wrong lens model shows as
    a pattern of signs."""
    away = seen.pixel - found.fit.parameters[1:3]
    outward = away / np.maximum(np.hypot(*away.T), 1e-9)[:, None]
    signed = np.sum(seen.residual * outward, axis=1)[seen.used]
    angle = seen.alpha_deg[seen.used]
    figure = Figure(figsize=(8, 3.2), layout="constrained")
    axes = figure.subplots()
    axes.plot(angle, signed, ".", ms=2, alpha=0.4, color="#2b6cb0")
    middles, medians = _binned(angle, signed)
    axes.plot(middles, medians, "-o", color="#c05621", ms=4, label="median")
    limit = 1.3 * max(float(np.percentile(np.abs(signed), 99)), 1e-6)
    axes.axhline(0, color="0.5", lw=0.8)
    axes.set(xlabel="angle from the axis / degrees", ylabel="outward residual / px", ylim=(-limit, limit))
    axes.legend()
    return figure


def _binned(angle: Float[np.ndarray, " n"], value: Float[np.ndarray, " n"]) -> tuple[list[float], list[float]]:
    bins = list(pairwise(np.linspace(0, max(float(angle.max()), 1.0), 15)))
    rows = [(angle >= low) & (angle < high) for low, high in bins]
    middles = [0.5 * float(low + high) for low, high in bins]
    filled = [(m, float(np.median(value[r]))) for m, r in zip(middles, rows, strict=True) if r.sum() >= 5]
    return [m for m, _ in filled], [v for _, v in filled]


def coverage_and_uncertainty(found: Calibration, seen: Observations) -> Figure:
    """Where in the image there are observations, and the sd in px of where a direction is seen."""
    width, height = found.fit.setup.size
    figure = Figure(figsize=(9, 3.6), layout="constrained")
    left, right = figure.subplots(1, 2)
    counts, _, _ = np.histogram2d(
        *seen.pixel[seen.used].T, bins=(24, max(2, round(24 * height / width))), range=((0, width), (0, height))
    )
    shown = left.imshow(counts.T, extent=(0, width, height, 0), cmap="Blues")
    figure.colorbar(shown, ax=left, shrink=0.8, label="observations")
    left.set_title("coverage")
    spread = found.uncertainty_map()
    inside = np.isfinite(spread)
    top = float(np.percentile(spread[inside], 98)) if inside.any() else 1.0
    shown = right.imshow(spread, extent=(0, width, height, 0), cmap="magma", vmin=0, vmax=max(top, 1e-6))
    figure.colorbar(shown, ax=right, shrink=0.8, label="1σ / px")
    right.set_title("uncertainty of where a direction is seen")
    return figure


def models(found: Calibration, seen: Observations) -> Figure:
    """Image radius against angle of the lens models that fit at all, as a difference from the chosen one.

    Lines stay straight whatever factor tan α has, and models that fit them alike may differ by one: there each
    model's factor is the one that brings its curve nearest.
    """
    by_lines = "straightness" in found.extras
    reach = float(np.percentile(seen.alpha_deg[seen.used], 99.5))
    angle = np.linspace(0, reach, 60)
    figure = Figure(figsize=(8, 3.4), layout="constrained")
    axes = figure.subplots()
    own = _radii(found.fit, angle)
    for score in (score for score in found.comparison if score.rms < 5 * found.fit.rms + 0.5):
        radii = _radii_by_lines(score.fit, angle, own) if by_lines else _radii(score.fit, angle)
        axes.plot(angle, radii - own, label=f"{score.name} ({score.rms:.3f} px)")
    axes.set(xlabel="angle from the axis / degrees", ylabel=f"r − r of {found.fit.name} / px")
    if by_lines:
        axes.set_title("but for a factor on tan α, which lines leave free", fontsize="medium")
    spread = 4 * found.fit.rms + 1.0
    axes.set_ylim(-spread, spread)
    axes.legend(fontsize="x-small", ncols=3)
    return figure


def _radii_by_lines(
    fitted: Fit, angle_deg: Float[np.ndarray, " n"], nearest_to: Float[np.ndarray, " n"]
) -> Float[np.ndarray, " n"]:
    """Image radius in px at the angles, tan α times the factor that brings the radii nearest to the given ones."""
    tangent = np.tan(np.radians(np.minimum(angle_deg, _NEARLY_FLAT)))

    def radii(log_factor: float) -> Float[np.ndarray, " n"]:
        return _radii(fitted, np.degrees(np.arctan(np.exp(log_factor) * tangent)))

    def distance(log_factor: float) -> float:
        return float(np.sum((radii(log_factor) - nearest_to) ** 2))

    best, reach = 0.0, 1.5
    for _ in range(4):
        best = min(np.linspace(best - reach, best + reach, 31).tolist(), key=distance)
        reach /= 15
    return radii(best)


def _radii(fitted: Fit, angle_deg: Float[np.ndarray, "*shape"]) -> Float[np.ndarray, "*shape"]:
    """Image radius in px at the angles: the profile's inverse, by interpolation of the rays along one image row."""
    radius = np.linspace(0, 1.1 * np.hypot(*fitted.setup.size), 1000)
    pixel = fitted.parameters[1:3] + np.stack([radius, np.zeros_like(radius)], axis=1)
    alpha = np.degrees(np.arccos(np.clip(rays_of(fitted, pixel)[:, 2], -1, 1)))
    rising = np.concatenate([[True], np.diff(np.maximum.accumulate(alpha)) > 0])
    return np.interp(angle_deg, alpha[rising], radius[rising], right=1e6)


def straightness(found: Calibration) -> Figure:
    """Three scores of straightness against f (the paper's Figure 3 in numbers)."""
    curve = {name: np.array(values) for name, values in found.extras["straightness"].items()}
    figure = Figure(figsize=(8, 3.4), layout="constrained")
    axes = figure.subplots()
    for name, label in (
        ("sampson_px", "Sampson distance, px of the photograph"),
        ("unwarped", "straightness in the unwarped picture (→ 0 as f → ∞)"),
        ("angle_px", "f × angle from the great circle (→ 0 as f → 0)"),
    ):
        values = curve[name] / curve["f"] if name == "unwarped" else curve[name]
        axes.semilogy(curve["f"], values / values.max(), label=label)
    axes.axvline(found.fit.f, color="0.5", lw=0.8)
    axes.set(xlabel="f / px", ylabel="score / its maximum")
    axes.legend(fontsize="small")
    return figure


def rectified(fitted: Fit, photograph: UInt8[np.ndarray, "height width 3"]) -> Figure:
    """The photograph before and after rectification at the fitted camera: straight lines become straight."""
    height, width = photograph.shape[:2]
    scale = min(1.0, _PREVIEW / width)
    columns, rows = round(width * scale), round(height * scale)
    shown = cv2.resize(photograph, (columns, rows), interpolation=cv2.INTER_AREA)
    centre, aspect = fitted.parameters[1:3], float(np.exp(fitted.parameters[3]))
    # the perspective picture has the same scale at the principal point, and square pixels
    x, y = np.meshgrid((np.arange(columns) + 0.5) / scale - 0.5, (np.arange(rows) + 0.5) / scale - 0.5)
    x, y = x - centre[0], y - centre[1]
    distance = np.hypot(x, y)
    stretch = _radii(fitted, np.degrees(np.arctan(distance / fitted.f))) / np.maximum(distance, 1e-9)
    u, v = ((c + a * s * stretch + 0.5) * scale - 0.5 for c, a, s in zip(centre, (1.0, aspect), (x, y), strict=True))
    flat = cv2.remap(shown, u.astype(np.float32), v.astype(np.float32), cv2.INTER_LINEAR, borderValue=(0, 0, 0))
    figure = Figure(figsize=(9, 4.5 * shown.shape[0] / shown.shape[1] + 0.5), layout="constrained")
    for axes, image, title in zip(figure.subplots(1, 2), (shown, flat), ("stored", "rectified"), strict=True):
        axes.imshow(image)
        axes.set_title(title)
        axes.set_axis_off()
    return figure
