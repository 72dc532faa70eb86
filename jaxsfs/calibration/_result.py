"""What a calibration found, for people and for files."""

import dataclasses
import functools
from typing import Any

import numpy as np
from jaxtyping import Float, Int

from jaxsfs.calibration._compare import ModelScore, verdict
from jaxsfs.calibration._fit import Fit, rays_of
from jaxsfs.calibration._lens import LENS_SIZE, lens_named
from jaxsfs.calibration._plane import rotate
from jaxsfs.calibration._problem import VIEW_SIZE, VIEWS_AT
from jaxsfs.calibration._uncertainty import (
    correlations,
    jackknife,
    larger,
    left_out_steps,
    pixel_sd_map,
    shared_shift,
    used_radius,
)
from jaxsfs.camera import AbstractCentralCamera, camera_to_dict

_LEAST_GROUPS = 3  # of a cross-validation


@dataclasses.dataclass(frozen=True)
class ViewResult:
    """One photograph: observations `matched` of those `expected` (0: unknown), rms in px, and target-specific
    figures."""

    photograph: int
    matched: int
    expected: int
    rms: float
    figures: dict[str, Any]

    def row(self) -> dict[str, Any]:
        share = self.matched / self.expected if self.expected else None
        return {
            "photograph": self.photograph + 1,
            "matched": self.matched,
            "expected": self.expected,
            "matched_fraction": share,
            "rms_px": self.rms,
        } | self.figures


@dataclasses.dataclass(frozen=True)
class Calibration:
    """A camera with what is known about it.

    `fit` of the chosen model; `covariance` of all its parameters (the larger of the fit's own and cross-validation's,
    plus what all observations may share); `comparison` of the models; `views`; `rejected` photographs (index,
    reason); `warnings`, plain sentences; `extras`, figures special to the target; `notes`, sentences on what is there
    that call for nothing.
    """

    target: str
    fit: Fit
    covariance: Float[np.ndarray, "size size"]
    comparison: list[ModelScore]
    views: list[ViewResult]
    rejected: list[tuple[int, str]]
    warnings: list[str]
    extras: dict[str, Any]
    notes: tuple[str, ...] = ()

    @property
    def camera(self) -> AbstractCentralCamera:
        return self.fit.camera

    @property
    def verdict(self) -> str:
        return verdict(self.comparison)

    def sd(self, index: int) -> float:
        return float(np.sqrt(self.covariance[index, index]))

    @property
    def f_sd(self) -> float:
        """1σ of f in px."""
        return self.fit.f * self.sd(0)

    @property
    def centre_sd(self) -> tuple[float, float]:
        """1σ of the principal point in px."""
        return self.sd(1), self.sd(2)

    @property
    def alpha_max_deg(self) -> float:
        """Angle from the axis of the outermost observation used."""
        return alpha_max_deg(self.fit)

    @functools.cached_property
    def _spread(self) -> Float[np.ndarray, "rows columns"]:
        return pixel_sd_map(self.fit, self.covariance)

    def uncertainty_map(self) -> Float[np.ndarray, "rows columns"]:
        """sd in px of where a fixed direction is seen, over a coarse grid of the image."""
        return self._spread

    def figures(self) -> dict[str, Any]:
        """All figures, ready for JSON."""
        names = ("ln_f", "cx", "cy", "ln_aspect", "s0", "s1", "s2", "s3")
        spread = self.uncertainty_map()
        return {
            "target": self.target,
            "model": self.fit.name,
            "formula": lens_named(self.fit.name).formula,
            "verdict": self.verdict,
            "f": self.fit.f,
            "f_sd": self.f_sd,
            "cx": float(self.fit.parameters[1]),
            "cy": float(self.fit.parameters[2]),
            "centre_sd": list(self.centre_sd),
            "shape": [float(x) for x in self.fit.parameters[4 : 4 + lens_named(self.fit.name).shapes]],
            "shape_sd": [self.sd(4 + i) for i in range(lens_named(self.fit.name).shapes)],
            "rms_px": self.fit.rms,
            "observations": int((self.fit.weight > 0).sum()),
            "alpha_max_deg": self.alpha_max_deg,
            "condition": self.fit.condition,
            "correlations": {" & ".join(pair): value for pair, value in correlations(self.fit).items()},
            "models": [score.row() for score in self.comparison],
            "photographs": [view.row() for view in self.views],
            "rejected": [{"photograph": index + 1, "reason": reason} for index, reason in self.rejected],
            "warnings": self.warnings,
            "notes": list(self.notes),
            "uncertainty": {
                "parameters": list(names),
                "covariance": self.covariance[:LENS_SIZE, :LENS_SIZE].tolist(),
                "map_px": np.round(spread, 5).tolist(),
            },
        } | self.extras

    def description(self) -> dict[str, Any]:
        """The camera file: the camera, and under `calibration` all that made it."""
        return camera_to_dict(self.camera) | {"calibration": self.figures()}


def total_covariance(found: Fit, groupings: list[Int[np.ndarray, " count"]]) -> Float[np.ndarray, "size size"]:
    """Per parameter the larger of the fit's sd and the cross-validation's (the root mean square over the `groupings`,
    each of which estimates the same from few groups), plus the shared error."""
    kept = found.weight > 0
    validations = [
        jackknife(left_out_steps(found, group)) for group in groupings if len(np.unique(group[kept])) >= _LEAST_GROUPS
    ]
    covariance = larger(found.covariance, np.mean(validations, axis=0)) if validations else found.covariance
    shift = shared_shift(found)
    return covariance + np.outer(shift, shift)


def alpha_max_deg(found: Fit) -> float:
    """Angle in degrees between the axis and the outermost observation used."""
    pixel = found.parameters[None, 1:3] + np.array([[used_radius(found), 0.0]])
    return float(np.degrees(np.arccos(np.clip(rays_of(found, pixel)[0, 2], -1, 1))))


def pose_figures(found: Fit, covariance: Float[np.ndarray, "size size"], view: int) -> dict[str, Any]:
    """Height (mm) with its 1σ, tilt (degrees), offset (mm) and rotation vector (radians) of one photograph."""
    pose = found.view(view)
    at = VIEWS_AT + VIEW_SIZE * view + 5
    height = float(np.exp(pose[5]))
    facing = rotate(-pose[:3], np.array([0.0, 0.0, 1.0]))[2]
    return {
        "height_mm": height,
        "height_sd_mm": height * float(np.sqrt(covariance[at, at])),
        "tilt_deg": float(np.degrees(np.arccos(np.clip(facing, -1, 1)))),
        "offset_x_mm": float(pose[3]),
        "offset_y_mm": float(pose[4]),
        "rotation": [float(part) for part in pose[:3]],
    }
