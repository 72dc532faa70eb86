"""Ring edges without any model: a rough common centre, edges along radial rays, chains of them along the angle."""

from typing import NamedTuple

import cv2
import numpy as np
from jaxtyping import Bool, Float
from scipy import ndimage

from jaxsfs.calibration._field import Photograph

RAYS = 360
_ENOUGH = 640  # px of width for a rough centre
_CLEAR = 5.0  # times the noise: an edge
_BESIDE = 5  # rays, beyond the smoothing along the angle
_LEAST_PAIRS = 20  # of rays


class Chain(NamedTuple):
    """An edge followed along the angle: `radius[θ]` in px from the centre, NaN where it was not seen; `polarity`
    +1 for dark inside, −1 for dark outside."""

    polarity: int
    radius: np.ndarray

    @property
    def share(self) -> float:
        """Seen part of the full turn."""
        return float(np.isfinite(self.radius).mean())


def rough_centre(photo: Photograph) -> tuple[float, float]:
    """The point (u, v) through which most image gradients pass; of large pictures, those of a smaller copy."""
    shrink = max(1, round(photo.size[0] / _ENOUGH))
    size = photo.size[0] // shrink, photo.size[1] // shrink
    grey = cv2.resize(photo.grey.astype(np.float32), size, interpolation=cv2.INTER_AREA)
    usable = cv2.resize(photo.usable.astype(np.uint8), size, interpolation=cv2.INTER_NEAREST) > 0
    centre = _crossing_of_gradients(grey, usable)
    return shrink * (centre[0] + 0.5) - 0.5, shrink * (centre[1] + 0.5) - 0.5


def _crossing_of_gradients(
    grey: Float[np.ndarray, "height width"], usable: Bool[np.ndarray, "height width"]
) -> tuple[float, float]:
    smooth = cv2.GaussianBlur(grey, (0, 0), 1.5)
    local = cv2.GaussianBlur(grey, (0, 0), 12.0) + 0.02
    gx, gy = (cv2.Sobel(smooth, cv2.CV_32F, *order) / local for order in ((1, 0), (0, 1)))
    strength = np.hypot(gx, gy) * usable
    inside = strength[usable]
    if inside.size < 1000 or not inside.any():
        raise ValueError("no usable picture: the lit, unsaturated field is almost empty")
    v, u = np.nonzero(strength > np.percentile(inside, 90))
    keep = np.random.default_rng(0).permutation(len(u))[:15000]
    u, v = u[keep], v[keep]
    norm = strength[v, u]
    direction = np.stack([gx[v, u], gy[v, u]], axis=1) / norm[:, None]
    centre = _vote(u, v, direction, grey.shape[::-1])
    for reach in (40.0, 20.0, 10.0, 10.0):
        across = np.stack([-direction[:, 1], direction[:, 0]], axis=1)
        miss = across[:, 0] * (u - centre[0]) + across[:, 1] * (v - centre[1])
        weight = 1 / (1 + (miss / (reach / 3)) ** 2) ** 2
        lhs = (across * weight[:, None]).T @ across
        rhs = (across * weight[:, None]).T @ (across[:, 0] * u + across[:, 1] * v)
        centre = np.linalg.solve(lhs, rhs)
    return float(centre[0]), float(centre[1])


