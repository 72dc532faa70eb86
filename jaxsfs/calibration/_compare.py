"""Which lens is it: all models on the same observations, by BIC and by what they predict for those left out.

BIC = n ln(RSS/n) + p ln n, smaller is better. A model with more parameters is preferred only if its BIC is lower by 10
and it also predicts left-out groups better: edges share errors of some hundredths of a pixel that flexible models fit.
"""

import dataclasses

import numpy as np
from jaxtyping import Float, Int

from jaxsfs.calibration._fit import Fit, Setup, fit, free_for, rays_of
from jaxsfs.calibration._lens import LENS_SIZE, LENSES, SHAPE, lens_named
from jaxsfs.calibration._uncertainty import left_out_steps

DECISIVE = 10.0
_LEAST_F = 1.03  # of a start, over the outermost radius used


@dataclasses.dataclass(frozen=True)
class ModelScore:
    """One lens model: its fit, rms in px over the rows that all models share, BIC, and rms of left-out groups in px."""

    name: str
    fit: Fit
    rms: float
    bic: float
    held_out: float

    def row(self) -> dict[str, float | str]:
        return {
            "model": self.name,
            "f": self.fit.f,
            "rms_px": self.rms,
            "bic": self.bic,
            "held_out_rms_px": self.held_out,
            "parameters": lens_named(self.name).shapes + 1,
        }


def compare(
    setup: Setup,
    flexible: Fit,
    groups: Int[np.ndarray, " count"],
    independent: float = 1.0,
) -> list[ModelScore]:
    """Fits every lens model to the rows that `flexible` kept, from its parameters, best BIC first. `independent`: share
    of rows that count as independent. Models whose fit fails are left out."""
    scores = []
    weight = flexible.weight
    for name in LENSES:
        begin = flexible.parameters if name == flexible.name else _start(name, flexible)
        found = fit(name, setup, begin, weight, rounds=1, noise=flexible.noise)
        if not found.success or not np.isfinite(found.residual).all():
            continue
        kept = weight > 0
        square = float(np.sum((found.standardised[kept] * found.noise) ** 2))
        count = found.residual.shape[1] * float(kept.sum())
        rms = np.sqrt(square / max(kept.sum(), 1))
        bic = independent * count * np.log(square / count) + free_for(name, setup).sum() * np.log(independent * count)
        scores.append(ModelScore(name, found, float(rms), float(bic), held_out_rms(found, groups)))
    return sorted(scores, key=lambda score: score.bic)


def _start(name: str, flexible: Fit) -> Float[np.ndarray, " size"]:
    """The parameters of `flexible` with a lens near r = f sin α: f from its rays, above the outermost radius used."""
    pixel, parameters = flexible.setup.observations.pixel[flexible.weight > 0], flexible.parameters.copy()
    radius, sine = np.hypot(*(pixel - parameters[1:3]).T), np.hypot(*rays_of(flexible, pixel)[:, :2].T)
    parameters[0] = np.log(max(np.sum(radius * sine) / np.sum(sine**2), _LEAST_F * radius.max()))
    parameters[SHAPE:LENS_SIZE] = 0.0
    shapes = lens_named(name).like_sine
    parameters[SHAPE : SHAPE + len(shapes)] = shapes
    return parameters


def held_out_rms(found: Fit, groups: Int[np.ndarray, " count"]) -> float:
    """rms in px of every group's residuals under the parameters fitted without it (robust: the median of the groups'
    mean squares)."""
    kept = found.weight > 0
    names = np.unique(groups[kept])
    steps = left_out_steps(found, groups)
    squares = []
    for name, step in zip(names, steps, strict=True):
        rows = kept & (groups == name)
        predicted = found.noise * (found.standardised[rows] + found.jacobian[rows] @ step)
        squares.append(np.mean(np.sum(predicted**2, axis=1)))
    return float(np.sqrt(np.median(squares)))


def preferred(scores: list[ModelScore]) -> ModelScore:
    """The simplest model that no richer one beats decisively."""
    levels = sorted({lens_named(score.name).shapes for score in scores})
    choice = None
    for level in levels:
        best = min((s for s in scores if lens_named(s.name).shapes == level), key=lambda s: s.bic)
        if choice is None or (best.bic < choice.bic - DECISIVE and best.held_out < 0.9 * choice.held_out):
            choice = best
    if choice is None:
        raise ValueError("no lens model could be fitted to the observations")
    return choice


def score_named(scores: list[ModelScore], model: str) -> ModelScore:
    """The score of the named model. Raises ValueError if its fit failed."""
    for score in scores:
        if score.name == model:
            return score
    known = ", ".join(score.name for score in scores)
    raise ValueError(f"the {model} lens could not be fitted to these photographs; these could: {known}")


def verdict(scores: list[ModelScore]) -> str:
    """The comparison in words."""
    choice = preferred(scores)
    formula = lens_named(choice.name).formula
    sine = next((score for score in scores if score.name == "spherical"), None)
    if sine is None:
        return f"r = f sin α could not be fitted; the lens is best described as {choice.name}, {formula}."
    if choice.name == "spherical":
        simple = [score for score in scores if not lens_named(score.name).shapes and score is not sine]
        alike = [score.name for score in simple if score.bic < sine.bic + DECISIVE]
        if alike:
            return (
                f"r = f sin α fits with rms {sine.rms:.3f} px, but so does {' and '.join(alike)}: the photographs do "
                "not tell them apart. Let the target reach further from the axis."
            )
        return f"The lens obeys r = f sin α: rms {sine.rms:.3f} px, and no richer model does decisively better."
    worse = f"rms {choice.rms:.3f} px against {sine.rms:.3f} px, BIC lower by {sine.bic - choice.bic:.0f}"
    if choice.bic > sine.bic - DECISIVE:
        return f"r = f sin α and {choice.name} fit equally well ({worse}): the photographs do not tell them apart."
    if sine.rms < 1.5 * choice.rms and sine.rms < 0.15:
        return f"r = f sin α describes the lens to {sine.rms:.3f} px; {choice.name} ({formula}) is closer: {worse}."
    return f"The lens is not r = f sin α; it is best described as {choice.name}, {formula}: {worse}."
