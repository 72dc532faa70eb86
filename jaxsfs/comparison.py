"""Where errors lie: against a threshold, the angle from the axis, the distance; between meshes; published sets."""

from typing import Any, Literal

import equinox as eqx
import numpy as np
import trimesh
from jaxtyping import Float
from scipy.spatial import KDTree

from jaxsfs.camera import AbstractCamera
from jaxsfs.evaluation import Alignment, Comparison, Evaluation, Quantity, scale_for

MetricSet = Literal["all", "c3vd", "simcol"]

_THRESHOLDS = (0.001, 0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2, 0.5)


class SetRules(eqx.Module):
    """How a benchmark compares: quantity, alignment, truths that count (low < d ≤ high, its unit), and its measures
    as pairs (name there, field of `Evaluation`)."""

    quantity: Quantity
    align: Alignment
    low: float
    high: float
    measures: tuple[tuple[str, str], ...]


METRIC_SETS: dict[str, SetRules] = {
    # C3VD as PPSNet (Paruchuri et al. 2024) and LightDepth (Rodríguez-Puigvert et al. 2023) report it: mm along z.
    "c3vd": SetRules(
        "depth",
        "median",
        0.0,
        100.0,
        (
            ("AbsRel", "abs_rel"),
            ("SqRel", "sq_rel"),
            ("RMSE", "rmse"),
            ("RMSE log", "rmse_log"),
            ("delta < 1.1", "delta_1_10"),
            ("delta < 1.25", "delta_1_25"),
        ),
    ),
    # SimCol3D challenge (Rau et al. 2024): cm along z, L1, the median of the relative errors, RMSE; there one factor
    # of least squares serves a whole sequence, here it is that of the frame.
    "simcol": SetRules(
        "depth", "scale-ls", 0.0, float("inf"), (("L1", "mae"), ("median relative", "median_rel"), ("RMSE", "rmse"))
    ),
}


def measures_of(found: Evaluation, metric_set: MetricSet) -> dict[str, float]:
    """The measures of a benchmark by the names it gives them."""
    if metric_set not in METRIC_SETS:
        names = ", ".join(METRIC_SETS)
        raise ValueError(f"a metric set with measures of its own is one of: {names}; got {metric_set!r}")
    return {name: float(getattr(found, field)) for name, field in METRIC_SETS[metric_set].measures}


def cumulative(found: Comparison, thresholds: tuple[float, ...] = _THRESHOLDS) -> list[dict[str, float]]:
    """Rows threshold, share: the share of compared pixels with |d − p|/d at most so large."""
    errors = np.abs(found.relative()[found.compared])
    return [{"threshold": limit, "share": float((errors <= limit).mean())} for limit in thresholds]


def by_angle(found: Comparison, camera: AbstractCamera, step_deg: float = 10.0) -> list[dict[str, Any]]:
    """AbsRel in rings of `step_deg` degrees from the optical axis: rows of from, to, pixels, abs_rel, p95_rel."""
    axial = np.asarray(camera.rays())[..., 2]
    angle = np.rad2deg(np.arccos(np.clip(axial, -1, 1)))
    widest = max(float(angle[found.compared].max()), step_deg)
    edges = step_deg * np.arange(int(np.ceil(widest / step_deg - 1e-9)) + 1)
    return _binned(found, angle, edges)


def by_length(found: Comparison, bins: int = 8) -> list[dict[str, Any]]:
    """AbsRel in `bins` shells of the true range (or depth), even in its logarithm: rows as in `by_angle`."""
    truth = found.truth[found.compared]
    return _binned(found, found.truth, np.geomspace(truth.min(), truth.max() * (1 + 1e-12), bins + 1))


def _binned(found: Comparison, key: Float[np.ndarray, "height width"], edges: np.ndarray) -> list[dict[str, Any]]:
    errors = np.abs(found.relative()[found.compared])
    place = np.clip(np.searchsorted(edges, key[found.compared], side="right") - 1, 0, len(edges) - 2)
    rows = []
    for index in range(len(edges) - 1):
        mine = errors[place == index]
        if mine.size:
            ends = {"from": float(edges[index]), "to": float(edges[index + 1])}
            mean, p95 = float(mine.mean()), float(np.percentile(mine, 95))
            rows.append(ends | {"pixels": int(mine.size), "abs_rel": mean, "p95_rel": p95})
    return rows


def mesh_distances(
    predicted: trimesh.Trimesh,
    truth: trimesh.Trimesh,
    *,
    align: Alignment = "none",
    samples: int = 20000,
    seed: int = 0,
) -> dict[str, float]:
    """Distances between two surfaces, in the truth's unit, from points spread evenly over their areas.

    accuracy: mean distance from the prediction to the truth; completeness: from the truth to the prediction;
    chamfer: the mean of the two; hausdorff: the largest of all, and its 95th percentile. A nearest sample stands for
    the nearest point, so nothing below about √(area/samples)/2 is resolved (`resolution`). `align` scales the
    prediction about the camera's centre by distances from it ("median", or "scale-ls" of their sorted values).
    Raises ValueError for a mesh without faces.
    """
    points = []
    for name, mesh in (("predicted", predicted), ("true", truth)):
        if len(mesh.faces) == 0:
            raise ValueError(f"the {name} mesh has no faces; distances between surfaces need triangles")
        points.append(np.asarray(trimesh.sample.sample_surface(mesh, samples, seed=seed)[0], np.float64))
    away = [np.sort(np.linalg.norm(one, axis=1)) for one in points]
    scale = scale_for(away[0], away[1], align)
    p, d = scale * points[0], points[1]
    to_truth, to_predicted = KDTree(d).query(p)[0], KDTree(p).query(d)[0]
    both = np.concatenate([to_truth, to_predicted])
    return {
        "scale": scale,
        "accuracy": float(to_truth.mean()),
        "completeness": float(to_predicted.mean()),
        "chamfer": float(0.5 * (to_truth.mean() + to_predicted.mean())),
        "hausdorff": float(both.max()),
        "hausdorff_95": float(np.percentile(both, 95)),
        "resolution": float(0.5 * np.sqrt(max(truth.area, scale**2 * predicted.area) / samples)),
    }
