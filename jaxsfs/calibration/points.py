"""Calibration from points of known place on a flat target: checkerboards and dot grids."""

import dataclasses
from collections.abc import Sequence

import numpy as np
from jaxtyping import Float, Shaped

from jaxsfs.calibration._blobs import blobs_and_areas
from jaxsfs.calibration._board import Board, find_checkerboard, find_dots
from jaxsfs.calibration._compare import compare, preferred, score_named
from jaxsfs.calibration._dot_bias import dot_bias, dot_radius
from jaxsfs.calibration._field import Photograph, target_photograph
from jaxsfs.calibration._fit import Fit, Setup, fit, lens_rays
from jaxsfs.calibration._guards import check_count, check_same_size, warnings_of
from jaxsfs.calibration._lens import LENS_SIZE, SHAPE, lens_named, start_lens
from jaxsfs.calibration._pose_start import start_pose
from jaxsfs.calibration._problem import VIEW_SIZE, VIEWS_AT, Rows
from jaxsfs.calibration._result import Calibration, ViewResult, pose_figures, total_covariance
from jaxsfs.calibration._ring_setup import CENTRE_SD, SHAPE_SD
from jaxsfs.photometry import AbstractResponse

RATIO_SD = 0.02  # of the printer's two scales
WORST_RMS = 0.005  # of the image width
_LOOSE = 1e6
_LEAST_SHARE = 0.5  # of a photograph's points that must fit
_MISCOUNTED = (
    "most of its points do not fit the lens that the other photographs show: they were miscounted, or the sheet is "
    "bent or blurred"
)
_STARTS = (1.08, 1.35, 1.8, 2.6, 4.0)  # f over the outermost used radius


def calibrate_checkerboard(
    images: Sequence[Shaped[np.ndarray, "..."]],
    columns: int,
    rows: int,
    pitch: float,
    model: str = "spherical",
    aspect: bool = False,
    two_scales: bool = False,
    response: AbstractResponse | None = None,
) -> Calibration:
    """The camera that photographed a checkerboard with `columns` × `rows` inner corners `pitch` mm apart.

    Raises ValueError that says what to photograph instead.
    """
    check_count("columns", columns)
    check_count("rows", rows)
    photos = [target_photograph(image, response) for image in check_same_size(images)]
    found = [find_checkerboard(photo, columns, rows) for photo in photos]
    why = f"no checkerboard of {columns} x {rows} inner corners found (count corners between squares, not squares)"
    centre = photos[0].field_centre()
    return _from_boards(
        "checkerboard", found, why, columns * rows, pitch, photos[0].size, centre, model, aspect, two_scales
    )


def calibrate_dots(
    images: Sequence[Shaped[np.ndarray, "..."]],
    columns: int,
    rows: int,
    pitch: float,
    asymmetric: bool = False,
    model: str = "spherical",
    aspect: bool = False,
    two_scales: bool = False,
    response: AbstractResponse | None = None,
    stretch: float = 1.0,
) -> Calibration:
    """The camera that photographed `columns` × `rows` dots. `pitch` in mm is the distance of neighbours; with
    `asymmetric` (every second row shifted by half, as OpenCV has it) the distance of rows, half of that of dots in
    a row. `stretch`: spacing of columns over what `pitch` says, for grids whose spacings differ.

    Raises ValueError that says what to photograph instead.
    """
    if not (np.isfinite(stretch) and stretch > 0):
        raise ValueError(f"stretch must be a positive ratio of the columns' spacing to the rows', got {stretch:g}")
    check_count("columns", columns)
    check_count("rows", rows)
    photos = [target_photograph(image, response) for image in check_same_size(images)]
    found = [find_dots(photo, columns, rows, asymmetric) for photo in photos]
    why = f"no grid of {columns} x {rows} dots found (70 % of them must show, off the picture's border)"
    centre = photos[0].field_centre()
    wide = [board and Board(board.pixel, board.place * np.array([stretch, 1.0])) for board in found]
    more = (why, columns * rows, pitch, photos[0].size, centre, model, aspect, two_scales)
    first = _from_boards("dots", wide, *more)
    radius = _radius(first, photos)
    if not radius > 0:
        return first
    # the middles of the dots' images are moved to the images of their middles, once
    bias = {view.photograph: row for row, view in enumerate(first.views)}
    moved = [
        Board(board.pixel - dot_bias(first.fit, bias[i], board.pixel, radius), board.place)
        if board is not None and i in bias
        else board
        for i, board in enumerate(wide)
    ]
    found = _from_boards("dots", moved, *more)
    return dataclasses.replace(found, extras=found.extras | {"dot_radius_mm": radius})


