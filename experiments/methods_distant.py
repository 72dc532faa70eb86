"""The tables `distant` and `merging` of methods.py."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
from baselines import (
    horn,
    ikeuchi_horn,
    lagrangian,
    lai_vemuri,
    lee_rosenfeld,
    merging,
    pentland,
    strips,
    szeliski,
    tsai_shah,
    zheng_chellappa,
)
from baselines.distant import DistantImage, Relief
from distant_scenes import LIGHTS, DistantScene, distant_scene
from tables import pyplot, save

Method = Callable[[DistantScene, DistantImage], Relief]
FRONTAL = "(0,0,1)"


def _rim(module) -> Method:
    def method(scene: DistantScene, image: DistantImage) -> Relief:
        p, q = (np.where(scene.rim(), slope, np.nan) for slope in (scene.p, scene.q))
        return module.reconstruct(image, p, q)

    return method


def _curve(scene: DistantScene, image: DistantImage) -> Relief:
    x, y, z = scene.summits()[0]
    return lagrangian.heights(image, lagrangian.expand(image, (x, y), scene.depth()), z)


def _strips(scene: DistantScene, image: DistantImage) -> Relief:
    # under an oblique light the points that face it are other ones, and their heights are not given
    return strips.reconstruct(image, scene.summits() if image.frontal else None)


def _level_set(solver: str, order: int) -> Method:
    return lambda scene, image: merging.from_known_heights(image, scene.summits(), solver, order)


# (name, what is given, only for the frontal light (True), only for the oblique one (False) or for both, method)
METHODS: tuple[tuple[str, str, bool | None, Method], ...] = (
    ("Pentland 1984, local", "–", None, lambda _, image: pentland.local(image)),
    ("Lee & Rosenfeld 1985", "–", None, lambda _, image: lee_rosenfeld.reconstruct(image)),
    ("Pentland 1988, linear", "–", False, lambda _, image: pentland.linear(image)),
    ("Tsai & Shah 1994", "–", None, lambda _, image: tsai_shah.reconstruct(image)),
    ("Zheng & Chellappa 1991", "–", None, lambda _, image: zheng_chellappa.reconstruct(image)),
    ("Ikeuchi & Horn 1981", "rim", None, _rim(ikeuchi_horn)),
    ("Horn 1990", "rim", None, _rim(horn)),
    ("Szeliski 1991", "rim", None, _rim(szeliski)),
    ("Lai & Vemuri 1997", "rim", None, _rim(lai_vemuri)),
    ("Horn 1975, strips", "summits", None, _strips),
    ("curve expansion, eqs. 1–2", "one summit", True, _curve),
    ("Kimmel & Bruckstein 1995a, order 1", "summits", True, _level_set("level-set", 1)),
    ("Kimmel & Bruckstein 1995a, order 2", "summits", True, _level_set("level-set", 2)),
    ("jaxsfs sweeping, order 2", "summits", True, _level_set("sweeping", 2)),
)


def curve_figure(quick: bool, path: Path) -> list[dict]:
    """Where the chain of points of eqs. (1)–(2) breaks: two fronts that meet. Beside it the level set's fronts.

    Rows: descent below the summit, crossings of the chain with itself.
    """
    scene = distant_scene("peaks", 65 if quick else 129)
    image, summits = scene.image(LIGHTS[FRONTAL]), scene.summits()
    chain = lagrangian.expand(image, summits[0, :2], 0.8 * scene.depth(), steps=200)
    height = merging.from_known_heights(image, summits).height
    plt = pyplot()
    figure, axes = plt.subplots(1, 2, figsize=(11, 5.2), layout="constrained")
    shown = [20, 60, 90, 120, 160, 200]
    rows = []
    for axis in axes:
        axis.imshow(image.values, cmap="gray", vmin=0, vmax=1)
        axis.set(xticks=[], yticks=[])
    for index, step in enumerate(shown):
        curve = np.concatenate([chain.curves[step], chain.curves[step][:1]])
        crossings = lagrangian.self_intersections(chain.curves[step])
        rows.append({"descent / depth": f"{chain.times[step] / scene.depth():.2f}", "crossings": crossings})
        axes[0].plot(*curve.T, color=f"C{index}", lw=1.2, label=f"{rows[-1]['descent / depth']}: {crossings} crossings")
    axes[0].set(title="chain of points, eqs. (1)–(2), from one summit", xlim=(0, len(height) - 1),
                ylim=(len(height) - 1, 0))  # fmt: skip
    axes[0].legend(fontsize=7, title="descent / depth")
    levels = sorted(summits[0, 2] - chain.times[step] for step in shown)
    axes[1].contour(height, levels=levels, colors=[f"C{i}" for i in range(len(shown))][::-1], linewidths=1.2)
    axes[1].set(title="the same heights by the level set, from all summits")
    save(figure, path)
    return rows


def distant_errors(scene: DistantScene, relief: Relief) -> tuple[float, float, float]:
    """Mean |ΔZ|/depth after the best shift, mean angle of the normals in degrees, share of pixels with an answer."""
    known = scene.mask & np.isfinite(relief.height)
    if not known.any():
        return np.nan, np.nan, 0.0
    gap = (relief.height - scene.height)[known]
    sloped = known & np.isfinite(relief.p) & np.isfinite(relief.q)
    a, b = (_normals(one.p[sloped], one.q[sloped]) for one in (relief, scene))
    angle = np.rad2deg(np.arctan2(np.linalg.norm(np.cross(a, b), axis=-1), np.sum(a * b, axis=-1)))
    share = known.sum() / scene.mask.sum()
    return float(np.abs(gap - np.median(gap)).mean() / scene.depth()), float(angle.mean()), float(share)


def distant_table(quick: bool, timed) -> list[dict]:
    """Rows method × scene × light."""
    size, names = (33, ("vase", "sphere")) if quick else (129, ("vase", "sphere", "peaks", "ripples"))
    rows = []
    for name in names:
        scene = distant_scene(name, size)
        for light, direction in LIGHTS.items():
            image = scene.image(direction)
            for method, given, frontal, call in METHODS:
                if frontal in (None, image.frontal):
                    warm = method.startswith(("Kimmel", "jaxsfs"))
                    relief, seconds = timed(lambda call=call, scene=scene, image=image: call(scene, image), warm)
                    rows.append({"scene": name, "light": light, "method": method, "given": given}
                                | _cells(distant_errors(scene, relief), seconds))  # fmt: skip
    return rows


def merging_table(quick: bool, timed) -> list[dict]:
    """Rows scene × way of joining several singular points; frontal light."""
    size, names = (33, ("vase",)) if quick else (129, ("vase", "peaks", "ripples"))
    ways: dict[str, tuple[str, Method]] = {
        "one singular point (Kimmel & Bruckstein 1995a)":
            ("place and height of one", lambda s, i: merging.from_one(i, s.summits()[0])),
        "heights from saddles (Kimmel & Bruckstein 1995b, Shimshoni et al. 1996)":
            ("places of all", lambda s, i: merging.from_saddles(i, s.summits()[:, :2])),
        "highest of all (Oliensis & Dupuis 1994)":
            ("places and heights of all", lambda s, i: merging.from_known_heights(i, s.summits())),
    }  # fmt: skip
    rows = []
    for name in names:
        scene = distant_scene(name, size)
        image = scene.image(LIGHTS[FRONTAL])
        for way, (given, call) in ways.items():
            relief, seconds = timed(lambda call=call, scene=scene, image=image: call(scene, image), True)
            points = len(scene.summits())
            rows.append({"scene": name, "summits": points, "way": way, "given": given}
                        | _cells(distant_errors(scene, relief), seconds))  # fmt: skip
    return rows


def _cells(found: tuple[float, float, float], seconds: float) -> dict:
    height, angle, share = found
    shown = {"height": f"{height:.4f}", "normals °": f"{angle:.2f}"} if share else {"height": "–", "normals °": "–"}
    return shown | {"share of pixels": f"{share:.2f}", "cpu s": round(seconds, 3)}


def _normals(p, q):
    return np.stack([-p, -q, np.ones_like(p)], axis=-1) / np.sqrt(1 + p**2 + q**2)[..., None]
