"""A front over a whole picture: by the chosen solver, and round its occluding contours."""

from typing import Literal, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from jaxsfs.enclosed import entries, limits_behind
from jaxsfs.implicit import solve
from jaxsfs.levelset import propagate
from jaxsfs.shading import AbstractShading, LightAtCamera
from jaxsfs.sweeping import sweep
from jaxsfs.upwind import offsets_for

Image = Float[Array, "height width"]
Mask = Bool[Array, "height width"]

_NESTED = 2  # parts behind a contour behind a contour: how deep they are followed


class Front(NamedTuple):
    """w and where the front came by; the work it took, and the mean relative change of the last round."""

    w: Image
    reached: Mask
    work: int
    change: float


def front_over(
    shading: AbstractShading,
    metric: Float[Array, "height width 2 2"],
    inside: Mask,
    contours: Mask,
    known: Image,
    *,
    solver: Literal["sweeping", "level-set"],
    order: Literal[1, 2, 3],
    steps: int | None,
) -> Front:
    """w on `inside`, nothing read across `contours`.

    Nothing reads a contour's own pixels, but they read both sides, and so have the nearer one's w. Parts of the picture
    wholly behind contours are entered as `limits_behind` says. Raises ValueError for an unknown solver, or an order
    that it does not have.
    """
    cut = inside & ~contours
    found = _run(shading, metric, cut, known, solver, order, steps)
    if not bool(jnp.any(held(contours))):
        return found
    whole = _with_contours(shading, metric, inside, known, found, order, steps)
    assert isinstance(shading, LightAtCamera), "a distant light has no contours"
    for _ in range(_NESTED):
        entering = entries(*(np.asarray(held(x)) for x in (inside, contours, found.w, whole.w)))
        if not entering.any():
            break
        limit = limits_behind(jnp.asarray(entering), contours, found.w, whole.w, shading.limit)
        behind = eqx.tree_at(lambda s: s.limit, shading, limit)
        again = _run(behind, metric, cut, known, solver, order, steps)
        # the first solution stays the far end of what is possible
        whole = _with_contours(behind, metric, inside, known, again, order, steps)
    return whole._replace(work=found.work, change=found.change)


def _with_contours(shading, metric, inside: Mask, known: Image, found: Front, order, steps: int | None) -> Front:
    known = jnp.where(found.reached, found.w, known)
    return _run(shading, metric, inside, known, "sweeping", order, steps)


def _run(shading, metric, inside: Mask, known: Image, solver: str, order, steps: int | None) -> Front:
    """w by the chosen solver."""
    if solver == "level-set":
        if order == 3:
            raise ValueError("the level set has order 1 or 2; order 3 is for solver 'sweeping'")
        start, end = _time_span(shading, metric, inside, known)
        steps = steps or _steps(inside)
        offsets = offsets_for(metric, inside)
        arrival = propagate(shading, metric, inside, known, start, end, offsets=offsets, order=order, steps=steps)
        return Front(arrival.w, arrival.reached, int(arrival.steps), 0.0)
    if solver == "sweeping":
        sweeps = solve(shading, metric, inside, known, order=order, **_stopping(known.dtype, steps))
        return Front(sweeps.w, sweeps.reached, int(held(sweeps.rounds)), float(held(sweeps.change)))
    raise ValueError(f"solver must be 'sweeping' or 'level-set', got {solver!r}")


def _time_span(shading: AbstractShading, metric, inside: Mask, known: Image):
    """First and last time of a front. Without deadlines the last one comes from a quick solution of first order."""
    due = jnp.where(inside, jnp.minimum(shading.deadline(), known), jnp.inf)
    latest = jnp.max(jnp.where(jnp.isfinite(due), due, -jnp.inf))
    if not bool(jnp.all(jnp.isfinite(due) | ~inside)):
        quick = sweep(shading, metric, inside, known, order=1)
        latest = jnp.max(jnp.where(quick.reached, quick.w, -jnp.inf)) + 0.01
    return jnp.min(due) - 1e-4, latest


def _steps(inside: Mask) -> int:
    """A front needs about one step a pixel it crosses; sources that start late cost more."""
    return 4 * max(inside.shape)


def _stopping(dtype, steps: int | None) -> dict[str, float | int | None]:
    tolerance = None if dtype == jnp.float32 else 1e-9
    return {"tolerance": tolerance, "max_rounds": steps or (40 if dtype == jnp.float32 else 80)}


def held(tree):
    """`tree` as plain values, also while it is differentiated: for what is decided and reported on the host."""
    return jax.tree.map(lambda x: jax.lax.stop_gradient(x) if isinstance(x, jax.Array) else x, tree)
