"""Photometry from photographs of white paper at a known pose: the standard that everyone has.

With the light at the lens a Lambertian sheet at height h and normal n has cos θ = n·d and r = h/(n·d), so

    stored = response(gain·ρ · exposure · V(α) · (n·d)³/h²).

Square-on n·d = cos α: with stored = light^(1/γ) and V = cos^μ α only (3 + μ)/γ is determined. A tilt of 10°, a second
distance or a second exposure tells response and fall-off apart; ρ is known only as gain·ρ.
"""

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np
from jaxtyping import Float, Shaped

from jaxsfs.calibration._guards import check_same_size
from jaxsfs.calibration._paper import PaperView, paper_view
from jaxsfs.calibration._plane import PlanePose
from jaxsfs.calibration._white_fit import Cells, WhiteFit, compare_models
from jaxsfs.camera import AbstractCentralCamera
from jaxsfs.photo import automatic_response, parse_channel
from jaxsfs.photometry import parse_response

_UNLIKE = (
    " These photographs were not exposed alike (their gains differ by up to {apart:.0%}): each has its own gain, and "
    "gain·ρ, which gives ranges in mm, is not known: lock the exposure, or state the exposures."
)
_NOTES = {
    "given": "The response was given; the fall-off follows from it.",
    "separated": (
        "Response and fall-off were told apart: the sheet's tilt or the photographs' distances or exposures show both."
    ),
    "held": (
        "These photographs fix only how stored values fall with the angle, (3 + μ)/γ, not response and fall-off "
        "each: the response is held ({response}) and the fall-off is right for it alone. Add a photograph tilted by "
        "10° or more, or from another distance, or with another (stated) exposure."
    ),
}


@dataclasses.dataclass(frozen=True)
class WhiteCalibration:
    """Response, fall-off and gain·ρ of a camera with its light.

    `response` and `falloff` as the camera file writes them. `gamma` of the best pure power law with its 1σ, None
    where it was given or held. `mu` of the fall-off (a + b of its two-term form: V starts as 1 − μ α²/2), 1σ.
    `gain_albedo` in mm² at relative exposure 1, None where every photograph has its own gain (automatic exposure).
    `product`: (3 + μ)/γ of a power law, which one square view fixes. `separated`: whether response and fall-off were
    told apart. `rms` in stored values (full scale 1). `alpha_deg`, `measured`: the fall-off itself, by the chosen
    response, in bins of 5°. `models`: the pairs tried, best first. `note`: what a user should know.
    """

    response: str
    falloff: str
    gamma: float | None
    gamma_sd: float | None
    mu: float
    mu_sd: float
    gain_albedo: float | None
    gain_albedo_sd: float | None
    product: float
    product_sd: float
    separated: bool
    rms: float
    cells: int
    channel: str
    alpha_deg: list[float]
    measured: list[float]
    models: list[dict[str, Any]]
    note: str

    def photometry(self) -> dict[str, Any]:
        """For a camera file's `photometry`: ranges reconstructed with it are millimetres, if `gain_albedo` is known."""
        scale = {} if self.gain_albedo is None else {"gain_albedo": self.gain_albedo, "unit": "mm"}
        return {"response": self.response, "falloff": self.falloff, **scale, "channel": self.channel}

    def figures(self) -> dict[str, Any]:
        """All figures, ready for JSON."""
        return dataclasses.asdict(self) | {"photometry": self.photometry()}


