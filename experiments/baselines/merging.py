"""The level set from singular points, and what each way of joining several adds (frontal distant light).

`from_one`: R. Kimmel & A. M. Bruckstein, "Tracking level sets by level sets", CVIU 62 (1995a) 47–58: heights grow
away from one summit; right as far as that summit's own ground goes. `from_known_heights`: J. Oliensis & P. Dupuis,
"A global algorithm for shape from shading" (1994): all summits with their heights, the highest of the local
solutions at each pixel. `from_saddles`: R. Kimmel & A. M. Bruckstein, "Global shape from shading", CVIU 62 (1995b)
360–369, and I. Shimshoni, R. Kimmel & A. M. Bruckstein (1996): heights of the summits are not given; two local
solutions of a smooth surface meet for the first time at a saddle, so h_i − d_i = h_j − d_j there, d the descent from
each summit, and the chain of such saddles of least descent fixes all heights but one. This last one is our reading
of the principle, not their program.
"""

import jax.numpy as jnp
import numpy as np

from baselines.distant import DistantImage, Grid, Relief
from jaxsfs import Irradiance, Orthographic, SummitHeights, reconstruct


def from_known_heights(image: DistantImage, summits: np.ndarray, solver: str = "level-set", order: int = 2) -> Relief:
    """`summits`: rows (x, y, Z) in px, px, length. Solved by jaxsfs; z = −Z."""
    height, width = image.mask.shape
    camera = Orthographic(1 / image.spacing, (width - 1) / 2, (height - 1) / 2, width, height)
    values = jnp.asarray(np.where(image.mask, np.clip(image.values, 0, 1), 0), jnp.float32)
    points = jnp.asarray(summits * [1, 1, -1], jnp.float32)
    work = {"steps": 12 * max(height, width)} if solver == "level-set" else {}
    found = reconstruct(
        Irradiance(values, jnp.asarray(image.mask)),
        camera,
        light="distant",
        solver=solver,  # pyright: ignore[reportArgumentType]
        order=order,  # pyright: ignore[reportArgumentType]
        initial=SummitHeights(points),
        **work,
    ).surface
    reached = np.asarray(found.valid)
    z = np.where(reached, -np.asarray(found.range, float), 0)
    grid = Grid(reached, image.spacing)
    p, q = grid.slopes(grid.vector(z))
    return Relief(np.where(reached, z, np.nan), grid.image(p), grid.image(q))


def from_one(image: DistantImage, summit: np.ndarray, solver: str = "level-set", order: int = 2) -> Relief:
    """`summit`: (x, y, Z)."""
    return from_known_heights(image, np.asarray(summit)[None], solver, order)


def from_saddles(image: DistantImage, places: np.ndarray, solver: str = "sweeping", order: int = 2) -> Relief:
    """`places`: rows (x, y) of the summits; the first one gets height 0."""
    count = len(places)
    lone = np.concatenate([places, np.zeros((count, 1))], axis=1)
    descents = [np.nan_to_num(-from_one(image, row, solver, order).height, nan=np.inf) for row in lone]
    heights = np.full(count, np.nan)
    heights[0] = 0.0
    meeting = {}
    for i in range(count):
        for j in range(i):
            y, x = _saddle(image.values, descents[i], descents[j])
            meeting[i, j] = (float(descents[i][y, x]), float(descents[j][y, x]))
    while np.isnan(heights).any():
        open_pairs = [(sum(d), pair) for pair, d in meeting.items() if np.isnan(heights[list(pair)]).sum() == 1]
        _, (i, j) = min(open_pairs)
        d_i, d_j = meeting[i, j]
        if np.isnan(heights[i]):
            heights[i] = heights[j] - d_j + d_i
        else:
            heights[j] = heights[i] - d_i + d_j
    return from_known_heights(image, np.concatenate([places, heights[:, None]], axis=1), solver, order)


def _saddle(values, first, second):
    """(y, x) of the flattest pixel on the path of least descent between two summits, clear of both."""
    total = np.where(np.isfinite(first + second), first + second, np.inf)
    shortest = np.min(total)
    on_path = (total <= 1.02 * shortest + 1e-9) & (np.minimum(first, second) > 0.1 * shortest)
    return np.unravel_index(np.argmax(np.where(on_path, values, -np.inf)), values.shape)
