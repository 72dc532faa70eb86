"""From labelled edges to a least-squares setup, with the priors that hold what rings cannot fix."""

import dataclasses

import numpy as np
from jaxtyping import Bool, Float

from jaxsfs.calibration._fit import Setup
from jaxsfs.calibration._lens import LENS_SIZE, SHAPE
from jaxsfs.calibration._problem import VIEW_SIZE, VIEWS_AT, Rows
from jaxsfs.calibration._ring_edges import Edges

CENTRE_SD = 0.04  # of the image width: prior on the principal point about the field's centre
TILT_SD = 0.5  # rad
SHAPE_SD = 0.15
_LOOSE = 1e6
UNSURE = 0.3  # of what blur moves an edge: its sd, that all edges share
_LEAST_HARMONIC = 40  # edges of a ring that fix five harmonics of its line's width
_LEAST_SCATTER = 12  # edges of a ring from which its scatter is known
_LEAST_SD = 0.015  # px: what edges share does not average away


@dataclasses.dataclass(frozen=True)
class RingPriors:
    """Printed `radii` (mm), the measured `height` in mm with its relative tolerance (or None), the principal point's
    prior mean (px), whether the pixel aspect is free."""

    radii: Float[np.ndarray, " rings"]
    field_centre: tuple[float, float]
    height: float | None = None
    height_tolerance: float = 0.02
    aspect: bool = False


def ring_setup(edges: list[Edges], priors: RingPriors, size: tuple[int, int], centre_free: bool = True) -> Setup:
    """The setup of all photographs' edges; `group` is the index of the photograph."""
    pixel = np.concatenate([e.pixel for e in edges])
    ring = np.concatenate([e.ring for e in edges])
    count, views = len(pixel), len(edges)
    radius = priors.radii[ring]
    observations = Rows(
        pixel=pixel,
        target=np.stack([radius, np.zeros(count)], axis=1),
        polarity=np.concatenate([e.polarity for e in edges]).astype(float),
        shift=np.zeros(count),
        group=np.concatenate([np.full(len(e.pixel), i) for i, e in enumerate(edges)]),
    )
    total = VIEWS_AT + VIEW_SIZE * views
    free, prior, sd = np.zeros(total, bool), np.zeros(total), np.full(total, _LOOSE)
    free[0] = True
    free[1:3] = centre_free
    prior[1:3], sd[1:3] = priors.field_centre, CENTRE_SD * size[0]
    sd[SHAPE:LENS_SIZE] = SHAPE_SD
    for view in range(views):
        at = VIEWS_AT + VIEW_SIZE * view
        free[[at, at + 1, at + 3, at + 4, at + 5]] = True
        sd[at : at + 2] = TILT_SD
        if priors.height is not None:
            prior[at + 5], sd[at + 5] = np.log(priors.height), priors.height_tolerance
    systematic = UNSURE * np.concatenate([e.bend for e in edges])[:, None]
    return Setup("rings", observations, size, views, 1, free, prior, sd, systematic, priors.aspect)


def with_precision(setup: Setup, residual: Float[np.ndarray, "count 1"], weight: Float[np.ndarray, " count"]) -> Setup:
    """The setup with each row's precision from the scatter of its ring in its photograph: rings at a dark rim, or
    thin beside the blur, scatter ten times more than the best."""
    o = setup.observations
    key = o.group * 1000.0 + o.target[:, 0]
    sd = np.full(len(key), np.nan)
    for k in np.unique(key):
        rows = (key == k) & (weight > 0)
        # a few edges tell their scatter only roughly
        if rows.sum() >= _LEAST_SCATTER:
            sd[key == k] = max(1.4826 * float(np.median(np.abs(residual[rows, 0]))), _LEAST_SD)
    typical = float(np.nanmedian(sd)) if np.isfinite(sd).any() else 1.0
    precision = np.clip(typical / np.where(np.isfinite(sd), sd, 2 * typical), 0.1, 4.0)
    return dataclasses.replace(setup, precision=precision)


def with_shifts(setup: Setup, residual: Float[np.ndarray, "count 1"], weight: Float[np.ndarray, " count"]) -> Setup:
    """The setup with the px by which blur and tone curve widen the ink: where both edges of lines are seen, a smooth
    function of the angle for each ring and photograph (a tilted line is thin beside the blur on one side and not on
    the other), one number per photograph for bands. The fit of the rings' middles does not feel it."""
    o = setup.observations
    key = o.group * 1000.0 + o.target[:, 0]
    two_sided = all(len(np.unique(o.polarity[key == k])) == 2 for k in np.unique(key))
    key = key if two_sided else o.group.astype(float)
    terms = _harmonics(setup) if two_sided else np.ones((len(key), 1))
    shift = np.array(o.shift)
    for k in np.unique(key):
        rows = (key == k) & ((weight > 0) | _as_wide(residual[:, 0] * o.polarity, key == k) & two_sided)
        count = terms.shape[1] if rows.sum() > _LEAST_HARMONIC else 1
        if rows.sum() >= 8:
            shift[key == k] += terms[key == k, :count] @ _widening(
                terms[rows, :count], o.polarity[rows], residual[rows]
            )
    return dataclasses.replace(setup, observations=dataclasses.replace(o, shift=shift))


def _as_wide(widening: Float[np.ndarray, " n"], ring: Bool[np.ndarray, " n"]) -> Bool[np.ndarray, " n"]:
    """Edges moved outwards about as far as most of their ring's: thin lines look so wide that all their edges are
    culled at first."""
    gap = np.abs(widening - np.median(widening[ring]))
    return ring & (gap < max(3.5 * 1.4826 * float(np.median(gap[ring])), 0.2))


def _widening(terms: Float[np.ndarray, "n k"], polarity: Float[np.ndarray, " n"], residual) -> Float[np.ndarray, " k"]:
    """Coefficients of the part of the residuals that changes sign with the polarity, the other part being smooth too;
    of bands, where one polarity may be all there is, half the sum of the two sides' means."""
    if terms.shape[1] == 1:
        sides = [np.mean(residual[polarity == s] * s) for s in (-1, 1) if (polarity == s).any()]
        return np.array([np.mean(sides)])
    design = np.concatenate([polarity[:, None] * terms, terms], axis=1)
    return np.linalg.lstsq(design, residual[:, 0], rcond=None)[0][: terms.shape[1]]


def _harmonics(setup: Setup) -> Float[np.ndarray, "count 5"]:
    """1, cos, sin of the angle about the middle of the photograph's edges, and of twice the angle."""
    o = setup.observations
    middle = np.stack([np.median(o.pixel[o.group == view], axis=0) for view in range(setup.views)])
    x, y = (o.pixel - middle[o.group]).T
    angle = np.arctan2(y, x)
    return np.stack([np.ones(len(x)), np.cos(angle), np.sin(angle), np.cos(2 * angle), np.sin(2 * angle)], axis=1)
