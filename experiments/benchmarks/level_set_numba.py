"""The order-1 level-set scheme of `jaxsfs.levelset` in Numba on all cores: one pass over the rows a step."""

import math

import measure
import numpy as np
from level_set_numpy import CFL, FAR, _ring_lengths

numba, MISSING = measure.peer("numba", "Numba, same scheme")


def program(problem):
    """run(steps) with equal steps over half a pixel of the fastest front."""
    bound, metric, weights, offsets = problem._numpy
    inside = problem._carried
    if len(offsets) != 4:
        raise ValueError(f"written for the eight neighbours, got {len(offsets)} offsets: take a narrower field")
    lengths = _ring_lengths(np.where(inside[..., None, None], metric, np.eye(2, dtype=np.float32))).astype(np.float32)
    crossing = np.sqrt(weights.sum(axis=0)).astype(np.float32)
    ds = np.float32((problem.end - problem.start) / (2 * len(bound)))
    shape = tuple(n + 2 for n in bound.shape)

    def run(steps: int):
        w = np.full(shape, 2 * FAR, np.float32)
        w[1:-1, 1:-1] = np.where(inside, bound, 2 * FAR)
        slowness = np.zeros(shape, np.float32)
        new, s = w.copy(), np.float32(problem.start)
        for _ in range(steps):
            _speed(w, bound, slowness)
            _step(w, new, slowness, bound, weights, lengths, crossing, inside, s, ds)
            w, new, s = new, w, np.float32(s + ds)
        return w

    return run


def _jit(function):
    return function if MISSING else numba.njit(parallel=True, fastmath=True, error_model="numpy")(function)


def _inlined(function):
    return function if MISSING else numba.njit(inline="always", fastmath=True)(function)


prange = range if MISSING else numba.prange
ZERO, HALF, ONE, TWO = (np.float32(x) for x in (0, 0.5, 1, 2))


@_inlined
def _exp(x):
    """e^x for −4.6 ≤ x ≤ 0 as (e^{x/64})^64: of calls to the C library Numba makes no vector operations."""
    y = x * np.float32(1 / 64)
    e = ONE + y * (ONE + y * (HALF + y * (np.float32(1 / 6) + y * np.float32(1 / 24))))
    for _ in range(6):
        e *= e
    return e


@_jit
def _speed(w, bound, slowness):
    """1/F = √(1 − c²)/c, c = e^{2(w − bound)}."""
    for i in prange(bound.shape[0]):
        here, last, out = w[i + 1, 1:-1], bound[i], slowness[i + 1, 1:-1]
        for j in range(last.shape[0]):
            c = _exp(min(max(TWO * (here[j] - last[j]), np.float32(math.log(0.01))), ZERO))
            out[j] = math.sqrt(max(ONE - c * c, np.float32(1e-8))) / c


@_jit
def _step(w, new, slowness, bound, weights, lengths, crossing, inside, s, ds):
    """Every waiting pixel: w + ds (1 − F |∇φ|), between its earliest neighbour and the straight paths. Row by row in
    slices, of which Numba makes vector operations."""
    n = bound.shape[1]
    for i in prange(bound.shape[0]):
        north_west, north, north_east = w[i, :n], w[i, 1 : n + 1], w[i, 2:]
        west, centre, east = w[i + 1, :n], w[i + 1, 1 : n + 1], w[i + 1, 2:]
        south_west, south, south_east = w[i + 2, :n], w[i + 2, 1 : n + 1], w[i + 2, 2:]
        slow_nw, slow_n, slow_ne = slowness[i, :n], slowness[i, 1 : n + 1], slowness[i, 2:]
        slow_w, slow, slow_e = slowness[i + 1, :n], slowness[i + 1, 1 : n + 1], slowness[i + 1, 2:]
        slow_sw, slow_s, slow_se = slowness[i + 2, :n], slowness[i + 2, 1 : n + 1], slowness[i + 2, 2:]
        weight0, weight1, weight2, weight3 = weights[0, i], weights[1, i], weights[2, i], weights[3, i]
        length0, length1, length2, length3 = lengths[0, i], lengths[1, i], lengths[2, i], lengths[3, i]
        last, cross, here_inside, out = bound[i], crossing[i], inside[i], new[i + 1, 1 : n + 1]
        for j in range(n):
            here, own = centre[j], slow[j]
            first, second = min(east[j], west[j]), min(south[j], north[j])
            third, fourth = min(south_east[j], north_west[j]), min(north_east[j], south_west[j])
            d0, d1 = max(here - first, ZERO), max(here - second, ZERO)
            d2, d3 = max(here - third, ZERO), max(here - fourth, ZERO)
            total = weight0[j] * d0 * d0 + weight1[j] * d1 * d1 + weight2[j] * d2 * d2 + weight3[j] * d3 * d3
            half = HALF * length0[j]
            latest = min(east[j] + half * (own + slow_e[j]), west[j] + half * (own + slow_w[j]))
            half = HALF * length1[j]
            latest = min(latest, min(south[j] + half * (own + slow_s[j]), north[j] + half * (own + slow_n[j])))
            half = HALF * length2[j]
            path = min(south_east[j] + half * (own + slow_se[j]), north_west[j] + half * (own + slow_nw[j]))
            latest = min(latest, path)
            half = HALF * length3[j]
            path = min(north_east[j] + half * (own + slow_ne[j]), south_west[j] + half * (own + slow_sw[j]))
            latest = min(latest, path)
            speed = min(ONE / max(own, np.float32(1e-4)), np.float32(CFL) / (ds * cross[j]))
            value = min(here + ds * (ONE - speed * math.sqrt(total)), last[j])
            earliest = min(min(last[j], min(first, second)), min(third, fourth))
            value = max(min(value, latest), earliest)
            out[j] = value if here_inside[j] and here > s else here
