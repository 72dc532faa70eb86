"""The pictures of a calibration's report."""

from itertools import pairwise

import cv2
import numpy as np
from jaxtyping import Float, UInt8

from jaxsfs.calibration import Calibration, Observations
from jaxsfs.calibration._fit import Fit, rays_of
from jaxsfs.report._chart import COLOURS, Curve, chart, dots
from jaxsfs.report._panels import grid, jpeg, legend, map_panel, photograph_panel, shrunk
from jaxsfs.report._scale import Scale

_NEARLY_FLAT = 89.0  # degrees: tan α beyond says nothing
_PREVIEW = 480  # px: width of the rectified preview
_ARROW = 0.04  # of the image width: length of the 95th-percentile residual in the picture
_ARROWS = 400  # at most
_CROSS = 0.004  # of the image width: half the size of the mark of an observation left out
_ENLARGED = 12  # px of a map's cell
_USED, _LEFT, _RESIDUAL, _MIDDLE = "#29d3ff", "#ff5a4f", "#ffd21f", "#ff3df0"


def detections(
    found: Calibration, seen: Observations, photograph: UInt8[np.ndarray, "height width 3"], view: int
) -> str:
    """Used and left-out observations over the photograph, with the residuals as magnified wedges."""
    height, width = photograph.shape[:2]
    mine = seen.view == view
    used, left = mine & seen.used, mine & ~seen.used
    size = np.hypot(*seen.residual[used].T)
    factor = _ARROW * width / max(float(np.percentile(size, 95)) if size.size else 1.0, 1e-9)
    every = -(-int(used.sum()) // _ARROWS) or 1
    drawn = [
        ("crosses", _LEFT, _crosses(seen.pixel[left], _CROSS * width)),
        ("dots", _USED, dots(seen.pixel[used])),
        ("arrows", _RESIDUAL, _wedges(seen.pixel[used][::every], factor * seen.residual[used][::every])),
        ("middle", _MIDDLE, _plus(found.fit.parameters[1:3], 4 * _CROSS * width)),
    ]
    paths = "".join(f'<path class="{kind}" stroke="{colour}" d="{path}"/>' for kind, colour, path in drawn)
    names = (f"used ({used.sum()})", f"left out ({left.sum()})", f"residuals ×{factor:.0f}", "principal point")
    # a pixel's middle is an integer, the picture's corner half a pixel away
    return (
        f'<svg class="over" viewBox="-0.5 -0.5 {width} {height}" role="img" aria-label="observations and residuals">'
        f'<image href="{jpeg(shrunk(photograph))}" x="-0.5" y="-0.5" width="{width}" height="{height}"/>{paths}</svg>'
        + legend(list(zip((_USED, _LEFT, _RESIDUAL, _MIDDLE), names, strict=True)))
    )


def _crosses(points: Float[np.ndarray, "count 2"], reach: float) -> str:
    d = f"{2 * reach:.1f}"
    return "".join(f"M{x - reach:.1f} {y - reach:.1f}l{d} {d}m0 -{d}l-{d} {d}" for x, y in points)


def _plus(point: Float[np.ndarray, "2"], reach: float) -> str:
    x, y = point
    return f"M{x - reach:.1f} {y:.1f}h{2 * reach:.1f}M{x:.1f} {y - reach:.1f}v{2 * reach:.1f}"


def _wedges(points: Float[np.ndarray, "count 2"], arrows: Float[np.ndarray, "count 2"]) -> str:
    """From a broad foot at each point to the arrow's tip."""
    foot = 0.06 * np.stack([-arrows[:, 1], arrows[:, 0]], axis=1)
    corners = np.concatenate([points + foot, arrows - foot, -arrows - foot], axis=1)
    return "".join(f"M{x:.1f} {y:.1f}l{a:.1f} {b:.1f}l{c:.1f} {d:.1f}z" for x, y, a, b, c, d in corners)


def residual_against_angle(found: Calibration, seen: Observations) -> str:
    """Signed residual, outward from the principal point, against the angle from the axis. A wrong lens model shows as
    a pattern of signs."""
    away = seen.pixel - found.fit.parameters[1:3]
    outward = away / np.maximum(np.hypot(*away.T), 1e-9)[:, None]
    signed = np.sum(seen.residual * outward, axis=1)[seen.used]
    angle = seen.alpha_deg[seen.used]
    limit = 1.3 * max(float(np.percentile(np.abs(signed), 99)), 1e-6)
    middles, medians = _binned(angle, signed)
    return chart(
        "outward residual against the angle from the axis",
        [
            Curve(angle, signed, "every observation", COLOURS[0], "cloud"),
            Curve(middles, medians, "median", COLOURS[1], "both"),
        ],
        _from_axis(float(angle.max())),
        Scale(-limit, limit, "outward residual / px"),
        level=0.0,
    )


def _from_axis(reach: float) -> Scale:
    return Scale(0.0, 1.02 * reach, "angle from the axis / degrees")


def _binned(
    angle: Float[np.ndarray, " n"], value: Float[np.ndarray, " n"]
) -> tuple[Float[np.ndarray, " bins"], Float[np.ndarray, " bins"]]:
    """Middles of bins of the angle and the value's median there, of bins with five values or more."""
    bins = list(pairwise(np.linspace(0, max(float(angle.max()), 1.0), 15)))
    rows = [(angle >= low) & (angle < high) for low, high in bins]
    filled = [(0.5 * (a + b), np.median(value[r])) for (a, b), r in zip(bins, rows, strict=True) if r.sum() >= 5]
    middles, medians = np.array(filled).reshape(-1, 2).T
    return middles, medians


def coverage_and_uncertainty(found: Calibration, seen: Observations) -> str:
    """Where in the image there are observations, and the sd in px of where a direction is seen."""
    width, height = found.fit.setup.size
    counts, _, _ = np.histogram2d(
        *seen.pixel[seen.used].T, bins=(24, max(2, round(24 * height / width))), range=((0, width), (0, height))
    )
    spread = found.uncertainty_map()
    inside = np.isfinite(spread)
    top = max(float(np.percentile(spread[inside], 98)) if inside.any() else 1.0, 1e-6)
    return grid(
        [
            map_panel("Coverage", _enlarged(counts.T), Scale(0.0, max(float(counts.max()), 1.0), "observations")),
            map_panel("Where a direction is seen: 1σ", _enlarged(spread), Scale(0.0, top, "1σ / px", "magma")),
        ]
    )


def _enlarged(coarse: Float[np.ndarray, "rows columns"]) -> Float[np.ndarray, "height width"]:
    return np.repeat(np.repeat(coarse, _ENLARGED, axis=0), _ENLARGED, axis=1)


def models(found: Calibration, seen: Observations) -> str:
    """Image radius against angle of the lens models that fit at all, as a difference from the chosen one.

    Lines stay straight whatever factor tan α has, and models that fit them alike may differ by one: there each
    model's factor is the one that brings its curve nearest.
    """
    by_lines = "straightness" in found.extras
    reach = float(np.percentile(seen.alpha_deg[seen.used], 99.5))
    angle = np.linspace(0, reach, 60)
    own, curves = _radii(found.fit, angle), []
    near = [score for score in found.comparison if score.rms < 5 * found.fit.rms + 0.5]
    for score, colour in zip(near, COLOURS, strict=False):
        radii = _radii_by_lines(score.fit, angle, own) if by_lines else _radii(score.fit, angle)
        curves.append(Curve(angle, radii - own, f"{score.name} ({score.rms:.3f} px)", colour))
    spread = 4 * found.fit.rms + 1.0
    but = ", but for a factor on tan α, which lines leave free" if by_lines else ""
    up = Scale(-spread, spread, f"r − r of {found.fit.name} / px")
    return chart(f"image radius of the lens models{but}", curves, _from_axis(reach), up)


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


def straightness(found: Calibration) -> str:
    """Three scores of straightness against f (the paper's Figure 3 in numbers)."""
    curve = {name: np.array(values) for name, values in found.extras["straightness"].items()}
    scores = {
        "Sampson distance, px of the photograph": curve["sampson_px"],
        "straightness in the unwarped picture (→ 0 as f → ∞)": curve["unwarped"] / curve["f"],
        "f × angle from the great circle (→ 0 as f → 0)": curve["angle_px"],
    }
    curves = [
        Curve(curve["f"], score / score.max(), name, colour)
        for (name, score), colour in zip(scores.items(), COLOURS, strict=False)
    ]
    across = Scale(float(curve["f"].min()), float(curve["f"].max()), "f / px")
    lowest = min(float(one.y.min()) for one in curves)
    up = Scale(max(lowest, 1e-6), 1.0, "score / its maximum", even="logarithm")
    return chart("scores of straightness against f", curves, across, up, upright=found.fit.f)


def rectified(fitted: Fit, photograph: UInt8[np.ndarray, "height width 3"]) -> str:
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
    return grid([photograph_panel("Stored", shown), photograph_panel("Rectified", flat)])
