"""The order-1 level-set scheme of `jaxsfs.levelset` in plain NumPy: the peer that the benchmark compares with.

Same equation, same stencil, same step lengths; written as NumPy should be: buffers are made once, every operation
writes in place, what does not change is computed before the loop, and shifted images are views of padded ones.
"""

import numpy as np

MIN_COSINE = np.float32(0.01)
CFL = np.float32(0.9)
FAR = np.float32(100)  # later than any arrival
RING = ((1, 0), (0, 1), (1, 1), (1, -1), (-1, 0), (0, -1), (-1, -1), (-1, 1))


def propagate(
    bound: np.ndarray,
    inverse_metric: np.ndarray,
    weights: np.ndarray,
    offsets: tuple[tuple[int, int], ...],
    inside: np.ndarray,
    start: float,
    end: float,
    steps: int,
) -> tuple[np.ndarray, np.ndarray]:
    """w = ln r where the front came by, and where that is, after `steps` steps from `start` to `end`.

    A Lambertian surface under a light at the camera: `bound` (height, width) is the w of a pixel that faces the
    light, `weights` (offsets, height, width) the Selling weights of `inverse_metric` (height, width, 2, 2). All are
    float32.
    """
    shape = bound.shape
    reach = max(max(abs(du), abs(dv)) for du, dv in offsets)
    phi_at = _padded(shape, reach, -2 * FAR)
    time_at = _padded(shape, 1, 2 * FAR)
    slow_at = _padded(shape, 1, 0)
    phi, times, slowness = phi_at((0, 0)), time_at((0, 0)), slow_at((0, 0))
    phi_pairs = [(phi_at((du, dv)), phi_at((-du, -dv))) for du, dv in offsets]
    ring = [(time_at(offset), slow_at(offset)) for offset in RING]
    half_lengths = 0.5 * _ring_lengths(np.where(inside[..., None, None], inverse_metric, np.eye(2, dtype=np.float32)))
    crossing = np.sqrt(weights.sum(axis=0))
    rim = CFL / crossing.max() ** 2
    due = np.where(inside, np.minimum(bound, end + FAR), end + FAR)
    bound, crossing = np.where(inside, bound, due), np.where(inside, crossing, 1)  # nothing overflows outside
    w, reached = due.copy(), np.zeros(shape, bool)
    speed, rate, gradient, new, earliest, work = (np.empty(shape, np.float32) for _ in range(6))
    waiting, active, flags = (np.empty(shape, bool) for _ in range(3))
    s, end = np.float32(start), np.float32(end)

    for n in range(steps):
        np.greater(inside, reached, out=waiting)

        # F = c/√(1 − c²), c = e^{2(w − bound)}
        np.subtract(w, bound, out=work)
        work *= 2
        np.exp(work, out=work)
        np.clip(work, MIN_COSINE, 1, out=work)
        np.multiply(work, work, out=speed)
        np.subtract(1, speed, out=speed)
        np.maximum(speed, 1e-8, out=speed)
        np.sqrt(speed, out=speed)
        np.divide(work, speed, out=speed)

        # the time in which the fastest part of the active front crosses most of a pixel
        np.minimum(speed, crossing, out=rate)
        rate *= crossing
        np.subtract(w, s, out=work)
        work *= rate
        np.less(work, 2, out=active)
        active &= waiting
        fastest = rate.max(where=active, initial=0)
        np.greater(waiting, active, out=flags)
        event = min(w.min(where=flags, initial=np.inf), end) - s + rim
        least = (end - s) * (1 if n == steps - 1 else max(n / steps, 0.1) / (steps - n))
        ds = np.float32(max(min(CFL / max(fastest, 1e-6), event), least)) if waiting.any() else np.float32(0)

        # |∇φ|, φ = s − w: the steeper of both one-sided differences along every offset
        np.subtract(s, w, out=phi)  # outside, w is so late that nothing flows in
        gradient.fill(0)
        for (ahead, behind), weight in zip(phi_pairs, weights, strict=True):
            np.maximum(ahead, behind, out=work)
            work -= phi
            np.maximum(work, 0, out=work)
            work *= work
            work *= weight
            gradient += work
        np.sqrt(gradient, out=gradient)

        # w + ds (1 − F |∇φ|), no faster than the scheme can carry
        np.divide(CFL / ds if ds > 0 else 1, crossing, out=rate)
        np.minimum(speed, rate, out=rate)
        rate *= gradient
        np.subtract(1, rate, out=new)
        new *= ds
        new += w
        np.minimum(new, due, out=new)

        # within what causality allows: not before the earliest neighbour (unless the pixel is a source itself), and
        # no later than along a straight path from any of them
        np.divide(1, speed, out=slowness)
        np.copyto(times, w)
        np.copyto(earliest, due)
        for k, (time, slow) in enumerate(ring):
            np.minimum(earliest, time, out=earliest)
            np.add(slowness, slow, out=work)
            work *= half_lengths[k % 4]
            work += time
            np.minimum(new, work, out=new)
        np.maximum(new, earliest, out=new)

        np.copyto(w, new, where=waiting)
        s += ds
        np.less_equal(w, s, out=flags)
        flags &= waiting
        reached |= flags
    return w, reached


def _padded(shape, reach, value):
    """The windows of an image with a border of `value`: `at((du, dv))` is the image shifted by that offset."""
    field = np.full((shape[0] + 2 * reach, shape[1] + 2 * reach), value, np.float32)

    def at(offset):
        du, dv = offset
        return field[reach + dv : reach + dv + shape[0], reach + du : reach + du + shape[1]]

    return at


def _ring_lengths(g):
    """Length of the first four offsets of RING in the metric, from its inverse."""
    determinant = g[..., 0, 0] * g[..., 1, 1] - g[..., 0, 1] ** 2
    squares = [g[..., 1, 1] * du**2 - 2 * g[..., 0, 1] * du * dv + g[..., 0, 0] * dv**2 for du, dv in RING[:4]]
    return np.sqrt(np.stack(squares) / determinant)
