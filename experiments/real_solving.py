"""Ways to reconstruct the photographs of `real_cases.py`, and how near the results are to the truth."""

from typing import Any, Literal, NamedTuple

import numpy as np
from real_cases import Case
from scipy.stats import spearmanr

from jaxsfs import Reconstruction, evaluate, parse_falloff, parse_reflectance, parse_response, reconstruct
from jaxsfs.photo import automatic_response, clipping_limit, parse_channel
from jaxsfs.preparation import Preparation, prepare
from jaxsfs.specular import Method


class Settings(NamedTuple):
    """What a user can choose, in the words of the command line. `response` "auto": what the stored type stands for.

    `smooth` is σ in px of the photograph's full size; `clip` None: the limit of the stored type.
    """

    name: str
    response: str = "auto"
    falloff: str = "none"
    reflectance: str = "lambertian"
    channel: str = "luminance"
    smooth: float = 0.0
    order: int = 2
    clip: float | None = None
    specular: Method = "auto"
    blood: float = 0.0
    rim: Literal["straight", "closed"] = "straight"
    occlusions: Literal["auto", "off"] = "auto"


DEFAULT = Settings("default options")
PRESET = Settings("preset", response="gamma:2.2", falloff="cos:1.6", reflectance="power:0.65")
# The prototype: even weights, first order, no contours, the rim facing the light.
PROTOTYPE = PRESET._replace(
    name="preset as prototyped", channel="1,1,1", order=1, specular="off", rim="closed", occlusions="off"
)
EVEN = Settings("even weights, sRGB, cos:1.6", response="srgb", falloff="cos:1.6", channel="1,1,1")
# Mostly red, the channel that blood in the mucosa darkens least. Weights chosen on the two sinus frames.
RED_RICH = Settings("red-rich 6:3:1, sRGB", response="srgb", channel="0.6,0.3,0.1")
# Red, corrected for blood by the optical densities of haemoglobin.
BLOOD = Settings("red, blood 0.15, sRGB", response="srgb", channel="red", blood=0.15)
# Smooth until vessels are no relief: σ of 8 px of the full size chosen on frame 4600, seen once on 4584.
SMOOTH = BLOOD._replace(name="red, blood 0.15, smooth 8, sRGB", smooth=8.0)
SHOWN = {"default": DEFAULT, "preset": PRESET, "even": EVEN, "red-rich": RED_RICH, "blood": BLOOD, "smooth": SMOOTH}
VARIANTS = (
    Settings("sRGB", response="srgb"),
    Settings("sRGB, cos:1.6", response="srgb", falloff="cos:1.6"),
    Settings("sRGB, red", response="srgb", channel="red"),
    Settings("sRGB, green", response="srgb", channel="green"),
    Settings("sRGB, blue", response="srgb", channel="blue"),
    Settings("sRGB, even weights", response="srgb", channel="1,1,1"),
    PRESET._replace(name="preset, even weights", channel="1,1,1"),
    PRESET._replace(name="preset, rim closed", rim="closed"),
    PRESET._replace(name="preset, even weights, rim closed", channel="1,1,1", rim="closed"),
    PRESET._replace(name="preset, contours off", occlusions="off"),
    PROTOTYPE,
    PRESET._replace(name="preset, smooth 4", smooth=4.0),
    PRESET._replace(name="preset, order 1", order=1),
    DEFAULT._replace(name="default, highlights left in", specular="off"),
    PRESET._replace(name="preset, highlights left in", specular="off"),
    PRESET._replace(name="preset, clipped from 0.99", clip=0.99),
)
GAMMAS = (1.8, 2.2, 2.4, 2.6, 2.8, 3.2)


def prepared(case: Case, settings: Settings) -> Preparation:
    """What a solver reads of `case.photo`."""
    response = automatic_response(case.dtype) if settings.response == "auto" else settings.response
    return prepare(
        case.photo,
        case.camera,
        valid=case.mask,
        response=parse_response(response),
        falloff=parse_falloff(settings.falloff),
        weights=parse_channel(settings.channel),
        smooth_px=settings.smooth / case.shrink,
        clip_limit=clipping_limit(case.dtype) if settings.clip is None else settings.clip,
        specular=settings.specular,
        blood=settings.blood,
    )


def solve(case: Case, settings: Settings) -> Reconstruction:
    """The surface in `case.photo`."""
    return reconstruct(
        prepared(case, settings).irradiance,
        case.camera,
        reflectance=parse_reflectance(settings.reflectance),
        order=settings.order,
        rim=settings.rim,
        occlusions=settings.occlusions,
    )


def score(case: Case, result: Reconstruction) -> dict[str, Any]:
    """Figures of a result. Relative errors are those of depth after one factor, the ratio of the medians."""
    surface = result.surface
    valid = np.asarray(surface.valid)
    estimated_range = np.where(valid, np.asarray(surface.range), np.nan).astype(float)
    estimated = np.where(valid, np.asarray(surface.depth()), np.nan).astype(float)
    if case.depth is not None:
        both = valid & np.isfinite(case.depth)
        rays = np.asarray(case.camera.rays())[..., 2]
        z, r, true_z, true_r = estimated[both], estimated_range[both], case.depth[both], (case.depth / rays)[both]
    else:
        u, v = case.pixels().T
        height, width = valid.shape
        on = (u >= 0) & (u < width) & (v >= 0) & (v < height)
        on[on] = valid[v[on], u[on]]
        z, r = estimated[v[on], u[on]], estimated_range[v[on], u[on]]
        true_z, true_r = case.points[on, 2].astype(float), np.linalg.norm(case.points[on].astype(float), axis=1)
    errors = evaluate(z[None], true_z[None], quantity="depth", align="median")
    known = case.depth.size if case.depth is not None else len(case.points)
    return {
        "spearman_depth": float(spearmanr(z, true_z).statistic),
        "spearman_range": float(spearmanr(r, true_r).statistic),
        "abs_rel": errors.abs_rel,
        "median_rel": errors.median_rel,
        "compared": len(z),
        "known": known,
        "residual": result.statistics.residual_mean,
        "status": result.status.name,
    }


def fit_gamma(case: Case, settings: Settings) -> Settings:
    """`settings` with the gamma of GAMMAS whose depth is nearest to the truth: this uses the truth of the frame."""
    tried = [settings._replace(response=f"gamma:{gamma:g}") for gamma in GAMMAS]
    best = min(tried, key=lambda one: score(case, solve(case, one))["abs_rel"])
    return best._replace(name=f"{settings.name}, {best.response} fitted to the truth")
