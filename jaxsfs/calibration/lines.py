"""Calibration from straight lines (the paper's second procedure, Section 6): no sizes and no pose needed.

A straight line is seen on a great circle of rays. The residual is its Sampson distance in px of the original
image. The two obvious scores do not work: straightness in the unwarped picture falls to 0 as f → ∞ (the picture shrinks
to its middle), and f times the angle from the great circle falls to 0 as f → 0. The curves of all three are reported.
"""

import dataclasses
from collections.abc import Sequence

import cv2
import numpy as np
from jaxtyping import Float, Int, Shaped

from jaxsfs.calibration._compare import compare, preferred, score_named
from jaxsfs.calibration._field import Photograph, target_photograph
from jaxsfs.calibration._fit import Fit, Setup, fit, lens_rays
from jaxsfs.calibration._guards import check_same_size, warnings_of
from jaxsfs.calibration._lens import ASPECT, LENS_SIZE, SHAPE, lens_named, start_lens
from jaxsfs.calibration._line_points import LinePoints, find_lines
from jaxsfs.calibration._line_search import search_lines
from jaxsfs.calibration._problem import VIEWS_AT, Rows
from jaxsfs.calibration._result import Calibration, ViewResult, total_covariance
from jaxsfs.calibration._ring_setup import CENTRE_SD, SHAPE_SD
from jaxsfs.calibration._uncertainty import used_radius
from jaxsfs.calibration._vectors import line_directions, line_gradients
from jaxsfs.photometry import AbstractResponse

MOST_LINES = 128
UNSURE = 1.0  # of what blur moves a line: its sd, that all lines share
_STARTS = (1.06, 1.3, 1.7, 2.5, 4.0)  # f over the outermost used radius
_SEARCHES = 4
_LEAST_EXTENT = 0.97  # of the picture that the lines cover: what a search may lose
_LEAST_SCATTER = 10  # points from which a scatter is known
_LEAST_SD = 0.02  # px: what neighbours share does not average away
_SHOW = (
    "straight. There is no printed grid in the picture, it was traced wrongly, or the sheet is bent. Photograph a flat "
    "grid of 10 to 20 lines each way (jaxsfs target grid), in focus, with little else in the picture"
)
_CURVES_REACH = 0.8  # of f: points further out are left out of the curves of straightness
WORST_RMS = 0.0015  # of the image width
_LOOSE = 1e6


def calibrate_grid(
    images: Sequence[Shaped[np.ndarray, "..."]],
    model: str = "spherical",
    aspect: bool = False,
    response: AbstractResponse | None = None,
) -> Calibration:
    """The camera that sees the straight lines of a printed line grid, dot grid or checkerboard of any size.

    Raises ValueError that says what to photograph instead.
    """
    if model != "auto":
        lens_named(model)
    photos = [target_photograph(image, response) for image in check_same_size(images)]
    found = [find_lines(photo) for photo in photos]
    kept = [(i, lines) for i, lines in enumerate(found) if lines is not None]
    why = "no grid found: at least two lines of five crossings, dots or corners must show, in focus"
    if not kept:
        raise ValueError(f"{why}. Photograph a printed grid so that it fills the picture")
    centre = photos[0].field_centre()
    setup, owner = _setup([lines for _, lines in kept], photos[0].size, centre, aspect)
    flexible = _flexible(setup, _first_fit(setup, centre))
    for _ in range(_SEARCHES if any(lines.source == "line grid" for _, lines in kept) else 0):
        before = sum(len(lines.axis) for _, lines in kept)
        kept = [(i, _searched(photos[i], flexible, lines)) for i, lines in kept]
        setup, owner = _setup([lines for _, lines in kept], photos[0].size, centre, aspect)
        flexible = _flexible(setup, flexible)
        setup = _with_precision(flexible, owner)
        flexible = _flexible(setup, flexible)
        if sum(len(lines.axis) for _, lines in kept) <= before:
            break
    groups = setup.observations.group
    scores = compare(setup, flexible, groups)
    chosen = preferred(scores) if model == "auto" else score_named(scores, model)
    best = _straight(fit(chosen.name, setup, chosen.fit.parameters, noise=chosen.fit.noise))
    best = _with_shared_error(best, np.concatenate([lines.bend for _, lines in kept]))
    covariance = total_covariance(best, [groups, owner[groups], _bands(best)])
    views = [_view(best, owner, row, index, lines.source) for row, (index, lines) in enumerate(kept)]
    rejected = [(i, why) for i, lines in enumerate(found) if lines is None]
    field = np.any([photo.field for photo in photos], axis=0)
    warnings = warnings_of(best, covariance, views, scores, field=field)
    return Calibration("grid", best, covariance, scores, views, rejected, warnings, {"straightness": curves(best)})


