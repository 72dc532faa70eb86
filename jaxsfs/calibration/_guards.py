"""Checks before a calibration and warnings after it."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Bool, Float, Shaped

from jaxsfs.calibration._compare import ModelScore, preferred
from jaxsfs.calibration._fit import Fit
from jaxsfs.calibration._problem import VIEW_SIZE, VIEWS_AT
from jaxsfs.calibration._result import ViewResult, alpha_max_deg
from jaxsfs.calibration._uncertainty import used_radius

NARROW_DEG = 30.0
# Of 67 synthetic photographs of 640 x 480 px with many glares, cut rings, blur and noise, or read with wrong radii:
# good results (f within 0.5 %) with the right radii had matched 85 % or more; two that were 31 and 41 % off, 79, 73 %.
FEW_MATCHED = 0.82


def check_radii(radii: Sequence[float]) -> Float[np.ndarray, " count"]:
    """The radii as an array. Raises ValueError unless there are two or more, positive and increasing."""
    values = np.asarray(radii, float)
    listed = " ".join(f"{value:g}" for value in values)
    if len(values) < 2:
        raise ValueError(
            f"at least two rings are needed (f and the height are two unknowns), got radii: {listed or 'none'}. "
            "List every printed radius in mm, e.g. --radii 5 10 15 20 25 30"
        )
    if not np.isfinite(values).all() or (values <= 0).any() or (np.diff(values) <= 0).any():
        raise ValueError(f"radii must be positive and increasing, in mm from the centre; got {listed}")
    return values


def check_height(height: float | None, radii: Float[np.ndarray, " count"], tolerance: float) -> None:
    """Raises ValueError for a height whose angles to the rings no lens sees (a wrong unit, mostly)."""
    if not 0 < tolerance < 1:
        raise ValueError(f"height tolerance is relative and lies between 0 and 1 (0.02 is 2 %), got {tolerance:g}")
    if height is None:
        return
    if not np.isfinite(height) or height <= 0:
        raise ValueError(f"height must be a positive distance in mm, got {height:g}")
    widest, narrowest = np.degrees(np.arctan2(radii[-1], height)), np.degrees(np.arctan2(radii[0], height))
    if widest < 5 or narrowest > 80:
        raise ValueError(
            f"a height of {height:g} mm puts the rings of {radii[0]:g} to {radii[-1]:g} mm at {narrowest:.1f} to "
            f"{widest:.1f} degrees from the axis: is the height in mm, like the radii?"
        )


def check_count(what: str, count: int) -> None:
    """Raises ValueError for fewer than two columns or rows."""
    if count < 2:
        raise ValueError(f"{what} must be at least 2, got {count}")


def check_same_size(images: Sequence[Shaped[np.ndarray, "..."]]) -> Sequence[Shaped[np.ndarray, "..."]]:
    """The photographs themselves. Raises ValueError unless there are photographs and all have one size."""
    if not images:
        raise ValueError("no photograph was given")
    for index, image in enumerate(images):
        if image.ndim not in (2, 3) or min(image.shape[:2]) < 32:
            raise ValueError(f"photograph {index + 1} is not an image of at least 32 x 32 px: shape {image.shape}")
    sizes = {(image.shape[1], image.shape[0]) for image in images}
    if len(sizes) > 1:
        listed = ", ".join(f"{width} x {height}" for width, height in sorted(sizes))
        raise ValueError(f"all photographs must come from one camera mode; their sizes differ: {listed} px")
    return images


_OTHER_UNIT = 2.0  # heights that differ by more are no tolerance


def warnings_of(
    found: Fit,
    covariance: Float[np.ndarray, "size size"],
    views: list[ViewResult],
    scores: list[ModelScore],
    height: float | None = None,
    height_tolerance: float = 0.02,
    field: Bool[np.ndarray, "rows columns"] | None = None,
) -> list[str]:
    """Plain sentences on what the photographs leave uncertain. Raises ValueError for a camera that cannot be; `field`
    is the lit part of the pictures."""
    check_possible(found, field)
    warnings = []
    alpha = alpha_max_deg(found)
    sd = np.sqrt(np.diag(covariance))
    if alpha < NARROW_DEG:
        warnings.append(
            f"The target covers only {alpha:.0f}° from the axis: the principal point is weakly known "
            f"(± {max(sd[1], sd[2]):.1f} px). Move closer, or add photographs tilted by 20°."
        )
    elif max(sd[1], sd[2]) > 2.0:
        warnings.append(
            f"The principal point is weakly known (± {max(sd[1], sd[2]):.1f} px): it is held by a prior about the "
            "middle of the picture. Add photographs tilted by 10 to 20°."
        )
    if sd[0] > 0.01:
        warnings.append(f"f is known to {100 * sd[0]:.1f} % only. Add photographs, closer or tilted, or give --height.")
    tilts = [view.figures.get("tilt_deg", 90.0) for view in views]
    if found.setup.kind == "rings" and max(tilts) < 3.0 and height is None:
        warnings.append(
            "All photographs look squarely at the rings: f, the height and a lens term k cannot be told apart there "
            "(a lens with k = 0.035 would fit as well with f 3.6 % higher). Tilt one photograph by 10 to 20°."
        )
    warnings += _match_warnings(views) if found.setup.kind == "rings" else []
    warnings += _height_warnings(found, covariance, height, height_tolerance)
    warnings += _model_warnings(found, scores)
    return warnings


def _match_warnings(views: list[ViewResult]) -> list[str]:
    return [
        f"Only {view.matched / view.expected:.0%} of the ring edges that photograph {view.photograph + 1} should show "
        "were found: glare or the border may hide rings, or they are not those of the radii given, and f may be far "
        "off. Look at the rings in the report; check the radii, or photograph anew without glare and in focus."
        for view in views
        if view.matched < FEW_MATCHED * view.expected
    ]


def _height_warnings(found: Fit, covariance, height: float | None, tolerance: float) -> list[str]:
    if height is None:
        return []
    warnings = []
    for view in range(found.setup.views):
        at = VIEWS_AT + VIEW_SIZE * view + 5
        fitted = float(np.exp(found.parameters[at]))
        off = np.log(fitted / height)
        if abs(off) > np.log(_OTHER_UNIT):
            raise ValueError(
                f"photograph {view + 1} fits a height of {fitted:.3g} mm, you gave {height:g} mm: is the height in mm, "
                "like the radii, and from this photograph? Measure it again, or leave it out (two rings are enough)"
            )
        if abs(off) > 0.02 and abs(off) > 3 * np.hypot(np.sqrt(covariance[at, at]), tolerance / 3):
            warnings.append(
                f"Photograph {view + 1} fits a height of {fitted:.2f} mm, you gave {height:g} mm ({100 * off:+.1f} %): "
                "check the height (it counts from the entrance pupil, millimetres behind the glass), or the lens is "
                "not the chosen model."
            )
    return warnings


def check_possible(found: Fit, field: Bool[np.ndarray, "rows columns"] | None = None) -> None:
    """Raises ValueError for a camera that cannot be: its centre outside the picture or the lit field, or no ray for
    what it saw."""
    cx, cy = found.parameters[1:3]
    width, height = found.setup.size
    if not (0 <= cx < width and 0 <= cy < height):
        raise ValueError(
            f"the fit puts the principal point at ({cx:.0f}, {cy:.0f}) px, outside the {width} x {height} picture: is "
            "the target the one described, and whole? Add photographs that it fills, tilted by 10 to 20°"
        )
    if field is not None and not field[round(cy) : round(cy) + 1, round(cx) : round(cx) + 1].all():
        raise ValueError(
            f"the fit puts the principal point at ({cx:.0f}, {cy:.0f}) px, outside the lit field: is the target the "
            "one described, and whole? Add photographs that it fills, tilted by 10 to 20°"
        )
    outermost = used_radius(found)
    if found.name == "spherical" and outermost > 0.995 * found.f:
        raise ValueError(
            f"the fit gives f = {found.f:.1f} px, below the outermost radius used ({outermost:.1f} px), where "
            "r = f sin α has no ray: try --model auto, and check that the target is the one described"
        )


def _model_warnings(found: Fit, scores: list[ModelScore]) -> list[str]:
    warnings = []
    best = preferred(scores)
    if best.name != found.name and best.bic < next(s.bic for s in scores if s.name == found.name) - 10:
        warnings.append(f"{best.name} describes the lens better than {found.name}: consider --model {best.name}.")
    return warnings
