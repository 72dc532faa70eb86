"""Arrival times of a given speed: from an initial curve over a smooth and a rough speed, and from a point source.

Smooth: T is chosen, F = 1/|∇T|. Rough: a checkerboard of two speeds; the truth is our own second-order solution on a
grid four times finer, so its errors compare, they do not certify. Point: F grows linearly, T is known in closed form.
"""

import jax
import jax.numpy as jnp
import measure
import numpy as np

from jaxsfs.arrival import arrival_from_point, arrival_times

GRADIENT = np.array([0.7, 0.4])
CENTRE = np.array([0.45, 0.55])


def rows(size: int, repetitions: int) -> list[dict]:
    """The three problems at one size."""
    grid = np.arange(size) / (size - 1)
    x, y = np.meshgrid(grid, grid)
    return [
        *_from_curve("arrival, curve, smooth speed", size, *_smooth(x, y), repetitions),
        *_from_curve("arrival, curve, rough speed", size, *_rough(size), repetitions),
        *_from_point(size, x, y, repetitions),
    ]


def _smooth(x, y):
    """(φ, F, T): φ and T are the same, their zero is the curve."""
    dx, dy = x - CENTRE[0], y - CENTRE[1]
    radius = np.maximum(np.hypot(dx, dy), 1e-9)
    time = radius - 0.12 + 0.05 * np.sin(4 * x) * np.cos(3 * y)
    slope_x = dx / radius + 0.2 * np.cos(4 * x) * np.cos(3 * y)
    slope_y = dy / radius - 0.15 * np.sin(4 * x) * np.sin(3 * y)
    return time, 1 / np.maximum(np.hypot(slope_x, slope_y), 0.1), time


def _rough(size, finer: int = 4):
    def speed_and_distance(n):
        grid = (np.arange(n) + 0.5) / n
        x, y = np.meshgrid(grid, grid)
        return np.where((x * 8 % 2 < 1) ^ (y * 8 % 2 < 1), 0.6, 1.4), np.hypot(x - CENTRE[0], y - CENTRE[1]) - 0.12

    fine, distance = speed_and_distance(finer * size)
    fine_known = np.where(distance <= 2.5 / len(fine), distance / fine, np.inf)
    truth = arrival_times(jnp.asarray(fine, jnp.float32), jnp.asarray(fine_known, jnp.float32), spacing=1 / len(fine))
    truth = np.asarray(truth.time).reshape(size, finer, size, finer).mean((1, 3))
    speed, distance = speed_and_distance(size)
    return distance, speed, np.where(distance > 0, truth, distance / speed)


def _from_curve(title, size, phi, speed, truth, repetitions):
    spacing = 1 / (size - 1) if "smooth" in title else 1 / size
    known = np.where(phi <= 2.5 * spacing, truth, np.inf)
    outside = phi > 0

    def error(time):
        return float(np.abs(np.asarray(time, float) - truth)[outside].mean())

    f, k = jnp.asarray(speed, jnp.float32), jnp.asarray(known, jnp.float32)
    skfmm, missing = measure.peer("skfmm", "scikit-fmm")
    found = []
    for order in (1, 2):
        programs = [
            measure.Program(
                f"jaxsfs, order {order}",
                lambda order=order: jax.block_until_ready(arrival_times(f, k, spacing=spacing, order=order)).time,
                error,
                note=measure.by(),
            ),
            measure.Program(
                "the same by XLA alone",
                lambda order=order: (
                    jax.block_until_ready(arrival_times(f, k, spacing=spacing, order=order, updates="rows")).time
                ),
                error,
            ),
            missing
            or measure.Program(
                f"scikit-fmm, order {order}",
                lambda order=order: skfmm.travel_time(phi, speed, dx=spacing, order=order),
                error,
            ),
        ]
        found += measure.compare(title, size, programs, repetitions)
    return found


def _from_point(size, x, y, repetitions):
    """T = arcosh(1 + |g|²|x − x_s|²/(2 F F_s))/|g| for F = 1 + g·x."""
    spacing = 1 / (size - 1)
    u, v = size // 3, size // 4
    speed = 1 + GRADIENT[0] * x + GRADIENT[1] * y
    square = (x - x[v, u]) ** 2 + (y - y[v, u]) ** 2
    steepness = np.sqrt(GRADIENT @ GRADIENT)
    truth = np.arccosh(1 + steepness**2 * square / (2 * speed * speed[v, u])) / steepness

    def error(time):
        return float(np.abs(np.asarray(time, float) - truth).mean())

    def ours(dtype, order, updates=None):
        f, more = jnp.asarray(speed, dtype), {"spacing": spacing, "order": order, "updates": updates}
        return lambda: jax.block_until_ready(arrival_from_point(f, (u, v), **more)).time

    with jax.enable_x64(True):
        double = jnp.asarray(speed, jnp.float64)

    def ours_double():
        with jax.enable_x64(True):
            return jax.block_until_ready(arrival_from_point(double, (u, v), spacing=spacing)).time

    first = [measure.Program("jaxsfs, order 1", ours(jnp.float32, 1), error, note=measure.by("factored"))]
    second = [
        measure.Program("jaxsfs, order 2", ours(jnp.float32, 2), error, note=measure.by("factored")),
        measure.Program("the same by XLA alone", ours(jnp.float32, 2, "rows"), error),
        measure.Program("jaxsfs, order 2, float64", ours_double, error, note="factored"),
    ]
    for order, programs in ((1, first), (2, second)):
        programs += _point_peers(order, speed, spacing, (u, v), error)
    return [
        *measure.compare("arrival, point, order 1", size, first, repetitions),
        *measure.compare("arrival, point, order 2", size, second, repetitions),
    ]


def _point_peers(order, speed, spacing, source, error):
    u, v = source
    size = len(speed)
    eikonalfm, no_eikonalfm = measure.peer("eikonalfm")
    skfmm, no_skfmm = measure.peer("skfmm", "scikit-fmm")
    pyekfmm, no_pyekfmm = measure.peer("pyekfmm")
    fteikpy, no_fteikpy = measure.peer("fteikpy")
    phi = np.ones_like(speed)
    phi[v, u] = -1

    def factored():
        tau = eikonalfm.factored_fast_marching(speed, (v, u), (spacing, spacing), order)
        return tau * eikonalfm.distance(speed.shape, (spacing, spacing), (v, u), indexing="ij")

    def ekfmm():
        axis = [0, spacing, size]
        where = np.array([v * spacing, u * spacing, 0.0])
        return pyekfmm.eikonal(speed[..., None], where, axis, axis, [0, 0.01, 1], order).reshape(size, size, order="F")

    def fteik():
        cells = (speed[1:, 1:] + speed[:-1, 1:] + speed[1:, :-1] + speed[:-1, :-1]) / 4
        solver = fteikpy.Eikonal2D(cells, (spacing, spacing))
        return solver.solve([v * spacing, u * spacing]).grid

    programs = [
        no_eikonalfm or measure.Program(f"eikonalfm factored, order {order}", factored, error, note="float64"),
        no_pyekfmm or measure.Program(f"pyekfmm, order {order}", ekfmm, error, note="float32"),
        no_skfmm
        or measure.Program(
            f"scikit-fmm, order {order}", lambda: skfmm.travel_time(phi, speed, dx=spacing, order=order), error
        ),
    ]
    if order == 1:
        programs.append(no_fteikpy or measure.Program("fteikpy", fteik, error, note="float64, numba"))
    return programs