def _flexible(setup: Setup, start: Fit) -> Fit:
    """The fit of r = f (s + k s³) from `start`; of r = f sin α where that fails or k runs away."""
    fits = [fit(name, setup, start.parameters, rounds=4) for name in ("spherical", "spherical-k")]
    fits = [found for found in fits if found.success] or fits[:1]
    return min(fits, key=lambda found: float(np.median(np.abs(found.residual))) - 1e-3 * (found.name == "spherical"))


def _with_precision(found: Fit, owner) -> Setup:
    """The setup with each point's precision from the scatter of those of its photograph that lie as far from the axis,
    on lines that run towards it or across: foreshortened lines at a dark rim scatter ten times more than the best."""
    o = found.setup.observations
    away = o.pixel - found.parameters[1:3]
    radius = np.hypot(*away.T)
    towards = np.abs(np.sum(line_directions(found) * away, axis=1)) > 0.7 * radius
    sd = np.full(len(radius), np.nan)
    for photograph in np.unique(owner):
        mine = owner[o.group] == photograph
        limits = np.quantile(radius[mine], np.linspace(0, 1, 9)[1:-1])
        band = np.where(mine, 2 * np.searchsorted(limits, radius) + towards, -1)
        for key in np.unique(band[mine]):
            rows = (band == key) & (found.weight > 0)
            if rows.sum() >= _LEAST_SCATTER:
                sd[band == key] = max(1.4826 * float(np.median(np.abs(found.residual[rows, 0]))), _LEAST_SD)
    typical = float(np.nanmedian(sd)) if np.isfinite(sd).any() else 1.0
    precision = np.clip(typical / np.where(np.isfinite(sd), sd, 2 * typical), 0.1, 4.0)
    return dataclasses.replace(found.setup, precision=precision)


def _with_shared_error(found: Fit, bend: Float[np.ndarray, "count 2"]) -> Fit:
    """The fit with the error that all points may share: a part of what blur was found to move them across the line."""
    across = line_gradients(found)
    across = across / np.maximum(np.hypot(*across.T), 1e-12)[:, None]
    systematic = UNSURE * np.sum(across * bend, axis=1, keepdims=True)
    return dataclasses.replace(found, setup=dataclasses.replace(found.setup, systematic=systematic))


def _bands(found: Fit) -> Int[np.ndarray, " count"]:
    """Eight bands of the distance from the axis: what all lines suffer at the rim shows when a band is left out."""
    radius = np.hypot(*(found.setup.observations.pixel - found.parameters[1:3]).T)
    return np.searchsorted(np.quantile(radius, np.linspace(0, 1, 9)[1:-1]), radius)


def _searched(photo: Photograph, found: Fit, lines: LinePoints) -> LinePoints:
    """The lines of a line grid all along; other patterns, and what is not found again, as they were."""
    again = search_lines(photo, found, lines) if lines.source == "line grid" else None
    if again is None or len(again.axis) < len(lines.axis) or _extent(again) < _LEAST_EXTENT * _extent(lines):
        return lines
    return again


def _extent(lines: LinePoints) -> float:
    """Area in px² of the convex hull of the points: what of the picture they cover."""
    return float(cv2.contourArea(cv2.convexHull(lines.pixel.astype(np.float32))))


