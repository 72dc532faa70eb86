"""What the foreign formats have in common, and its equivalents among our cameras.

Pinhole lenses with fx, fy, cx, cy and one of three distortions; pixel origin 0 (centre of the first pixel) here, each
format shifts to its own.
"""

from typing import Any, NamedTuple

import numpy as np

from jaxsfs.camera import AbstractCamera, Equidistant, KannalaBrandt, Orthographic, Perspective
from jaxsfs.convert._fit import Misfit, fisheye_like, fisheye_of_samples
from jaxsfs.convert._radtan import radtan_samples
from jaxsfs.forms import Scalar

PINHOLE, FISHEYE, RADTAN = "pinhole", "fisheye", "radtan"


class Standard(NamedTuple):
    """`kind`: "pinhole" q = (x, y)/z, no coefficients; "fisheye": Kannala–Brandt, k1 … k4; "radtan": the pinhole with
    OpenCV's k1 k2 p1 p2 [k3 [k4 k5 k6 …]]. `width`, `height` are 0 where the source does not say them."""

    kind: str
    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    coefficients: tuple[float, ...] = ()


def standard_of(camera: AbstractCamera) -> tuple[Standard, Misfit | None]:
    """`camera` as pinhole or fisheye; with the misfit where that is a fit.

    Raises ValueError for an orthographic camera.
    """
    if isinstance(camera, Orthographic):
        raise ValueError("an orthographic camera has no projection centre; no other program's format describes it")
    if isinstance(camera, Perspective):
        return _standard(PINHOLE, camera, ()), None
    misfit = None
    if isinstance(camera, Equidistant):
        fx, fy = camera.focal()
        width, height = camera.width, camera.height
        camera = KannalaBrandt(fx=fx, fy=fy, cx=camera.cx, cy=camera.cy, width=width, height=height)
    elif not isinstance(camera, KannalaBrandt):
        camera, misfit = fisheye_like(camera)
    return _standard(FISHEYE, camera, tuple(float(k) for k in camera.k)), misfit


def camera_of(standard: Standard, tolerance: Scalar) -> tuple[Perspective | KannalaBrandt, Misfit | None]:
    """Our camera for `standard`; a distorted pinhole becomes the fisheye fitted to it.

    Raises ValueError when the fit's largest misfit exceeds `tolerance` (px).
    """
    kind, coefficients = standard.kind, standard.coefficients
    fx, fy, cx, cy = standard.fx, standard.fy, standard.cx, standard.cy
    size = (standard.width, standard.height)
    common: dict[str, Any] = {"fx": fx, "fy": fy, "cx": cx, "cy": cy, "width": size[0], "height": size[1]}
    if fx <= 0 or fy <= 0:
        raise ValueError(f"focal lengths must be positive, got {fx:g} and {fy:g} px")
    if kind == PINHOLE or (kind == RADTAN and not np.any(coefficients)):
        return Perspective(**common), None
    if kind == FISHEYE:
        k1, k2, k3, k4 = coefficients
        return KannalaBrandt(**common, k=(k1, k2, k3, k4)), None
    rays, pixels = radtan_samples(size, (fx, fy, cx, cy), coefficients)
    camera, misfit = fisheye_of_samples(rays, pixels, size, (fx, fy, cx, cy))
    if not misfit.largest <= tolerance:  # nan accepts nothing
        raise ValueError(
            f"the nearest camera of ours misses this lens by {misfit.largest:.3g} px at most, rms {misfit.rms:.3g}, "
            f"more than {tolerance:g} px; raise the tolerance (--tolerance) to accept it, or calibrate anew"
        )
    return camera, misfit


def _standard(kind: str, camera: Perspective | KannalaBrandt, coefficients: tuple[float, ...]) -> Standard:
    fx, fy, cx, cy = float(camera.fx), float(camera.fy), float(camera.cx), float(camera.cy)
    return Standard(kind, camera.width, camera.height, fx, fy, cx, cy, coefficients)
