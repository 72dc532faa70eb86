"""B. K. P. Horn, "Obtaining shape from shading information" (1975; the thesis of 1970): characteristic strips.

Along a strip x' = R_p, y' = R_q, z' = p R_p + q R_q, p' = E_x, q' = E_y: height and slopes follow from their values
at one point. All strips start on a small ellipse round a summit, where the slopes are p = A x with A from the
isophotes (`isophotes.hessian_of_height`); R_p = −M A x there and A < 0, so they run outward by themselves. Strips
spread, cross and drift off (errors accumulate along them), which is what the level set mends.
"""

import numpy as np
from scipy.ndimage import distance_transform_edt, map_coordinates, spline_filter
from scipy.spatial import cKDTree

from baselines.distant import DistantImage, Relief, reflectance, reflectance_slopes
from baselines.isophotes import hessian_of_height, singular_points

GAP = 1.5  # px: no strip that near, no answer
TOLERANCE = 0.05  # of E: a strip whose slopes contradict the picture by more has drifted off


def reconstruct(
    image: DistantImage, summits: np.ndarray | None = None, count: int = 200, steps: int = 1000, step: float = 0.3
) -> Relief:
    """Strips from every summit (rows x, y, Z in px, px, length; found in E with height 0 if not given).

    `step` in px of arc per step. Where strips of several summits pass over a pixel, the highest Z counts, the
    surface that is seen first coming down.
    """
    if summits is None:
        summits = np.array([(x, y, 0.0) for x, y in singular_points(image)]).reshape(-1, 3)
    gradient = [spline_filter(part, order=3) for part in _gradient(image)]
    found = np.full((3, *image.mask.shape), np.nan)
    for x, y, z in summits:
        one = _on_grid(image, _run(image, gradient, (x, y), z, count, steps, step))
        better = np.isfinite(one[0]) & ~(found[0] >= one[0])
        found = np.where(better, one, found)
    return Relief(*(np.where(image.mask, part, np.nan) for part in found))


def _gradient(image):
    """E_x, E_y, continued beyond the mask by its nearest value so that splines do not ring."""
    e_y, e_x = np.gradient(np.where(image.mask, image.values, np.nan), image.spacing)
    return [_filled(part) for part in (e_x, e_y)]


def _filled(part):
    near = distance_transform_edt(~np.isfinite(part), return_distances=False, return_indices=True)
    return part[tuple(near)]


def _run(image, gradient, summit, z0, count, steps, step):
    """Samples (n, 5) x, y (px), Z, p, q of all strips of one summit."""
    pixel = (round(summit[0]), round(summit[1]))
    hessian, (x0, y0) = hessian_of_height(image, pixel)
    angles = np.linspace(0, 2 * np.pi, count, endpoint=False)
    offset = 1.5 * image.spacing * np.stack([np.cos(angles), np.sin(angles)])
    flat = -image.light[:2] / image.light[2]
    bend = hessian @ offset
    state = np.stack([
        x0 + offset[0] / image.spacing,
        y0 + offset[1] / image.spacing,
        z0 + flat @ offset + 0.5 * np.sum(offset * bend, axis=0),
        flat[0] + bend[0],
        flat[1] + bend[1],
    ])  # fmt: skip
    alive = _inside(image, state)
    samples = [np.array([[x0, y0, z0, *flat]])]
    for n in range(steps):
        if n % 3 == 0:
            samples.append(state[:, alive].T)
        before = _towards_light(image, state)
        middle = state + 0.5 * _slope(image, gradient, state, step)
        state = state + _slope(image, gradient, middle, step)
        # a strip that climbs again, seen from the light, has passed a pit and left its summit's own ground
        alive &= (_towards_light(image, state) < before) & _inside(image, state)
        alive &= np.abs(_misfit(image, state)) < TOLERANCE
        if not alive.any():
            break
        state = np.where(alive, state, samples[0].T)
    return np.concatenate(samples)


def _slope(image, gradient, state, step):
    """Change over `step` px of arc; the parameter is scaled by 1/|∇R| so that all strips advance alike."""
    x, y, _, p, q = state
    r_p, r_q = reflectance_slopes(p, q, image.light)
    e_x, e_y = (map_coordinates(part, [y, x], order=3, prefilter=False, mode="nearest") for part in gradient)
    rate = step * image.spacing / np.maximum(np.hypot(r_p, r_q), 1e-6)
    to_pixels = rate / image.spacing
    return np.stack([to_pixels * r_p, to_pixels * r_q, rate * (p * r_p + q * r_q), rate * e_x, rate * e_y])


def _towards_light(image, state):
    return image.spacing * (image.light[:2] @ state[:2]) + image.light[2] * state[2]


def _misfit(image, state):
    seen = map_coordinates(image.values, [state[1], state[0]], order=1, mode="nearest")
    return reflectance(state[3], state[4], image.light) - seen


def _inside(image, state):
    x, y = state[0], state[1]
    height, width = image.mask.shape
    ok = (x >= 0) & (y >= 0) & (x <= width - 1) & (y <= height - 1)
    u, v = np.clip(np.rint(x), 0, width - 1).astype(int), np.clip(np.rint(y), 0, height - 1).astype(int)
    return ok & image.mask[v, u] & (image.values[v, u] > 0)


def _on_grid(image, samples):
    """Z, p, q at the pixels: each strip carries a plane along, and of the samples close by the highest sheet
    counts, since strips that have drifted off run below the surface."""
    found = np.full((3, *image.mask.shape), np.nan)
    if len(samples) < 8:
        return found
    y, x = np.nonzero(image.mask)
    away, close = cKDTree(samples[:, :2]).query(np.stack([x, y], axis=1), k=8, distance_upper_bound=GAP)
    u, v, z, p, q = np.moveaxis(samples[np.where(np.isfinite(away), close, 0)], -1, 0)
    plane = z + image.spacing * (p * (x[:, None] - u) + q * (y[:, None] - v))
    plane = np.where(np.isfinite(away), plane, -np.inf)
    # samples are in order of distance: the first of those that lie on the highest sheet
    best = np.argmax(plane > plane.max(axis=1, keepdims=True) - 0.5 * image.spacing, axis=1)
    near = np.isfinite(away[:, 0])
    chosen = np.stack([part[np.arange(len(best)), best] for part in (plane, p, q)])
    found[:, y[near], x[near]] = chosen[:, near]
    return found
