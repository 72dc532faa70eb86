"""Which printed ring is which chain of edges: pairing of edges by style, then labels by the closed form

    1/r² = (1/f²)(1 + (h/R)²)        (r radius in the image, R on the paper; eq. 19 with α = atan(R/h)),

a straight line in 1/R², tried over pairs of rings and pairs of printed radii.
"""

import itertools
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from jaxsfs.calibration._ring_chains import RAYS, Chain

STYLES = ("dark", "bright", "bands")


class RingGuess(NamedTuple):
    """A ring seen: its edge chains (two for a line, one for the edge of a band), its mean radius in px by opposite
    rays, and the share of the turn that was seen."""

    chains: tuple[Chain, ...]
    radius: float
    share: float


class Labelling(NamedTuple):
    """`labels[i]`: index of the printed radius of ring i, −1 for none; f in px and h in mm of the closed form;
    `score`: matched rings minus missed and unexplained ones; `explained`: share of the nearly whole rings that have a
    label."""

    labels: Int[np.ndarray, " rings"]
    f: float
    h: float
    score: float
    explained: float


def rings_of(chains: list[Chain], style: str) -> list[RingGuess]:
    """The rings that the chains form if the target is drawn as dark lines, bright lines or filled bands."""
    if style == "bands":
        return [_guess((chain,)) for chain in chains]
    first = -1 if style == "dark" else 1
    rings, used = [], set()
    for i, inner in enumerate(chains):
        if inner.polarity != first:
            continue
        options = [(_gap(inner, chains[j]), j) for j in range(len(chains)) if chains[j].polarity == -first]
        options = [(gap, j) for gap, j in options if gap > 0 and j not in used]
        nearest_same = min((g for c in chains if c.polarity == first and (g := _gap(inner, c)) > 0), default=np.inf)
        if options and min(options)[0] < nearest_same:
            used.add(min(options)[1])
            rings.append(_guess((chains[i], chains[min(options)[1]])))
    return sorted(rings, key=lambda ring: ring.radius)


def _gap(inner: Chain, outer: Chain) -> float:
    """Median of outer − inner over their common rays in px; −1 without enough of them."""
    both = outer.radius - inner.radius
    return float(np.nanmedian(both)) if np.isfinite(both).sum() >= 5 and inner is not outer else -1.0


def _guess(chains: tuple[Chain, ...]) -> RingGuess:
    middle = np.mean([chain.radius for chain in chains], axis=0)
    opposite = 0.5 * (middle + np.roll(middle, RAYS // 2))
    pairs = np.isfinite(opposite).sum() >= 20
    radius = float(np.nanmean(opposite)) if pairs else float(np.nanmedian(chains[0].radius))
    share = float(np.isfinite(middle).mean())
    return RingGuess(chains, radius, share if pairs else min(share, 0.3))


def labellings(rings: list[RingGuess], radii: Float[np.ndarray, " count"], most: int = 4) -> list[Labelling]:
    """The best few distinct labellings of the rings, best first; [] if no two rings allow one."""
    whole = [i for i, ring in enumerate(rings) if ring.share >= 0.45]
    if len(whole) < 2:
        whole = sorted(np.argsort([-ring.share for ring in rings])[:2].tolist())
    if len(whole) < 2 or len(radii) < 2:
        return []
    seen = np.array([rings[i].radius for i in whole])
    level, slope = _closed_forms(seen, np.asarray(radii))
    labels, score = _matches(seen, np.asarray(radii), level, slope)
    found: dict[tuple[int, ...], Labelling] = {}
    for row in np.argsort(-score, kind="stable"):
        key = tuple(labels[row].tolist())
        if key in found:
            continue
        full = -np.ones(len(rings), int)
        full[whole] = labels[row]
        f = float(1 / np.sqrt(max(level[row], (1.3 * seen.max()) ** -2 if level[row] <= 0 else level[row])))
        explained = float(np.mean(labels[row] >= 0))
        found[key] = Labelling(full, f, f * float(np.sqrt(slope[row])), float(score[row]), explained)
        if len(found) == most:
            break
    return list(found.values())


def _closed_forms(
    seen: Float[np.ndarray, " rings"], radii: Float[np.ndarray, " count"]
) -> tuple[Float[np.ndarray, " options"], Float[np.ndarray, " options"]]:
    """Level and slope of the line 1/r² over 1/R² through every pair of rings taken for every pair of printed radii, of
    those that a lens may have."""
    (i, j), (k, m) = (np.array(list(itertools.combinations(range(n), 2))).T for n in (len(seen), len(radii)))
    i, j, k, m = (np.ravel(part) for part in (*np.broadcast_arrays(i[:, None], j[:, None], k[None], m[None]),))
    slope = (seen[i] ** -2 - seen[j] ** -2) / (radii[k] ** -2 - radii[m] ** -2)
    level = seen[i] ** -2 - slope * radii[k] ** -2
    # level ≤ 0 means a lens wider open than the sine (as far as a perspective one): still a straight line
    possible = (slope > 0) & (level >= -0.3 * slope * radii[m] ** -2)
    return level[possible], slope[possible]


def _matches(
    seen: Float[np.ndarray, " rings"],
    radii: Float[np.ndarray, " count"],
    level: Float[np.ndarray, " options"],
    slope: Float[np.ndarray, " options"],
) -> tuple[Int[np.ndarray, "options rings"], Float[np.ndarray, " options"]]:
    """Labels of the rings under each closed form, each label given once, and their scores."""
    predicted = 1 / np.sqrt(np.maximum(level[:, None] + slope[:, None] * radii[None] ** -2.0, 1e-12))
    misfit = np.abs(np.log(seen[None, :, None] / predicted[:, None, :]))
    labels, best = np.argmin(misfit, axis=2), misfit.min(axis=2)
    labels = np.where(best < 0.04, labels, -1)
    rank = np.argsort(np.argsort(best, axis=1, kind="stable"), axis=1)  # of a ring among its rivals
    rivals = labels[:, :, None] == labels[:, None, :]
    beaten = (rivals & (rank[:, None, :] < rank[:, :, None])).any(axis=2)
    labels = np.where(beaten, -1, labels)
    matched = labels >= 0
    count = matched.sum(axis=1)
    missed = np.maximum((predicted < 1.02 * seen.max()).sum(axis=1) - count, 0)
    misfits = np.where(matched, best, 0.0).sum(axis=1) / np.maximum(count, 1)
    return labels, count - missed - 0.7 * (len(seen) - count) - 8.0 * misfits
