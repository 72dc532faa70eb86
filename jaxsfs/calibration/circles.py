"""Calibration from photographs of concentric circles (the paper's first procedure, Section 6)."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float, Int, Shaped

from jaxsfs.calibration._compare import compare, preferred, score_named
from jaxsfs.calibration._eq20 import estimators
from jaxsfs.calibration._field import Photograph, target_photograph
from jaxsfs.calibration._fit import Fit, fit
from jaxsfs.calibration._guards import check_height, check_radii, check_same_size, warnings_of
from jaxsfs.calibration._lens import LENS_SIZE, lens_named
from jaxsfs.calibration._problem import VIEWS_AT
from jaxsfs.calibration._result import Calibration, ViewResult, pose_figures, total_covariance
from jaxsfs.calibration._ring_images import outermost_seen, target_centre
from jaxsfs.calibration._ring_setup import RingPriors, ring_setup, with_precision, with_shifts
from jaxsfs.calibration._ring_view import RingView, view_rings
from jaxsfs.photometry import AbstractResponse

LEAST_MATCHED = 0.5
LEAST_EXPLAINED = 0.65  # of the rings seen: two rings and a centre dot make 0.67
WORST_RMS = 0.0015  # of the image width
_INDEPENDENT = 0.25  # share of a ring's edges that count as independent


def calibrate_circles(
    images: Sequence[Shaped[np.ndarray, "..."]],
    radii: Sequence[float],
    height: float | None = None,
    height_tolerance: float = 0.02,
    model: str = "spherical",
    aspect: bool = False,
    response: AbstractResponse | None = None,
) -> Calibration:
    """The camera that photographed printed circles of `radii` (mm, increasing, from the centre).

    Rings may be dark or bright lines (radii of the lines' middles) or filled bands (radii of their edges). `height`:
    distance in mm of the projection centre from the paper with its relative tolerance, a prior; needed only where
    one ring pair or a narrow field leaves f and the height together. `model`: a name of `LENSES` or "auto". `aspect`
    frees the pixel aspect. Raises ValueError that says what to photograph instead.
    """
    printed = check_radii(radii)
    check_height(height, printed, height_tolerance)
    check_same_size(images)
    if model != "auto":
        lens_named(model)
    photos = [target_photograph(image, response) for image in images]
    centre = tuple(np.mean([photo.field_centre() for photo in photos], axis=0).tolist())
    priors = RingPriors(printed, centre, height, height_tolerance, aspect)
    views, rejected = _all_views(photos, priors)
    kept = [index for index in range(len(photos)) if index in views]
    edges = [views[index].edges for index in kept]
    setup = ring_setup(edges, priors, photos[0].size)
    setup, flexible = _joint_fit("spherical-k", setup, _joint_start([views[index] for index in kept]))
    rings = np.unique(np.round(setup.observations.target[:, 0], 9), return_inverse=True)[1]
    scores = compare(setup, flexible, rings, _INDEPENDENT)
    chosen = preferred(scores) if model == "auto" else score_named(scores, model)
    setup, found = _joint_fit(chosen.name, setup, chosen.fit.parameters)
    _check_rms(found, printed)
    covariance = total_covariance(found, _groupings(found, rings))
    results = [_view_result(found, covariance, views[index], i, index, printed) for i, index in enumerate(kept)]
    field = np.any([photo.field for photo in photos], axis=0)
    warnings = warnings_of(found, covariance, results, scores, height, height_tolerance, field)
    style = views[kept[0]].style
    extras = {"style": style, "line_width_mm": float(found.parameters[LENS_SIZE]), "radii_mm": printed.tolist()}
    notes = _not_found(found, setup.observations.target[:, 0], printed, [photos[index].field for index in kept])
    return Calibration("circles", found, covariance, scores, results, rejected, warnings, extras, notes)


def _not_found(found: Fit, seen: Float[np.ndarray, " count"], printed, fields) -> tuple[str, ...]:
    """Which of the rings given are in no photograph, and whether they could be."""
    used = np.unique(seen[found.weight > 0])
    missing = [radius for radius in printed if np.min(np.abs(used - radius)) > 1e-6 * radius]
    if not missing:
        return ()
    reach = max(outermost_seen(found.name, found.parameters, found.view(i), field) for i, field in enumerate(fields))
    beyond = [f"{radius:g}" for radius in missing if radius > reach]
    within = [f"{radius:g}" for radius in missing if radius <= reach]
    notes = []
    if beyond:
        notes.append(
            f"Rings of radius {' '.join(beyond)} mm were not found: they lie beyond the picture or its lit part, which "
            f"ends at {reach:.3g} mm. They change nothing."
        )
    if within:
        notes.append(
            f"Rings of radius {' '.join(within)} mm were not found, though the picture reaches as far as {reach:.3g} "
            "mm: they are hidden, too faint, or not on this sheet."
        )
    return tuple(notes)


def _all_views(photos: list[Photograph], priors: RingPriors) -> tuple[dict[int, RingView], list[tuple[int, str]]]:
    views, rejected = {}, []
    for index, photo in enumerate(photos):
        try:
            view = view_rings(photo, priors)
        except ValueError as error:
            rejected.append((index, str(error)))
            continue
        if view.fraction < LEAST_MATCHED or view.labelling.explained < LEAST_EXPLAINED:
            rejected.append((index, _too_few(view, priors)))
        else:
            views[index] = view
    if not views:
        listed = "; ".join(f"photograph {index + 1}: {reason}" for index, reason in rejected)
        raise ValueError(f"no photograph could be used. {listed}")
    return views, rejected


def _too_few(view: RingView, priors: RingPriors) -> str:
    radii = " ".join(f"{radius:g}" for radius in priors.radii)
    if view.labelling.explained < LEAST_EXPLAINED:
        return (
            f"{1 - view.labelling.explained:.0%} of the rings seen are none of the radii {radii} mm: are these "
            "the radii of this sheet, counted from the centre, and all of them?"
        )
    return (
        f"only {view.matched} of {view.expected} expected ring edges were found ({view.fraction:.0%}, at least "
        f"{LEAST_MATCHED:.0%} are needed): are the radii {radii} mm those of this sheet, counted from the centre? "
        "If so, light the sheet evenly, keep it in focus, and have at least two whole rings in the picture"
    )


def _joint_start(views: list[RingView]) -> Float[np.ndarray, " size"]:
    """Lens: median over the photographs; line width likewise; poses as found."""
    lens = np.median([view.first.parameters[:VIEWS_AT] for view in views], axis=0)
    lens[LENS_SIZE] = float(np.median([view.line_width for view in views]))
    return np.concatenate([lens, *[view.first.parameters[VIEWS_AT:] for view in views]])


def _joint_fit(name: str, setup, start: Float[np.ndarray, " size"]):
    found = fit(name, setup, start, rounds=3)
    for _ in range(2):
        setup = with_shifts(setup, found.residual, found.weight)
        setup = with_precision(setup, found.residual, found.weight)
        found = fit(name, setup, found.parameters, rounds=3, noise=found.noise)
    if not found.success:
        raise ValueError(
            f"the fit of the {name} lens did not converge; try another --model, give --height, or add a photograph"
        )
    return setup, found


def _check_rms(found: Fit, printed: Float[np.ndarray, " rings"]) -> None:
    """Raises ValueError for rings that are far from where the fit puts them."""
    if found.rms > WORST_RMS * found.setup.size[0]:
        listed = " ".join(f"{radius:g}" for radius in printed)
        raise ValueError(
            f"the rings found do not fit flat circles of {listed} mm under the {found.name} lens "
            f"(rms {found.rms:.1f} px): try --model auto, check the radii, and photograph the circles so that their "
            "common centre and at least two whole rings are in the picture, in focus"
        )


def _groupings(found: Fit, rings: Int[np.ndarray, " count"]) -> list[Int[np.ndarray, " count"]]:
    """Left out in turn: a ring, an arc (30° of the image), a photograph."""
    o = found.setup.observations
    angle = np.arctan2(*(o.pixel - found.parameters[1:3]).T)
    arcs = np.floor((angle + np.pi) / (2 * np.pi) * 12).astype(int)
    return [rings, arcs, o.group]


def _view_result(found: Fit, covariance, view: RingView, row: int, index: int, printed) -> ViewResult:
    o = found.setup.observations
    mine = (o.group == row) & (found.weight > 0)
    rms = float(np.sqrt(np.mean(found.residual[mine] ** 2)))
    figures = pose_figures(found, covariance, row)
    by_ring = _mean_radii(found, row, mine)
    figures["paper"] = estimators(by_ring[1], by_ring[0], figures["height_mm"])
    figures["rings_mm"] = by_ring[0].tolist()
    return ViewResult(index, view.matched, view.expected, rms, figures)


def _mean_radii(found: Fit, row: int, mine) -> tuple[np.ndarray, np.ndarray]:
    """Printed radius and mean image radius about the image of the target's centre, of each ring seen all round (of
    all rings, if fewer than two are): arcs of a tilted ring would bias the mean."""
    o = found.setup.observations
    centre = target_centre(found.name, found.parameters[:LENS_SIZE], found.view(row))
    away = o.pixel[mine] - centre
    radius, sector = np.hypot(*away.T), np.floor(np.arctan2(*away.T) * 6 / np.pi)
    rings = o.target[mine, 0]
    names = np.unique(rings)
    whole = np.array([len(np.unique(sector[rings == ring])) >= 11 for ring in names])
    names = names[whole] if whole.sum() >= 2 else names
    return names, np.array([radius[rings == ring].mean() for ring in names])
