"""Whether the sweeps of a video's frame should start from the frame before.

    python experiments/warm_start.py --out out/warm_start
    python experiments/warm_start.py --quick

Two frames of a moving scope, the second solved to the end from scratch (the reference), and by a few rounds from three
starts: every pixel's deadline, as `reconstruct` does it; the solution before, each pixel still following the neighbour
that set it, second order from the first round on; and that solution times the largest change of any deadline,
e^max|Δ bound|, which by the comparison principle lies above the new solution everywhere, as a start must. Columns: mean
and 99.9th percentile of the relative error of range against the reference, and CPU milliseconds. The loop is that of
`jaxsfs.sweeping.sweep` with a start. Prints a Markdown table and writes it with the command that made it.
"""

import time
from functools import partial
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
from tables import main, write_tables

from data_synth import FoldedColon, WavyWall, default_camera, take_photo
from data_synth.viewing import observe
from jaxsfs import Lambertian, SRGBResponse
from jaxsfs.photo import irradiance_of
from jaxsfs.shading import LightAtCamera, light_at_camera
from jaxsfs.sweeping import _HUGE, _directional_sweep, _Frame, power_for

SCENES = {
    "colon": (FoldedColon(first=1.3, x0=0.15), FoldedColon(first=1.325, x0=0.144)),
    "wavy wall": (WavyWall(1.3, 0.03, 11.0), WavyWall(1.319, 0.0306, 11.1)),
}


@partial(jax.jit, static_argnames="most")
def swept(shading: LightAtCamera, metric, inside, start, owner, follows, most: int):
    """v, which sweep set each pixel, and rounds, from `start`; `follows`: it is a solution of second order already."""
    power = power_for(shading, 2)
    top = jnp.minimum(jnp.where(inside, shading.lift(shading.deadline(), power), _HUGE), _HUGE)
    frame = _Frame(metric[..., 0, 0], metric[..., 0, 1], metric[..., 1, 1], top, inside)
    frames = (frame, frame.transposed())
    balance = shading.quadratic_balance()
    extent = sum(top.shape) / jnp.sqrt(jnp.max(jnp.where(inside, frame.g11, 0)))

    def one_round(v, owner, second, frozen):
        for axis in (0, 1):
            vt, ot, bt = (v, owner, balance) if axis == 0 else jax.tree.map(jnp.transpose, (v, owner, balance))
            for forward in (True, False):
                label = jnp.int8(2 * axis + forward)
                vt, ot = _directional_sweep(vt, ot, bt, frames[axis], jnp.asarray(forward), label, second, frozen)
            v, owner = (vt, ot) if axis == 0 else (vt.T, ot.T)
        return v, owner

    def body(state):
        v, owner, rounds, _, settled = state
        second = rounds > settled
        new, owner = one_round(v, owner, second, second & (rounds > settled + 3))
        change = jnp.mean(jnp.abs(new - v) / jnp.maximum(jnp.abs(new), extent), where=inside)
        return new, owner, rounds + 1, change, jnp.where(change < 1e-2, jnp.minimum(settled, rounds), settled)

    def proceed(state):
        _, _, rounds, change, settled = state
        return (rounds < most) & ~((change < 1e-6) & (rounds > settled + 1))

    v = jnp.where(inside, jnp.where(owner < 0, jnp.minimum(jnp.where(follows, top, start), top), start), _HUGE)
    first = (jnp.minimum(v, top), owner, jnp.int32(0), jnp.float32(jnp.inf), jnp.where(follows, -1, most))
    v, owner, rounds, _, _ = jax.lax.while_loop(proceed, body, first)
    return v, owner, rounds


def shadings(name: str, size: int) -> tuple[list[LightAtCamera], jax.Array, jax.Array]:
    """Of both frames; metric and mask."""
    camera = default_camera(SCENES[name][0], size, size)
    views = [observe(scene, camera, half_field_deg=50.0) for scene in SCENES[name]]
    inside = views[0].surface.valid & views[1].surface.valid
    found = []
    for seed, view in enumerate(views):
        stored = take_photo(view, read_noise=0.002, seed=seed).stored / 255.0
        seen, _ = irradiance_of(stored, camera, valid=np.asarray(inside), response=SRGBResponse())
        inside &= seen.valid
        found.append(light_at_camera(jnp.asarray(seen.values, jnp.float32), inside, 1.0, Lambertian()))
    return found, camera.inverse_metrics(jnp.float32), inside


def rows(name: str, size: int, rounds: tuple[int, ...]) -> list[dict[str, str]]:
    """Each start after each number of rounds."""
    (before, now), metric, inside = shadings(name, size)
    fresh = jnp.full(inside.shape, -1, jnp.int8)
    nothing = jnp.full(inside.shape, _HUGE, jnp.float32)
    power, mask = power_for(now, 2), np.asarray(inside)

    def ranges(shading, v):
        return np.exp(np.asarray(shading.lower(jnp.where(inside, v, 1), power)))[mask]

    truth = ranges(now, swept(now, metric, inside, nothing, fresh, False, 60)[0])
    old, owner, _ = swept(before, metric, inside, nothing, fresh, False, 5)
    raise_by = float(jnp.max(jnp.where(inside, jnp.abs(now.deadline() - before.deadline()), 0)))
    lowered = before.lower(jnp.where(inside, old, 1), power)
    above = now.lift(lowered + raise_by, power)
    starts = {"deadlines": (nothing, fresh, False), "frame before": (old, owner, True),
              f"frame before, times {np.exp(raise_by):.2f}": (above, fresh, False)}  # fmt: skip
    found = []
    for start, given in starts.items():
        for most in rounds:
            v, _, _ = jax.block_until_ready(swept(now, metric, inside, *given, most))
            clock = time.process_time()
            jax.block_until_ready(swept(now, metric, inside, *given, most))
            cpu = 1000 * (time.process_time() - clock)
            error = np.abs(ranges(now, v) / truth - 1)
            figures = (f"{error.mean():.1e}", f"{np.percentile(error, 99.9):.1e}", f"{cpu:.0f}")
            columns = ("scene", "start", "rounds at most", "mean", "99.9 %", "CPU ms")
            found.append(dict(zip(columns, (name, start, str(most), *figures), strict=True)))
    return found


def run(out: Path, quick: bool) -> None:
    """Both scenes."""
    made = [row for name in SCENES for row in rows(name, 65 if quick else 512, (2,) if quick else (2, 4, 5))]
    print(write_tables(out, "warm_start", {"error against the settled solution": made}))


if __name__ == "__main__":
    main(__doc__ or "", run, "warm_start")