def calibrate_white(
    images: Sequence[Shaped[np.ndarray, "..."]],
    camera: AbstractCentralCamera,
    poses: Sequence[PlanePose],
    gamma: float | None = None,
    exposures: Sequence[float] | None = None,
    channel: str = "luminance",
) -> WhiteCalibration:
    """Response, fall-off and gain·ρ from white Lambertian paper at `poses` (mm), one per photograph.

    Minimises the stored values' misfit over cells of bare paper; ink, glare, clipped values and the field's rim are
    left out. Tried: the sRGB curve, linear and stored = light^(1/γ), each with V = cos^μ α, exp(−μ(1 − cos α))
    and cos^a α · exp(−b(1 − cos α)); the smallest BIC wins. `gamma` holds γ. `exposures`: relative, one per photograph;
    without them all share one gain, unless a gain for each photograph is decisively better (automatic exposure): then
    gain·ρ stays unknown.
    Where response and fall-off are not told apart the response is held: sRGB or γ = 2.2 for 8 bit, linear otherwise.
    Of colour images, all channels share the response, and `channel` (as `parse_channel` reads it) is weighted in
    linear light.

    Raises ValueError for photographs that do not fit the camera or show too little paper.
    """
    check_same_size(images)
    _check(images, poses, gamma, exposures)
    weights = np.array(parse_channel(channel), float)
    gains = np.ones(len(images)) if exposures is None else np.asarray(exposures, float)
    views = [
        paper_view(image, camera, pose, float(gain), f"photograph {i + 1}")
        for i, (image, pose, gain) in enumerate(zip(images, poses, gains, strict=True))
    ]
    held = automatic_response(str(images[0].dtype))
    # ink is told from paper in the fall of light by a first fit, which sees only what is clearly paper
    one_gain = exposures is not None
    rough = compare_models(_cells(views, weights), gamma, held, one_gain)
    views = [view.chosen_by(rough.chosen.predicted) for view in views]
    cells = _cells(views, weights)
    fits = compare_models(cells, gamma, held, one_gain)
    best = fits.chosen
    alpha, measured = _measured_falloff(best, cells)
    return WhiteCalibration(
        response=best.response_text,
        falloff=best.falloff_text,
        gamma=fits.power_law.gamma if fits.separated else None,
        gamma_sd=fits.gamma_sd if fits.separated else None,
        mu=best.mu,
        mu_sd=best.mu_sd,
        gain_albedo=None if len(best.gains) else best.gain,
        gain_albedo_sd=None if len(best.gains) else best.gain_sd,
        product=fits.power_law.product(),
        product_sd=fits.power_law.product_sd(),
        separated=fits.separated,
        rms=best.rms,
        cells=len(cells.stored),
        channel=channel,
        alpha_deg=alpha,
        measured=measured,
        models=[one.row() for one in fits.ranked],
        note=_NOTES[fits.how].format(response=best.response_text) + _exposure_note(best),
    )


def _exposure_note(fit: WhiteFit) -> str:
    if not len(fit.gains):
        return ""
    every = np.concatenate([[0.0], fit.gains])
    return _UNLIKE.format(apart=float(np.exp(np.ptp(every))) - 1)


def _cells(views: list[PaperView], weights: Float[np.ndarray, "3"]) -> Cells:
    seen = [view.cells() for view in views]
    stored, geometry, cosine = (np.concatenate(part) for part in zip(*seen, strict=True))
    photograph = np.repeat(np.arange(len(seen)), [len(one[1]) for one in seen])
    return Cells(stored, geometry, cosine, weights if stored.shape[1] == 3 else np.ones(1), photograph)


def _check(images, poses, gamma, exposures) -> None:
    if len(images) != len(poses):
        raise ValueError(f"every photograph needs a pose: {len(images)} photographs, {len(poses)} poses")
    if gamma is not None and not 0.2 <= gamma <= 5:
        raise ValueError(f"gamma must lie between 0.2 and 5, got {gamma:g}")
    if exposures is None:
        return
    if len(exposures) != len(images):
        raise ValueError(f"every photograph needs an exposure: {len(images)} photographs, {len(exposures)} exposures")
    if not all(np.isfinite(e) and e > 0 for e in exposures):
        listed = ", ".join(f"{e:g}" for e in exposures)
        raise ValueError(f"exposures are positive and relative to each other, such as 1, 0.5; got {listed}")


def _measured_falloff(fit: WhiteFit, cells: Cells) -> tuple[list[float], list[float]]:
    """Median over bins of 5° of light/(gain·geometry), V(0) being the fitted model's 1; bins of 10 cells or more."""
    light = parse_response(fit.response_text).decode(cells.stored) @ cells.weights
    value = light / (fit.gain * np.exp(cells.lifted(fit.gains)))
    alpha = np.degrees(np.arccos(np.clip(cells.cosine, -1, 1)))
    bins = [(low, (alpha >= low) & (alpha < low + 5)) for low in np.arange(0, 90, 5)]
    filled = [(float(np.median(alpha[rows])), float(np.median(value[rows]))) for _, rows in bins if rows.sum() >= 10]
    return [a for a, _ in filled], [v for _, v in filled]
