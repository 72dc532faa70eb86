"""From labelled edges to a least-squares setup, with the priors that hold what rings cannot fix."""

import dataclasses

import numpy as np
from jaxtyping import Float

from jaxsfs.calibration._fit import Setup
from jaxsfs.calibration._lens import LENS_SIZE, SHAPE
from jaxsfs.calibration._problem import VIEW_SIZE, VIEWS_AT, Rows
from jaxsfs.calibration._ring_edges import Edges

CENTRE_SD = 0.04  # of the image width: prior on the principal point about the field's centre
TILT_SD = 0.5  # rad
SHAPE_SD = 0.15
_LOOSE = 1e6


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
    systematic = 0.5 * np.concatenate([e.bend for e in edges])[:, None]
    return Setup("rings", observations, size, views, 1, free, prior, sd, systematic, priors.aspect)


def with_shifts(setup: Setup, residual: Float[np.ndarray, "count 1"], weight: Float[np.ndarray, " count"]) -> Setup:
    """The setup with the px by which blur and tone curve widen the ink, one per ring and photograph where both edges
    of a line are seen, one per photograph for bands. It is the mean of polarity · residual, which the fit of the
    rings' middles does not feel."""
    o = setup.observations
    key = o.group * 1000.0 + o.target[:, 0]
    two_sided = all(len(np.unique(o.polarity[key == k])) == 2 for k in np.unique(key))
    key = key if two_sided else o.group.astype(float)
    shift = np.array(o.shift)
    for k in np.unique(key):
        rows = (key == k) & (weight > 0)
        if rows.sum() < 8:
            continue
        sides = [
            np.mean(residual[rows & (o.polarity == s), 0] * s) for s in (-1, 1) if (rows & (o.polarity == s)).any()
        ]
        shift[key == k] += np.mean(sides)
    return dataclasses.replace(setup, observations=dataclasses.replace(o, shift=shift))
