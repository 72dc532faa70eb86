"""How far a reconstructed range or depth map lies from the true one, in the measures that the field publishes."""

from typing import Any, Literal

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Num

from jaxsfs.camera import AbstractCamera
from jaxsfs.geometry import geometry
from jaxsfs.surface import Surface

Quantity = Literal["range", "depth"]
Alignment = Literal["median", "none", "scale-ls"]


class NormalErrors(eqx.Module):
    """Angles between predicted and true unit normals, in degrees; shares are of `pixels`."""

    mean_deg: float
    median_deg: float
    share_below_11_25_deg: float
    share_below_22_5_deg: float
    share_below_30_deg: float
    pixels: int


class Comparison(eqx.Module):
    """Prediction (times `scale`) and truth as one quantity, and the pixels where both are known (`compared`).

    `fraction`: share of the pixels with a truth that are compared. Arrays are (height, width), double precision.
    """

    predicted: Float[np.ndarray, "height width"]
    truth: Float[np.ndarray, "height width"]
    compared: Bool[np.ndarray, "height width"]
    quantity: Quantity
    scale: float
    fraction: float

    def relative(self) -> Float[np.ndarray, "height width"]:
        """(p − d)/d per pixel, NaN where not compared."""
        safe = np.where(self.compared, self.truth, 1.0)
        return np.where(self.compared, (self.predicted - safe) / safe, np.nan)


class Evaluation(eqx.Module):
    """Errors of a prediction p against the truth d over the pixels where both are finite and positive.

    Per pixel, then averaged: mae |d − p|, abs_rel |d − p|/d, sq_rel (d − p)²/d, rmse √mean (d − p)², rmse_log
    √mean (ln d − ln p)² (natural logarithm), delta_k the share of pixels with max(d/p, p/d) < k; median_rel and
    p95_rel are the median and the 95th percentile of |d − p|/d. mae, sq_rel and rmse have the unit of the truth, and
    depend on `quantity`; the others have none. p is the prediction times `scale`: `align` says how that was found.

    `pixels`: number compared; `fraction`: their share of the pixels that have a truth. `normals` is None without a
    camera. Source of the definitions: Eigen et al. 2014; Garg et al. 2016 for the median alignment.
    """

    quantity: Quantity
    align: Alignment
    scale: float
    pixels: int
    fraction: float
    mae: float
    abs_rel: float
    sq_rel: float
    rmse: float
    rmse_log: float
    delta_1_05: float
    delta_1_10: float
    delta_1_25: float
    median_rel: float
    p95_rel: float
    normals: NormalErrors | None

    def as_dict(self) -> dict[str, Any]:
        """Plain numbers and strings under the field names, `normals` as a dictionary or None."""
        plain = {name: value for name, value in vars(self).items() if name != "normals"}
        return plain | {"normals": None if self.normals is None else dict(vars(self.normals))}


def evaluate(
    predicted: Num[Array | np.ndarray, "..."],
    truth: Num[Array | np.ndarray, "..."],
    *,
    valid: Bool[Array | np.ndarray, "..."] | None = None,
    quantity: Quantity = "range",
    predicted_quantity: Quantity | None = None,
    truth_quantity: Quantity | None = None,
    align: Alignment = "median",
    camera: AbstractCamera | None = None,
    truth_normals: Num[Array | np.ndarray, "..."] | None = None,
) -> Evaluation:
    """Compares `predicted` with `truth` as `quantity`: range (along the ray) or depth (along the optical axis).

    `align="median"` multiplies the prediction by median(d)/median(p) over the compared pixels, for shape known up to
    a scale factor; "scale-ls" by Σ p d/Σ p², the factor of least squares; "none" compares lengths as they are. Nothing
    is ever shifted.

    `predicted`, `truth`: (height, width), one unit of length; pixels that are not finite or not positive have no data.
    `valid`: compare only there. `predicted_quantity`, `truth_quantity`: what the arrays hold, by default `quantity`;
    the camera converts where that differs. `camera`: adds the errors of the normals, both differenced over the
    compared pixels by one stencil; `truth_normals` (height, width, 3), camera frame, towards the camera, NaN where
    unknown, take the place of the differenced truth.

    Raises ValueError for arrays of different size, for a conversion or normals without a camera, and when no pixel
    can be compared.
    """
    found = compare(
        predicted,
        truth,
        valid=valid,
        quantity=quantity,
        predicted_quantity=predicted_quantity,
        truth_quantity=truth_quantity,
        align=align,
        camera=camera,
    )
    p, d, both = found.predicted, found.truth, found.compared
    if camera is None and truth_normals is not None:
        raise ValueError("true normals were given without a camera; the prediction's normals need one")
    normals = None if camera is None else _normal_errors(camera, p, d, both, quantity, truth_normals)
    return Evaluation(
        quantity=quantity,
        align=align,
        scale=found.scale,
        pixels=int(both.sum()),
        fraction=found.fraction,
        normals=normals,
        **_length_errors(p[both], d[both]),
    )


