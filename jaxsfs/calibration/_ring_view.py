"""One photograph of rings: from the picture to labelled sub-pixel edges and a first fit."""

import dataclasses

import numpy as np
from jaxtyping import Float

from jaxsfs.calibration._field import Photograph
from jaxsfs.calibration._fit import Fit, fit, plane_points
from jaxsfs.calibration._lens import LENS_SIZE, start_lens
from jaxsfs.calibration._ring_chains import RAYS, Chain, ring_chains, rough_centre
from jaxsfs.calibration._ring_edges import Edges, search_edges
from jaxsfs.calibration._ring_labels import STYLES, Labelling, RingGuess, labellings, rings_of
from jaxsfs.calibration._ring_setup import RingPriors, ring_setup, with_shifts

EDGE_BUDGET = 1024  # edges per photograph, so that one compiled size serves
_SEARCH_LENS = "spherical-k"
_ROUGH_RMS = 0.02  # of the image width, at most of a first fit: it does not know the lines' width yet


@dataclasses.dataclass(frozen=True)
class RingView:
    """Labelled edges of one photograph. `matched`/`expected` count edges found and looked for; `style` is "dark",
    "bright" or "bands"; `line_width` in mm on the paper (negative for bright lines, 0 for bands)."""

    edges: Edges
    first: Fit
    style: str
    line_width: float
    matched: int
    expected: int
    labelling: Labelling
    closed_form: tuple[float, float]

    @property
    def fraction(self) -> float:
        return self.matched / max(self.expected, 1)

    @property
    def searched_fraction(self) -> float:
        """Share of all edges looked for, those that would not stand out included."""
        return self.matched / max(self.edges.searched, 1)


def view_rings(photo: Photograph, priors: RingPriors) -> RingView:
    """Finds the rings of one photograph.

    Raises ValueError that says what was seen and what to photograph instead.
    """
    # labels must not hang on a height that may be wrong; the joint fit weighs it as the user says
    priors = dataclasses.replace(priors, height_tolerance=max(priors.height_tolerance, 0.3))
    centre = rough_centre(photo)
    chains = ring_chains(photo, centre)
    if len(chains) < 2:
        raise ValueError(
            f"no concentric rings found: {len(chains)} edge(s) round the point ({centre[0]:.0f}, {centre[1]:.0f}) px. "
            "Photograph the printed circles so that at least two of them are wholly in the picture, in focus"
        )
    best = None
    for style, labelling, first in _candidates(chains, centre, photo, priors):
        view = _searched(photo, priors, style, labelling, first)
        if view is not None and (best is None or _merit(view) > _merit(best)):
            best = view
        if best is not None and best.searched_fraction > 0.9 and best.first.rms < 0.4:
            break
    if best is None:
        raise ValueError(
            f"{len(chains)} ring edges were found, but no assignment to the {len(priors.radii)} radii "
            f"{_numbers(priors.radii)} mm fits them. Check --radii (printed radii from the centre, in mm)"
        )
    return best


def _merit(view: RingView) -> float:
    # of all that was searched: wrong labels put rings where none would be seen, and must not be excused; and much seen
    # is better than little
    fit = 0.15 * np.log(max(view.first.rms, 0.05))
    return view.searched_fraction + 0.5 * np.log(max(view.matched, 1)) - fit


def _candidates(chains: list[Chain], centre, photo: Photograph, priors: RingPriors):
    """(style, labelling, first fit) of the best few hypotheses, best first, each fitted when asked for."""
    options: list[tuple[str, list[RingGuess], Labelling]] = []
    for style in STYLES:
        rings = rings_of(chains, style)
        if len(rings) >= 2:
            spare = len(chains) - sum(len(ring.chains) for ring in rings)
            found = [one for one in labellings(rings, priors.radii) if style != "bands" or _take_turns(rings, one)]
            options += [(style, rings, one._replace(score=one.score - 0.4 * spare)) for one in found]
    options.sort(key=lambda option: -option[2].score)
    for style, rings, labelling in options[:5]:
        first = _first_fit(rings, labelling, centre, photo, priors, style)
        if first is not None and first.rms < _ROUGH_RMS * photo.size[0]:
            yield style, labelling, first


def _take_turns(rings: list[RingGuess], labelling: Labelling) -> bool:
    pairs = zip(rings, labelling.labels, strict=True)
    return len({ring.chains[0].polarity * (-1) ** int(label) for ring, label in pairs if label >= 0}) == 1