def _vote(u, v, direction, size) -> Float[np.ndarray, "2"]:
    """The cell of a coarse grid that most gradient lines cross (an eightieth of the image's width, at least 8 px)."""
    cell = max(8, size[0] // 80)
    steps = np.arange(-1.2 * max(size), 1.2 * max(size), cell)
    x = ((u[:, None] + direction[:, :1] * steps) / cell).astype(int)
    y = ((v[:, None] + direction[:, 1:] * steps) / cell).astype(int)
    columns, rows = size[0] // cell + 1, size[1] // cell + 1
    inside = (x >= 0) & (x < columns) & (y >= 0) & (y < rows)
    votes = np.bincount((y * columns + x)[inside], minlength=rows * columns).reshape(rows, columns)
    votes = cv2.GaussianBlur(votes.astype(float), (0, 0), 1.0)
    row, column = np.unravel_index(int(np.argmax(votes)), votes.shape)
    return np.array([(column + 0.5) * cell, (row + 0.5) * cell])


def ring_chains(photo: Photograph, centre: tuple[float, float]) -> list[Chain]:
    """Chains of edges around `centre`, each at least 25° long, from the inside outwards."""
    response, ok = _radial_response(photo, centre)
    size = np.abs(response)
    peak = (size > np.roll(size, 1, axis=1)) & (size >= np.roll(size, -1, axis=1)) & ok
    peak[:, :3] = peak[:, -3:] = False
    if peak.sum() < 50:
        return []
    peak &= size > _CLEAR * _noise(response, ok)
    strong = np.percentile(size[peak], 75) if peak.any() else np.inf
    peak &= size > 0.3 * strong
    chains: list[Chain] = []
    for polarity in (-1, 1):
        chains += _link(peak & (np.sign(response) == polarity), size, polarity)
    return sorted((c for c in chains if c.share >= 25 / 360), key=lambda c: float(np.nanmedian(c.radius)))


def _radial_response(photo: Photograph, centre) -> tuple[np.ndarray, np.ndarray]:
    """Radial derivative over local brightness on a polar grid [ray, px], and where it is usable."""
    width, height = photo.size
    reach = int(np.hypot(max(centre[0], width - centre[0]), max(centre[1], height - centre[1])))
    angle = np.deg2rad(np.arange(RAYS))[:, None]
    radius = np.arange(reach)[None, :]
    u = (centre[0] + radius * np.cos(angle)).astype(np.float32)
    v = (centre[1] + radius * np.sin(angle)).astype(np.float32)
    smooth = cv2.GaussianBlur(photo.grey, (0, 0), 0.7).astype(np.float32)
    polar = cv2.remap(smooth, u, v, cv2.INTER_LINEAR).astype(float)
    ok = cv2.remap(photo.usable.astype(np.float32), u, v, cv2.INTER_LINEAR) > 0.99
    ok = cv2.erode(ok.astype(np.uint8), np.ones((1, 7)), borderType=cv2.BORDER_CONSTANT, borderValue=0) > 0
    polar = ndimage.gaussian_filter1d(polar, 1.0, axis=0, mode="wrap")
    bright = ndimage.gaussian_filter(ndimage.maximum_filter(polar, (1, 25)), (2, 8))
    response = ndimage.gaussian_filter1d(polar, 1.2, axis=1, order=1) / (bright + 0.02)
    return response, ok


def _noise(response: Float[np.ndarray, "rays px"], ok: Bool[np.ndarray, "rays px"]) -> Float[np.ndarray, " px"]:
    """sd of the response at every radius, from rays so near each other that they see the same rings: it grows where
    light falls off."""
    change = np.where(ok & np.roll(ok, _BESIDE, axis=0), response - np.roll(response, _BESIDE, axis=0), np.nan)
    seen = np.isfinite(change).sum(axis=0) >= _LEAST_PAIRS
    if not seen.any():
        return np.full(response.shape[1], np.inf)
    sd = 1.4826 / np.sqrt(2) * np.nanmedian(np.abs(change[:, seen]), axis=0)
    all_radii = np.interp(np.arange(response.shape[1]), np.nonzero(seen)[0], sd)
    return ndimage.median_filter(all_radii, 31, mode="nearest")


def _link(peak: np.ndarray, size: np.ndarray, polarity: int) -> list[Chain]:
    """Peaks of neighbouring rays joined into chains: nearest within 3 px of the extrapolated radius, gaps to 8°."""
    open_chains: list[dict[int, float]] = []
    done: list[dict[int, float]] = []
    for turn in range(RAYS):
        found = _subpixel(size[turn], np.nonzero(peak[turn])[0])
        taken = np.zeros(len(found), bool)
        still = []
        for chain in open_chains:
            last = max(chain)
            if turn - last > 8:
                done.append(chain)
                continue
            still.append(chain)
            gap = np.abs(found - _extrapolated(chain, last, turn)) + 1e3 * taken
            if len(found) and gap.min() < 3.0:
                taken[int(np.argmin(gap))] = True
                chain[turn] = float(found[int(np.argmin(gap))])
        open_chains = still + [{turn: float(r)} for r in found[~taken]]
    chains = [c for c in done + open_chains if len(c) >= 6]
    return [Chain(polarity, _as_array(c)) for c in _joined_at_zero(chains)]


def _subpixel(row: np.ndarray, index: np.ndarray) -> np.ndarray:
    before, at, after = row[index - 1], row[index], row[index + 1]
    return index + 0.5 * (before - after) / np.minimum(before - 2 * at + after, -1e-12)


def _extrapolated(chain: dict[int, float], last: int, turn: int) -> float:
    earlier = chain.get(last - 6)
    slope = 0.0 if earlier is None else (chain[last] - earlier) / 6
    return chain[last] + slope * (turn - last)


def _joined_at_zero(chains: list[dict[int, float]]) -> list[dict[int, float]]:
    """Chains that end at 359° and go on at 0° become one."""
    for first in list(chains):
        if min(first) > 8:
            continue
        for last in chains:
            near = RAYS - max(last) + min(first) <= 9 and abs(last[max(last)] - first[min(first)]) < 4.0
            if last is not first and near and not set(first) & set(last):
                last.update(first)
                chains.remove(first)
                break
    return chains


def _as_array(chain: dict[int, float]) -> np.ndarray:
    radius = np.full(RAYS, np.nan)
    radius[list(chain)] = list(chain.values())
    return radius