def curves(found: Fit) -> dict[str, list[float]]:
    """Three scores of straightness against f, the centre held (the paper's Figure 3 in numbers): `sampson_px`, and the
    two that collapse, `unwarped` (rms from straight lines in the perspective picture with focal length f, in px, over
    that picture's scale) and `angle_px` (f times the rms angle from the great circle)."""
    o = found.setup.observations
    radius = np.hypot(*(o.pixel - found.parameters[1:3]).T)
    # nearer to f than that there is no room to show what a smaller f does
    kept = (found.weight > 0) & (radius < _CURVES_REACH * found.f)
    pixel, group, outermost = o.pixel[kept], o.group[kept], float(np.max(radius[kept]))
    table: dict[str, list[float]] = {"f": [], "sampson_px": [], "unwarped": [], "angle_px": []}
    for f in outermost * np.geomspace(1.02, 6.0, 25):
        lens = start_lens(f, *found.parameters[1:3])
        lens[ASPECT] = found.parameters[ASPECT]
        rays = lens_rays("spherical", lens, pixel)
        normal = np.stack([np.linalg.svd(rays[group == g])[2][-1] for g in np.unique(group)])
        normal = normal[np.unique(group, return_inverse=True)[1]]
        angle = np.sum(normal * rays, axis=1)
        # ∇(n·d) for the sine: d = (q, √(1 − q²)), so ∂(n·d)/∂q = n_xy − n_z q/√(1 − q²)
        gradient = normal[:, :2] - normal[:, 2:] * rays[:, :2] / rays[:, 2:]
        table["f"].append(float(f))
        table["sampson_px"].append(float(np.sqrt(np.mean((f * angle) ** 2 / np.sum(gradient**2, axis=1)))))
        table["angle_px"].append(float(f * np.sqrt(np.mean(angle**2))))
        table["unwarped"].append(float(f) * _unwarped_rms(rays[:, :2] / rays[:, 2:], group))
    return table


def _unwarped_rms(plane: Float[np.ndarray, "count 2"], group) -> float:
    total = 0.0
    for g in np.unique(group):
        points = plane[group == g] - plane[group == g].mean(axis=0)
        total += float(np.linalg.svd(points, compute_uv=False)[-1] ** 2)
    return float(np.sqrt(total / len(plane)))


def _setup(lines: list[LinePoints], size, centre, aspect: bool):
    """The setup, and the photograph (row of `lines`) of every line."""
    shifts = np.cumsum([0] + [int(found.line.max()) + 1 for found in lines])
    if shifts[-1] > MOST_LINES:
        raise ValueError(
            f"{shifts[-1]} lines were found, more than {MOST_LINES}: give fewer photographs, or a coarser grid"
        )
    pixel = np.concatenate([found.pixel for found in lines])
    count = len(pixel)
    rows = Rows(
        pixel=pixel,
        target=np.zeros((count, 2)),
        polarity=np.zeros(count),
        shift=np.zeros(count),
        group=np.concatenate([found.line + shift for found, shift in zip(lines, shifts[:-1], strict=True)]),
    )
    free, prior, sd = np.zeros(VIEWS_AT, bool), np.zeros(VIEWS_AT), np.full(VIEWS_AT, _LOOSE)
    free[:3] = True
    prior[1:3], sd[1:3] = centre, CENTRE_SD * size[0]
    sd[SHAPE:LENS_SIZE] = SHAPE_SD
    owner = np.repeat(np.arange(len(lines)), np.diff(shifts))
    return Setup("lines", rows, size, 0, MOST_LINES, free, prior, sd, np.zeros((count, 1)), aspect), owner


def _first_fit(setup: Setup, centre) -> Fit:
    outermost = float(np.max(np.hypot(*(setup.observations.pixel - np.array(centre)).T)))
    starts = [np.concatenate([start_lens(factor * outermost, *centre), [0.0, 0.0]]) for factor in _STARTS]
    fits = [fit("spherical", setup, start, rounds=1, noise=1.0) for start in starts]
    # below the outermost radius used, great circles shrink to points and every score goes to 0
    fits = [found for found in fits if found.success and found.f > used_radius(found)]
    if not fits:
        raise ValueError(f"no grid found: no lens makes the {setup.observations.group.max() + 1} rows of marks {_SHOW}")
    best = min(fits, key=lambda found: float(np.median(np.abs(found.residual))))
    again = fit("spherical", setup, best.parameters, rounds=6, noise=best.noise)
    best = again if again.success else best
    return _straight(best)


def _straight(found: Fit) -> Fit:
    """The fit itself. Raises ValueError if its lines are not straight."""
    if found.rms > WORST_RMS * found.setup.size[0]:
        raise ValueError(
            f"no grid found: under the best lens the rows of marks are off by {found.rms:.1f} px rms, so that none "
            f"makes them {_SHOW}"
        )
    return found


def _view(found: Fit, owner, row: int, index: int, source: str) -> ViewResult:
    mine = owner[found.setup.observations.group] == row
    kept = mine & (found.weight > 0)
    rms = float(np.sqrt(np.mean(found.residual[kept] ** 2))) if kept.any() else float("nan")
    lines = int(np.sum(owner == row))
    return ViewResult(index, int(kept.sum()), int(mine.sum()), rms, {"source": source, "lines": lines})