def _first_fit(rings, labelling: Labelling, centre, photo: Photograph, priors: RingPriors, style: str) -> Fit | None:
    """Fit to the labelled, nearly whole rings with the principal point held at the field's centre."""
    pixel, ring, polarity = [], [], []
    for guess, label in zip(rings, labelling.labels, strict=True):
        if label < 0:
            continue
        for chain in guess.chains:
            angle = np.nonzero(np.isfinite(chain.radius))[0]
            theta, radius = 2 * np.pi * angle / RAYS, chain.radius[angle]
            pixel.append(np.stack([centre[0] + radius * np.cos(theta), centre[1] + radius * np.sin(theta)], axis=1))
            ring.append(np.full(len(angle), label))
            polarity.append(np.full(len(angle), chain.polarity))
    points = np.concatenate(pixel)
    stride = max(1, int(np.ceil(len(points) / EDGE_BUDGET)))
    points, labels, sides = points[::stride], np.concatenate(ring)[::stride], np.concatenate(polarity)[::stride]
    edges = Edges(points, labels, sides, 0, np.zeros(len(points)), 0)
    setup = ring_setup([edges], priors, photo.size, centre_free=False)
    start = _start(labelling, centre, priors, edges)
    sign = {"dark": 1.0, "bright": -1.0, "bands": 0.0}[style]
    start[LENS_SIZE] = sign * 0.05 * float(np.diff(priors.radii).min())
    found = fit("spherical", setup, start, rounds=2)
    if not found.success:
        return None
    parameters = found.parameters.copy()
    parameters[LENS_SIZE] = line_width(edges, found, style, priors)
    return dataclasses.replace(found, parameters=parameters)


def _start(labelling: Labelling, centre, priors: RingPriors, edges: Edges) -> Float[np.ndarray, " size"]:
    """The closed form's f and h, no tilt, and the offset that puts the target's centre at its image."""
    axis = np.array(priors.field_centre)
    outermost = float(np.max(np.hypot(*(edges.pixel - axis).T)))
    f = max(labelling.f, 1.08 * outermost)
    sine = np.clip(np.hypot(*(np.array(centre) - axis)) / f, 0, 0.9)
    towards = (np.array(centre) - axis) / max(np.hypot(*(np.array(centre) - axis)), 1e-9)
    offset = labelling.h * sine / np.sqrt(1 - sine**2) * towards
    view = np.array([1e-3, 1e-3, 0.0, offset[0], offset[1], np.log(labelling.h)])
    return np.concatenate([start_lens(f, *priors.field_centre), [0.0, 0.0], view])


def _searched(photo, priors: RingPriors, style: str, labelling: Labelling, first: Fit) -> RingView | None:
    """Twice: predict every printed ring, find its edges there, refit with the principal point free."""
    current = first
    edges = None
    for name in ("spherical", _SEARCH_LENS):
        edges = search_edges(photo, current.name, current.parameters, current.view(0), priors.radii, style)
        if len(edges.pixel) < 40 or len(np.unique(edges.ring)) < 2 or (style == "bands" and not _alternate(edges)):
            return None
        setup = ring_setup([edges], priors, photo.size)
        start = current.parameters.copy()
        start[LENS_SIZE] = line_width(edges, current, style, priors)
        found = fit(name, setup, start, rounds=2)
        setup = with_shifts(setup, found.residual, found.weight)
        found = fit(name, setup, found.parameters, rounds=1, noise=found.noise)
        if not found.success:
            return None
        current = found
    width = float(current.parameters[LENS_SIZE])
    matched = int((np.abs(current.residual[:, 0]) < max(5 * current.noise, 0.5)).sum())
    return RingView(edges, current, style, width, matched, edges.expected, labelling, (labelling.f, labelling.h))


def _alternate(edges: Edges) -> bool:
    """Whether dark and light take turns from ring to ring, as the edges of filled bands do."""
    side = [np.sign(edges.polarity[edges.ring == ring].sum()) * (-1) ** int(ring) for ring in np.unique(edges.ring)]
    return len(set(side)) == 1


def line_width(edges: Edges, current: Fit, style: str, priors: RingPriors) -> float:
    """Width of the printed lines in mm: the median over rings of the gap between both edges on the fitted plane."""
    if style == "bands":
        return 0.0
    radius = paper_radius(current, edges.pixel)
    sign = 1.0 if style == "dark" else -1.0
    widths = []
    for ring in np.unique(edges.ring):
        inner = radius[(edges.ring == ring) & (edges.polarity == -sign)]
        outer = radius[(edges.ring == ring) & (edges.polarity == sign)]
        if len(inner) > 5 and len(outer) > 5:
            widths.append(np.median(outer) - np.median(inner))
    return sign * float(np.median(widths)) if widths else 0.0


def paper_radius(current: Fit, pixel: Float[np.ndarray, "count 2"], view: int = 0) -> Float[np.ndarray, " count"]:
    """R(u, v) in mm on the fitted plane."""
    return np.hypot(*plane_points(current, pixel, view).T)


def _numbers(values) -> str:
    return " ".join(f"{value:g}" for value in values)
