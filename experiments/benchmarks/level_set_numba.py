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


prange = range if MISSING else numba.prange


@_jit
def _speed(w, bound, slowness):
    """1/F = √(1 − c²)/c, c = e^{2(w − bound)}."""
    for i in prange(bound.shape[0]):
        for j in range(bound.shape[1]):
            c = min(max(math.exp(np.float32(2) * (w[i + 1, j + 1] - bound[i, j])), np.float32(0.01)), np.float32(1))
            slowness[i + 1, j + 1] = math.sqrt(max(np.float32(1) - c * c, np.float32(1e-8))) / c


@_jit
def _step(w, new, slowness, bound, weights, lengths, crossing, inside, s, ds):
    """Every waiting pixel: w + ds (1 − F |∇φ|), between its earliest neighbour and the straight paths."""
    for i in prange(bound.shape[0]):
        for j in range(bound.shape[1]):
            y, x = i + 1, j + 1
            here, own = w[y, x], slowness[y, x]
            a, b, c, d = w[y, x + 1], w[y + 1, x], w[y + 1, x + 1], w[y - 1, x + 1]
            e, f, g, h = w[y, x - 1], w[y - 1, x], w[y - 1, x - 1], w[y + 1, x - 1]
            first, second, third, fourth = min(a, e), min(b, f), min(c, g), min(d, h)
            total = (
                weights[0, i, j] * max(here - first, np.float32(0)) ** 2
                + weights[1, i, j] * max(here - second, np.float32(0)) ** 2
                + weights[2, i, j] * max(here - third, np.float32(0)) ** 2
                + weights[3, i, j] * max(here - fourth, np.float32(0)) ** 2
            )
            latest = np.float32(0.5) * lengths[0, i, j]
            latest = min(a + latest * (own + slowness[y, x + 1]), e + latest * (own + slowness[y, x - 1]))
            half = np.float32(0.5) * lengths[1, i, j]
            latest = min(latest, b + half * (own + slowness[y + 1, x]), f + half * (own + slowness[y - 1, x]))
            half = np.float32(0.5) * lengths[2, i, j]
            latest = min(latest, c + half * (own + slowness[y + 1, x + 1]), g + half * (own + slowness[y - 1, x - 1]))
            half = np.float32(0.5) * lengths[3, i, j]
            latest = min(latest, d + half * (own + slowness[y - 1, x + 1]), h + half * (own + slowness[y + 1, x - 1]))
            speed = min(np.float32(1) / max(own, np.float32(1e-4)), CFL / (ds * crossing[i, j]))
            value = min(here + ds * (np.float32(1) - speed * math.sqrt(total)), bound[i, j])
            earliest = min(bound[i, j], min(min(first, second), min(third, fourth)))
            value = max(min(value, latest), earliest)
            new[y, x] = value if inside[i, j] and here > s else here
