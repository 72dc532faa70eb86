"""The report of a white target: how light falls off with the angle, and what stands for it."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from jaxtyping import UInt8

from jaxsfs.calibration import WhiteCalibration
from jaxsfs.photometry import parse_falloff
from jaxsfs.report._chart import COLOURS, Curve, chart
from jaxsfs.report._page import heading, page, paragraph, record, table
from jaxsfs.report._panels import grid, photograph_panel
from jaxsfs.report._scale import Scale


def white_page(
    found: WhiteCalibration,
    photographs: Sequence[UInt8[np.ndarray, "_height _width 3"]],
    names: Sequence[str],
    made_by: Mapping[str, Any],
) -> str:
    """A self-contained HTML page on `found`; `photographs` with their `names`, `made_by` what to record."""
    parts = [paragraph(found.note, "verdict"), heading("Photometry"), table(_rows(found))]
    parts += [heading("Fall-off"), _falloff(found)]
    parts += [heading("Models tried, best first")]
    header = list(found.models[0]) if found.models else []
    parts.append(table([tuple(row.values()) for row in found.models], header))
    shown = [photograph_panel(name, image) for image, name in zip(photographs, names, strict=True)]
    parts += [heading("Photographs"), grid(shown)]
    parts += [heading("How it was made"), record({**made_by, **found.figures()})]
    return page("White target", parts)


def white_summary(found: WhiteCalibration) -> list[str]:
    """The result in lines of text."""
    return [found.note, *(f"{name}: {text}" for name, text in _rows(found))]


def _rows(found: WhiteCalibration) -> list[tuple[str, str]]:
    both = f"{found.falloff}, a + b = {found.mu:.3g}" if found.falloff.startswith("cosexp") else found.falloff
    rows = [("response", found.response), ("fall-off", f"{both} ± {found.mu_sd:.2g}")]
    if found.gamma is not None and found.gamma_sd is not None:
        rows.append(("gamma of a pure power law", f"{found.gamma:.4g} ± {found.gamma_sd:.2g}"))
    gain = "not known"
    if found.gain_albedo is not None and found.gain_albedo_sd is not None:
        gain = f"{found.gain_albedo:.5g} ± {found.gain_albedo_sd:.2g} mm² ({found.channel})"
    return [
        *rows,
        ("(3 + μ)/γ", f"{found.product:.4g} ± {found.product_sd:.2g}"),
        ("gain·ρ", gain),
        ("residual", f"{found.rms:.4f} of full scale over {found.cells} cells of paper"),
    ]


def _falloff(found: WhiteCalibration) -> str:
    reach = max([*found.alpha_deg, 10.0])
    angle = np.linspace(0, reach, 100)
    law = parse_falloff(found.falloff)(np.cos(np.radians(angle)))
    measured = np.array(found.measured)
    return chart(
        "fall-off against the angle from the axis",
        [
            Curve(angle, law, found.falloff, COLOURS[1]),
            Curve(np.array(found.alpha_deg), measured, "measured, bins of 5°", COLOURS[0], "marks"),
        ],
        Scale(0.0, 1.02 * reach, "angle from the axis / degrees"),
        Scale(0.0, 1.05 * max(float(law.max()), float(measured.max(initial=1.0))), "light relative to the axis"),
    )