def _radius(found: Calibration, photos: Sequence[Photograph]) -> float:
    """Radius of the printed dots in mm by the areas of those that the fit uses; 0 where none were measured."""
    radii = []
    for row, view in enumerate(found.views):
        centres, area = blobs_and_areas(photos[view.photograph])
        used = found.fit.setup.observations.pixel[(found.fit.setup.observations.group == row) & (found.fit.weight > 0)]
        if not len(centres):
            continue
        gap = np.hypot(*(used[:, None] - centres[None]).transpose(2, 0, 1))
        near = gap.min(axis=1) < 1.0
        if near.any():
            radii.append(dot_radius(found.fit, row, used[near], area[gap.argmin(axis=1)[near]]))
    return float(np.median(radii)) if radii else 0.0


def calibrate_points(
    pixels: Sequence[Float[np.ndarray, "_ 2"]],
    targets: Sequence[Float[np.ndarray, "_ 2"]],
    size: tuple[int, int],
    centre: tuple[float, float] | None = None,
    model: str = "spherical",
    aspect: bool = False,
    two_scales: bool = False,
    expected: int = 0,
    target: str = "points",
) -> Calibration:
    """The camera that sees target points (mm, Y down) at pixels, one array of each per photograph.

    `centre`: prior mean of the principal point, by default the middle of the image; `expected`: points on the target.
    A photograph most of whose points fit no pose is left out.
    """
    if model != "auto":
        lens_named(model)
    middle = centre or ((size[0] - 1) / 2, (size[1] - 1) / 2)
    used, setup, flexible = _supported(pixels, targets, size, middle, aspect, two_scales)
    rejected = [(i, _MISCOUNTED) for i in range(len(pixels)) if i not in used]
    groups = _row_groups(setup)
    scores = compare(setup, flexible, groups)
    chosen = preferred(scores) if model == "auto" else score_named(scores, model)
    found = fit(chosen.name, setup, chosen.fit.parameters, noise=chosen.fit.noise)
    covariance = total_covariance(found, [groups, setup.observations.group])
    views = [
        _view_result(found, covariance, row, photograph, expected or len(pixels[photograph]))
        for row, photograph in enumerate(used)
    ]
    extras = {"scale_ratio": float(np.exp(found.parameters[LENS_SIZE + 1]))} if two_scales else {}
    return Calibration(
        target, found, covariance, scores, views, rejected, warnings_of(found, covariance, views, scores), extras
    )


def _supported(pixels, targets, size, centre, aspect, two_scales) -> tuple[list[int], Setup, Fit]:
    """The photographs that a common lens explains, with their setup and fit: those of which less than half of the
    points fit are taken out and the rest is fitted again."""
    used = list(range(len(pixels)))
    while True:
        mine = [pixels[i] for i in used], [targets[i] for i in used]
        setup = _setup(*mine, size, centre, aspect, two_scales)
        try:
            first = _first_fit(setup, *mine, centre)
        except ValueError:
            good = _alone(used, pixels, targets, size, centre)
            if len(good) in (0, len(used)):
                raise
            used = good
            continue
        flexible = fit("spherical-k", setup, first.parameters)
        flexible = flexible if flexible.success else first
        shares = [float(flexible.weight[setup.observations.group == row].mean()) for row in range(len(used))]
        good = [i for i, share in zip(used, shares, strict=True) if share >= _LEAST_SHARE]
        if len(good) in (0, len(used)):
            return used, setup, flexible
        used = good


def _alone(used: list[int], pixels, targets, size, centre) -> list[int]:
    """The photographs that some lens explains by themselves."""
    good = []
    for i in used:
        one = [pixels[i]], [targets[i]]
        try:
            _first_fit(_setup(*one, size, centre, False, False), *one, centre)
        except ValueError:
            continue
        good.append(i)
    return good


