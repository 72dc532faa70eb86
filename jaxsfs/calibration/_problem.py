"""The least-squares problems: parameters, priors and observations.

Parameter vector: lens (8), extra (2), then 6 per photograph: rotation (3), offset (2), ln height. `extra` is
(line width in mm, –) for rings, the ln of the two target scales for points, unused for lines.
"""

import dataclasses

import equinox as eqx
import jax
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from jaxsfs._arrays import AnyArray
from jaxsfs.calibration._lens import LENS_SIZE

EXTRA_SIZE, VIEW_SIZE = 2, 6
VIEWS_AT = LENS_SIZE + EXTRA_SIZE


@dataclasses.dataclass(frozen=True)
class Rows:
    """Image points of a target, one per row.

    `pixel`: measured (u, v). `target`: (X, Y) in mm for points; (radius of the printed ring in mm, 0) for rings;
    unused for lines. `polarity`: for ring edges +1 where dark lies inside, −1 where it lies outside. `shift`: px by
    which the seen edge lies further from the dark side than the printed one. `group`: index of the photograph, for
    lines index of the line.
    """

    pixel: Float[np.ndarray, "count 2"]
    target: Float[np.ndarray, "count 2"]
    polarity: Float[np.ndarray, " count"]
    shift: Float[np.ndarray, " count"]
    group: Int[np.ndarray, " count"]


class Observations(eqx.Module):
    """`Rows` with weights, seen through lens profile number `build`. `kind` is "points", "rings" or "lines"; `groups`
    bounds `group` (lines only)."""

    pixel: Float[AnyArray, "count 2"]
    target: Float[AnyArray, "count 2"]
    polarity: Float[AnyArray, " count"]
    shift: Float[AnyArray, " count"]
    group: Int[AnyArray, " count"]
    weight: Float[AnyArray, " count"]
    build: int | Int[Array, ""]
    kind: str = eqx.field(static=True)
    groups: int = eqx.field(static=True)


class Problem(eqx.Module):
    """Everything that one solve reads. `metric`, in px per unit of the misfit, is held (see `residuals`).
    `prior` and `prior_weight` (1/σ, 0 for none) hold parameters softly; those not `free` keep their start."""

    observations: Observations
    metric: Float[Array, "count ..."]
    free: Bool[Array, " size"]
    prior: Float[Array, " size"]
    prior_weight: Float[Array, " size"]


def weighted(rows: Rows, weight: Float[np.ndarray, " count"], build: int, kind: str, groups: int) -> Observations:
    """The rows on the host."""
    return Observations(rows.pixel, rows.target, rows.polarity, rows.shift, rows.group, weight, build, kind, groups)


def padded(
    observations: Observations, metric: Float[np.ndarray, "count ..."], size: int
) -> tuple[Observations, Float[Array, "size ..."]]:
    """Both on the device with padding of weight 0 up to `size` rows (copies of the first row, so every value is
    sane)."""
    count = len(observations.weight)
    index = np.concatenate([np.arange(count), np.zeros(size - count, int)])
    real = np.arange(size) < count

    def pad(leaf):
        return leaf[index] if isinstance(leaf, np.ndarray) else np.asarray(leaf)

    taken, metric = jax.tree.map(pad, (observations, metric))
    taken = eqx.tree_at(lambda o: o.weight, taken, taken.weight * real)
    return jax.device_put((taken, metric))
