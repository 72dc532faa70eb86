"""The report of a calibration, in words, tables and pictures."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from jaxtyping import UInt8

from jaxsfs.calibration import Calibration, observations
from jaxsfs.report import _calibration_figures as figures
from jaxsfs.report._page import heading, page, paragraph, record, table
from jaxsfs.report._panels import panel

_POSE = ("tilt_deg", "height_mm", "height_sd_mm", "offset_x_mm", "offset_y_mm")


def calibration_page(
    found: Calibration,
    photographs: Sequence[UInt8[np.ndarray, "height width 3"]],
    names: Sequence[str],
    made_by: Mapping[str, Any],
) -> str:
    """A self-contained HTML page on `found`: verdict, figures with 1σ, every photograph with what was found on it,
    residuals, coverage, uncertainty, the lens models compared. `photographs` are all that were given, `names` what to
    call them, `made_by` what to record (command, versions)."""
    figures_of, seen = found.figures(), observations(found)
    parts = [paragraph(found.verdict, "verdict"), *(paragraph(text, "warning") for text in found.warnings)]
    parts += [paragraph(text) for text in found.notes]
    parts += [heading("Camera"), table(_camera_rows(figures_of)), heading("Photographs"), *_photographs(found, names)]
    for view, result in enumerate(found.views):
        title = f"{names[result.photograph]}: observations and residuals (seen minus fitted)"
        parts.append(panel(title, figures.detections(found, seen, photographs[result.photograph], view)))
    parts += [heading("Residuals against the angle"), figures.residual_against_angle(found, seen)]
    parts += [heading("Coverage and uncertainty"), figures.coverage_and_uncertainty(found, seen)]
    parts += [heading("Which lens is it"), _models(found)]
    if "straightness" in found.extras:
        parts.append(paragraph("The curves leave out a factor on tan α, which straight lines do not fix."))
    parts.append(figures.models(found, seen))
    if "straightness" in found.extras:
        parts += [heading("Straightness against f"), paragraph(_NAIVE_SCORES), figures.straightness(found)]
    parts += [heading("Rectified"), figures.rectified(found.fit, photographs[found.views[0].photograph])]
    kept = {k: v for k, v in figures_of.items() if k not in ("uncertainty", "photographs", "models", "straightness")}
    parts += [heading("How it was made"), record({**made_by, **kept})]
    return page("Camera calibration", parts)


_NAIVE_SCORES = (
    "Two obvious scores do not find f: straightness in the unwarped picture, as a share of f, falls for ever, since "
    "the picture shrinks to its middle as f → ∞; f times the angle from the great circle falls to 0 as f → 0. The "
    "Sampson distance, in pixels of the photograph, does neither."
)


def _camera_rows(own: Mapping[str, Any]) -> list[tuple[str, str]]:
    rows = [
        ("model", f"{own['model']}: {own['formula']}"),
        ("f", f"{own['f']:.3f} ± {own['f_sd']:.3f} px"),
        ("principal point", _with_sd((own["cx"], own["cy"]), own["centre_sd"])),
    ]
    rows += [
        (f"k{i + 1}", f"{value:.5f} ± {sd:.5f}")
        for i, (value, sd) in enumerate(zip(own["shape"], own["shape_sd"], strict=True))
    ]
    rows += [
        ("residual", f"{own['rms_px']:.3f} px rms over {own['observations']} observations"),
        ("angle covered", f"{own['alpha_max_deg']:.1f}° from the axis"),
        ("condition number", f"{own['condition']:.3g}"),
    ]
    strong = ", ".join(f"{pair} ({value:+.3f})" for pair, value in own["correlations"].items())
    return [*rows, ("correlations above 0.95", strong or "none")]


def _with_sd(values: Sequence[float], sds: Sequence[float]) -> str:
    return ", ".join(f"{value:.2f} ± {sd:.2f}" for value, sd in zip(values, sds, strict=True)) + " px"


def _photographs(found: Calibration, names: Sequence[str]) -> list[str]:
    rows, papers = [], []
    for view in found.views:
        figures_of = view.figures
        share = f"{view.matched} of {view.expected}" if view.expected else str(view.matched)
        rows.append((names[view.photograph], share, float(view.rms), *(figures_of.get(key) for key in _POSE)))
        if "paper" in figures_of:
            papers.append((names[view.photograph], *(float(v) for v in figures_of["paper"].values())))
    header = (
        "photograph",
        "matched",
        "rms / px",
        "tilt / °",
        "height / mm",
        "1σ / mm",
        "offset x / mm",
        "offset y / mm",
    )
    parts = [table(rows, header)]
    if papers:
        parts.append(paragraph("f by the paper's estimators, which take the sheet to be square-on, beside the fit:"))
        columns = ("photograph", "eq. 20", "least squares", "closed form", "closed form, height / mm")
        parts.append(table(papers, columns))
    parts += [paragraph(f"{names[i]} was left out: {reason}", "warning") for i, reason in found.rejected]
    return parts


def _models(found: Calibration) -> str:
    rows = [tuple(score.row().values()) for score in found.comparison]
    return table(rows, ("model", "f / px", "rms / px", "BIC", "held-out rms / px", "parameters"))
