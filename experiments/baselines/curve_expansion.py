"""The level set of the paper and of Okatani & Deguchi (1997), step by step as the text has it.

φ > 0 behind the front. First-order Osher & Sethian (1988) differences, an Euler step of fixed Δt; a pixel whose φ
changes sign in step n gets the range t = t₀ + n Δt; iteration ends when every pixel has one. What the text leaves
open is decided here: signed differences in the cross term are those of the upwind choice; the speed, which is
infinite where the front faces the light, is cut at half a pixel per step. No re-initialisation, no deadline, no
interpolation of the crossing: those are not in the paper.

* `spherical`: last equation of Section 5, by eqs. (14) and (16)–(18) with z_pi = 1.
* `perspective`: eq. (6), for Lambertian surfaces or another G (Okatani & Deguchi's non-Lambertian case).
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np


class Start(NamedTuple):
    """Initial function φ and the range of the curve φ = 0."""

    phi: np.ndarray
    range: float


def cone(e: np.ndarray, mask: np.ndarray, radius: float = 2.0) -> Start:
    """A cone about the brightest pixel, which is taken to face the light: E = 1/r² there."""
    v, u = np.unravel_index(np.argmax(np.where(mask, e, -np.inf)), e.shape)
    rows, columns = np.indices(e.shape)
    return Start(radius - np.hypot(columns - u, rows - v), float(e[v, u] ** -0.5))


def threshold(e: np.ndarray, mask: np.ndarray, share: float = 0.97) -> Start:
    """The curve at which E falls to `share` of its maximum (its 99.9th percentile); inside it faces the light."""
    level = share * np.percentile(e[mask], 99.9)
    shape = np.where(mask, e / level - 1, -1)
    return Start(np.clip(20 * shape, -5, 5), float(level**-0.5))


def identity(c):
    return c


def spherical(
    e: np.ndarray, mask: np.ndarray, f: float, centre: tuple[float, float], start: Start, steps: int = 1500
) -> np.ndarray:
    """Range by the paper's method; `e` normalised so that E = cos θ/r². NaN where no front came in time."""
    v, u = np.indices(e.shape)
    u, v = u - centre[0], v - centre[1]
    axial = np.sqrt(np.maximum(f**2 - u**2 - v**2, 1e-6 * f**2))
    x, y = u / axial, v / axial  # eq. (14)
    length = np.sqrt(1 + x**2 + y**2)
    u_x, v_y = f / length - x**2 * f / length**3, f / length - y**2 * f / length**3  # eq. (18)
    u_y = v_x = -x * y * f / length**3

    def gradient(phi_u, phi_v):
        phi_x, phi_y = u_x * phi_u + v_x * phi_v, u_y * phi_u + v_y * phi_v  # eq. (17)
        bracket = (x**2 + 1) * phi_x**2 + 2 * x * y * phi_x * phi_y + (y**2 + 1) * phi_y**2
        return np.sqrt(np.maximum((x**2 + y**2 + 1) * bracket, 0))

    return expand(e, mask, start, gradient, steps=steps)


def perspective(
    e: np.ndarray,
    mask: np.ndarray,
    focal_length: float,
    centre: tuple[float, float],
    start: Start,
    steps: int = 1500,
    inverse: Callable[[np.ndarray], np.ndarray] = identity,
) -> np.ndarray:
    """Range by eq. (6); `inverse` is G⁻¹."""
    v, u = np.indices(e.shape)
    x, y, z = u - centre[0], v - centre[1], focal_length

    def gradient(phi_x, phi_y):
        bracket = (x**2 + z**2) * phi_x**2 + 2 * x * y * phi_x * phi_y + (y**2 + z**2) * phi_y**2
        return np.sqrt(np.maximum((x**2 + y**2 + z**2) * bracket, 0)) / z

    return expand(e, mask, start, gradient, steps=steps, inverse=inverse)


def expand(e, mask, start: Start, gradient, *, steps: int, inverse=identity) -> np.ndarray:
    """φ ← φ + Δt F H(φ), F = c/(t √(1 − c²)), c = G⁻¹(t² E); Δt so that the darkest pixel's own range is the end."""
    end = float(np.max(e[mask & (e > 0)] ** -0.5)) if start.range > 0 else start.range
    dt = (1.02 * end - start.range) / steps
    unit = np.ones_like(e)
    fastest = 0.5 / (dt * np.maximum(gradient(unit, 0 * unit) + gradient(0 * unit, unit), 1e-12))
    phi, result = start.phi.copy(), np.where(mask & (start.phi > 0), start.range, np.nan)
    for n in range(1, steps + 1):
        t = start.range + (n - 1) * dt
        c = np.clip(inverse(np.clip(t**2 * e, 0, 1)), 0, 1)
        speed = np.minimum(c / (t * np.sqrt(np.maximum(1 - c**2, 1e-12))), fastest)
        new = phi + dt * np.where(mask, speed * gradient(*upwind(phi, mask)), 0)
        crossed = mask & (phi <= 0) & (new > 0) & np.isnan(result)
        result[crossed] = start.range + n * dt
        phi = new
        if not (mask & np.isnan(result)).any():
            break
    return result


def upwind(phi: np.ndarray, mask: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The one-sided differences towards larger φ, the larger of the two, 0 at a local maximum; none across the mask."""
    parts = []
    for axis in (1, 0):
        step = np.diff(phi, axis=axis)
        ahead, behind = [slice(None)] * 2, [slice(None)] * 2
        ahead[axis], behind[axis] = slice(1, None), slice(None, -1)
        both = mask[tuple(ahead)] & mask[tuple(behind)]
        step = np.where(both, step, 0)
        pad = [(0, 0), (0, 0)]
        pad[axis] = (0, 1)
        forward = np.maximum(np.pad(step, pad), 0)
        pad[axis] = (1, 0)
        backward = np.minimum(np.pad(step, pad), 0)
        parts.append(np.where(forward >= -backward, forward, backward))
    return parts[0], parts[1]