def _from_boards(target, boards: list[Board | None], why: str, expected: int, pitch, size, centre, model, aspect, two):
    if not (np.isfinite(pitch) and pitch > 0):
        raise ValueError(f"pitch must be a positive distance in mm, got {pitch:g}")
    rejected = [(i, why) for i, board in enumerate(boards) if board is None]
    kept = [(i, board) for i, board in enumerate(boards) if board is not None]
    if not kept:
        raise ValueError(
            f"{why}, in none of {len(boards)} photograph(s). Keep the whole sheet in view, lit and in focus"
        )
    pixels = [board.pixel for _, board in kept]
    targets = [pitch * board.place for _, board in kept]
    found = calibrate_points(pixels, targets, size, centre, model, aspect, two, expected, target)
    names = [index for index, _ in kept]
    views = [dataclasses.replace(view, photograph=names[view.photograph]) for view in found.views]
    rejected += [(names[index], reason) for index, reason in found.rejected]
    return dataclasses.replace(found, views=views, rejected=sorted(rejected))


def _setup(pixels, targets, size, centre, aspect: bool, two_scales: bool) -> Setup:
    count, views = sum(map(len, pixels)), len(pixels)
    rows = Rows(
        pixel=np.concatenate(pixels).astype(float),
        target=np.concatenate(targets).astype(float),
        polarity=np.zeros(count),
        shift=np.zeros(count),
        group=np.repeat(np.arange(views), [len(p) for p in pixels]),
    )
    total = VIEWS_AT + VIEW_SIZE * views
    free, prior, sd = np.zeros(total, bool), np.zeros(total), np.full(total, _LOOSE)
    free[:3] = True
    prior[1:3], sd[1:3] = centre, CENTRE_SD * size[0]
    sd[SHAPE:LENS_SIZE] = SHAPE_SD
    free[LENS_SIZE + 1], sd[LENS_SIZE + 1] = two_scales, RATIO_SD
    free[VIEWS_AT:] = True
    return Setup("points", rows, size, views, 1, free, prior, sd, np.zeros((count, 2)), aspect)


def _first_fit(setup: Setup, pixels, targets, centre) -> Fit:
    """The best of several starts of f, each with poses from homographies of its rays."""
    outermost = max(float(np.max(np.hypot(*(p - np.array(centre)).T))) for p in pixels)
    fits = []
    for factor in _STARTS:
        lens = start_lens(factor * outermost, *centre)
        poses = [start_pose(lens_rays("spherical", lens, p), t) for p, t in zip(pixels, targets, strict=True)]
        start = np.concatenate([lens, [0.0, 0.0], *poses])
        found = fit("spherical", setup, start, rounds=2, noise=1.0)
        if found.success:
            fits.append(found)
    if not fits:
        raise ValueError(
            "no fit of lens and poses to the points converged: are the columns, rows and the grid's kind right, and is "
            "the sheet flat?"
        )
    best = min(fits, key=lambda found: float(np.median(np.abs(found.residual))))
    if best.rms > WORST_RMS * setup.size[0]:
        raise ValueError(
            f"no lens and flat sheet fit the points (rms {best.rms:.1f} px): they were miscounted, or the sheet is "
            "bent. Check columns, rows and the kind of grid; leave out photographs one by one to find the bad one"
        )
    return best


def _row_groups(setup: Setup) -> np.ndarray:
    """One group per photograph and row of the target."""
    o = setup.observations
    return np.unique(np.stack([o.group, np.round(o.target[:, 1], 6)]), axis=1, return_inverse=True)[1].ravel()


def _view_result(found: Fit, covariance, view: int, photograph: int, expected: int) -> ViewResult:
    rows = (found.setup.observations.group == view) & (found.weight > 0)
    rms = float(np.sqrt(np.mean(np.sum(found.residual[rows] ** 2, axis=1)))) if rows.any() else float("nan")
    return ViewResult(photograph, int(rows.sum()), expected, rms, pose_figures(found, covariance, view))