def compare(
    predicted: Num[Array | np.ndarray, "..."],
    truth: Num[Array | np.ndarray, "..."],
    *,
    valid: Bool[Array | np.ndarray, "..."] | None = None,
    quantity: Quantity = "range",
    predicted_quantity: Quantity | None = None,
    truth_quantity: Quantity | None = None,
    align: Alignment = "median",
    camera: AbstractCamera | None = None,
) -> Comparison:
    """What `evaluate` sums up, pixel by pixel: both maps as `quantity`, the prediction scaled. Arguments as there."""
    p, d = np.asarray(predicted, np.float64), np.asarray(truth, np.float64)
    if p.shape != d.shape or p.ndim != 2:
        raise ValueError(
            f"prediction and truth must be two (height, width) arrays of one size, got {p.shape} and {d.shape}; "
            "resize or crop one of them"
        )
    if camera is not None and (camera.height, camera.width) != p.shape:
        raise ValueError(
            f"the camera's image is {camera.width} x {camera.height} px, the arrays are {p.shape[1]} x {p.shape[0]} "
            "px; resize or crop the camera with them"
        )
    p = convert_quantity(p, predicted_quantity or quantity, quantity, camera)
    d = convert_quantity(d, truth_quantity or quantity, quantity, camera)
    wanted = np.ones(p.shape, bool) if valid is None else np.asarray(valid)
    if wanted.shape != p.shape:
        raise ValueError(f"the mask of pixels to compare must be {p.shape} like the arrays, got {wanted.shape}")
    has_truth = wanted & _positive(d)
    both = has_truth & _positive(p)
    if not both.any():
        raise ValueError(
            f"prediction and truth have no pixel in common: {int((wanted & _positive(p)).sum())} predicted pixels and "
            f"{int(has_truth.sum())} true ones are finite, positive and inside the mask"
        )
    scale = scale_for(p[both], d[both], align)
    return Comparison(scale * p, d, both, quantity, scale, float(both.sum() / has_truth.sum()))


def scale_for(p: Float[np.ndarray, " count"], d: Float[np.ndarray, " count"], align: Alignment) -> float:
    """The factor on the prediction p that `align` asks for."""
    if align == "median":
        return float(np.median(d) / np.median(p))
    if align == "scale-ls":
        return float((p @ d) / (p @ p))
    if align == "none":
        return 1.0
    raise ValueError(f"align must be 'median', 'scale-ls' or 'none', got {align!r}")


def convert_quantity(
    values: Num[Array | np.ndarray, "height width"], given: Quantity, wanted: Quantity, camera: AbstractCamera | None
) -> Num[np.ndarray, "height width"]:
    """Range from depth or depth from range: depth = range · ray_z; an orthographic camera's range is its depth.

    NaN where the camera has no ray and where a ray with ray_z ≤ 0 has no depth in front of the camera.
    Raises ValueError when the two differ and there is no camera.
    """
    values = np.asarray(values, np.float64)
    if given == wanted:
        return values
    if camera is None:
        raise ValueError(f"to compare {wanted} where {given} is given, a camera is needed")
    axial = np.asarray(camera.rays()[..., 2], np.float64)
    axial = np.where(np.asarray(camera.field()) & (axial > 0), axial, np.nan)
    return values * axial if wanted == "depth" else values / axial


def _positive(values: np.ndarray) -> np.ndarray:
    return np.isfinite(values) & (values > 0)


def _length_errors(p: np.ndarray, d: np.ndarray) -> dict[str, float]:
    relative = np.abs(d - p) / d
    ratio = np.maximum(d / p, p / d)
    return {
        "mae": float(np.abs(d - p).mean()),
        "abs_rel": float(relative.mean()),
        "sq_rel": float(((d - p) ** 2 / d).mean()),
        "rmse": float(np.sqrt(((d - p) ** 2).mean())),
        "rmse_log": float(np.sqrt((np.log(d / p) ** 2).mean())),
        "delta_1_05": float((ratio < 1.05).mean()),
        "delta_1_10": float((ratio < 1.10).mean()),
        "delta_1_25": float((ratio < 1.25).mean()),
        "median_rel": float(np.median(relative)),
        "p95_rel": float(np.percentile(relative, 95)),
    }


def _normal_errors(
    camera: AbstractCamera,
    p: np.ndarray,
    d: np.ndarray,
    both: np.ndarray,
    quantity: Quantity,
    truth_normals: Num[Array | np.ndarray, "..."] | None,
) -> NormalErrors | None:
    """None where no compared pixel has both normals."""

    def normals(values: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        distance = convert_quantity(values, quantity, "range", camera)
        known = both & _positive(distance)
        space = geometry(Surface(camera, jnp.asarray(np.where(known, distance, 1.0)), jnp.asarray(known)))
        return space.normals.astype(np.float64), space.has_normal

    n_p, ok_p = normals(p)
    if truth_normals is None:
        n_d, ok_d = normals(d)
    else:
        n_d = np.asarray(truth_normals, np.float64)
        if n_d.shape != (*d.shape, 3):
            raise ValueError(f"true normals must be {(*d.shape, 3)}, got {n_d.shape}")
        length = np.linalg.norm(n_d, axis=-1, keepdims=True)
        ok_d = both & _positive(length[..., 0])
        n_d = np.where(ok_d[..., None], n_d, 1.0) / np.where(ok_d[..., None], length, 1.0)
    a, b = n_p[ok_p & ok_d], n_d[ok_p & ok_d]
    if not len(a):
        return None
    # atan2 of sine and cosine: the arc cosine loses half of the digits where the normals agree.
    angle = np.rad2deg(np.arctan2(np.linalg.norm(np.cross(a, b), axis=-1), (a * b).sum(axis=-1)))
    return NormalErrors(
        mean_deg=float(angle.mean()),
        median_deg=float(np.median(angle)),
        share_below_11_25_deg=float((angle < 11.25).mean()),
        share_below_22_5_deg=float((angle < 22.5).mean()),
        share_below_30_deg=float((angle < 30).mean()),
        pixels=len(a),
    )
