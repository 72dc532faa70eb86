"""1σ of ln r from the covariance of the lens's parameters."""

import dataclasses
from collections.abc import Callable, Mapping
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxsfs.camera import (
    AbstractCentralCamera,
    CameraFile,
    Equidistant,
    Equisolid,
    KannalaBrandt,
    Perspective,
    Scaramuzza,
    Spherical,
    Stereographic,
)
from jaxsfs.surface import Surface

_NAMES = ("ln_f", "cx", "cy", "ln_aspect", "s0", "s1", "s2", "s3")  # as calibrations name them

LensCovariance = Float[np.ndarray, "8 8"]


def lens_covariance(file: CameraFile) -> LensCovariance | None:
    """Covariance of (ln f, cx, cy, ln aspect, shape) that a calibration left in a camera file; None where there is
    none. Raises ValueError for one that cannot be read."""
    calibration = file.other.get("calibration")
    record = calibration.get("uncertainty") if isinstance(calibration, Mapping) else None
    if not isinstance(record, Mapping) or "covariance" not in record:
        return None
    try:
        covariance = np.asarray(record["covariance"], np.float64)
    except (TypeError, ValueError):
        covariance = np.zeros(0)
    names = tuple(record.get("parameters", _NAMES))
    if covariance.shape != (len(_NAMES),) * 2 or names != _NAMES or not np.all(np.isfinite(covariance)):
        raise ValueError(
            f"'calibration.uncertainty' of the camera file must hold a finite 8 x 8 covariance of {', '.join(_NAMES)}, "
            f"got shape {covariance.shape} of {', '.join(map(str, names))}: calibrate again, or remove the entry"
        )
    return covariance


def moved_lens(camera: AbstractCentralCamera, change: Float[Array, "8"]) -> AbstractCentralCamera:
    """`camera` with (ln f, cx, cy, ln aspect, shape) moved by `change`: the parameters of a calibration's covariance.

    Raises ValueError for a camera that calibrations do not make.
    """
    stretch, aspect = jnp.exp(change[0]), jnp.exp(change[3])
    place: dict[str, Any] = {"cx": camera.cx + change[1], "cy": camera.cy + change[2]}
    if isinstance(camera, Perspective | KannalaBrandt):
        place |= {"fx": camera.fx * stretch, "fy": camera.fy * stretch * aspect}
    if isinstance(camera, KannalaBrandt):
        place["k"] = tuple(k + change[4 + i] for i, k in enumerate(camera.k))
    elif isinstance(camera, Scaramuzza):
        # aₙ = sₙ₋₂ fy^(1 − n), a₀ = fy, c = 1/aspect, as `calibration` writes them
        factor = stretch * aspect
        fy = camera.a[0]
        shape = (camera.a[i] * factor ** (1 - i) + change[2 + i] * (fy * factor) ** (1 - i) for i in (2, 3, 4))
        place |= {"a": (fy * factor, camera.a[1], *shape), "c": camera.c / aspect}
    elif isinstance(camera, Spherical | Equidistant | Equisolid | Stereographic):
        place |= {"f": camera.f * stretch, "aspect": camera.aspect * aspect}
    elif not isinstance(camera, Perspective):
        raise ValueError(f"a {type(camera).__name__} camera has no calibration covariance")
    if isinstance(camera, Spherical):
        place["k"] = camera.k + change[4]
    return dataclasses.replace(camera, **place)


def calibration_sigma(
    solution: Callable[[AbstractCentralCamera], Surface], camera: AbstractCentralCamera, covariance: LensCovariance
) -> Float[np.ndarray, "height width"]:
    """1σ of ln r at each pixel, √diag(J Σ Jᵀ) with J = ∂ln r/∂(lens parameters), NaN where the surface is not valid.

    `solution`: how a surface is found with a camera. That the fall-off is read at other angles is left out.
    """
    start = jnp.zeros(len(_NAMES))

    def log_range(change):
        return jnp.log(solution(moved_lens(camera, change)).range)

    known = np.asarray(solution(camera).valid)
    _, linear = jax.linearize(log_range, start)
    values, vectors = np.linalg.eigh(covariance)
    steps = (vectors * np.sqrt(np.maximum(values, 0))).T
    used = steps[np.abs(steps).max(axis=1) > 0]
    if not len(used):
        return np.where(known, 0.0, np.nan)
    changes = jax.jit(lambda rows: jax.lax.map(linear, rows))(jnp.asarray(used, start.dtype))
    return np.where(known, np.sqrt(np.sum(np.asarray(changes, np.float64) ** 2, axis=0)), np.nan)
