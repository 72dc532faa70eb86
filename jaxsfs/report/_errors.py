"""One picture of errors: map, cumulative curve, against the angle from the axis, against the distance."""

import io
from typing import Any

import numpy as np

from jaxsfs.comparison import cumulative
from jaxsfs.evaluation import Comparison


def error_figure(
    found: Comparison, angle_rows: list[dict[str, Any]] | None, length_rows: list[dict[str, Any]], words: str
) -> bytes:
    """A PNG. `angle_rows`, `length_rows`: what `by_angle` and `by_length` gave; `words`: the title."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(14, 3.8), layout="constrained")
    axes = figure.subplots(1, 4)
    figure.suptitle(words, fontsize=10)
    relative = 100 * found.relative()
    limit = max(float(np.nanpercentile(np.abs(relative), 98)), 1e-3)
    shown = axes[0].imshow(relative, cmap="coolwarm", vmin=-limit, vmax=limit)
    figure.colorbar(shown, ax=axes[0], label="(p − d)/d in %")
    axes[0].set(title="too near (blue), too far (red)", xticks=[], yticks=[])

    thresholds = tuple(float(x) for x in np.geomspace(1e-4, 1, 80))
    rows = cumulative(found, thresholds)
    axes[1].plot([100 * row["threshold"] for row in rows], [100 * row["share"] for row in rows])
    axes[1].set(xscale="log", ylim=(0, 101), xlabel="|d − p|/d in %", ylabel="pixels at most so far off, %")
    axes[1].grid(True, alpha=0.3)
    _bars(axes[2], angle_rows, "angle from the axis in °", "no camera given: no angles")
    _bars(axes[3], length_rows, f"true {found.quantity}", "")
    data = io.BytesIO()
    figure.savefig(data, format="png", dpi=90)
    return data.getvalue()


def _bars(axis, rows: list[dict[str, Any]] | None, label: str, absent: str) -> None:
    if not rows:
        axis.text(0.5, 0.5, absent, ha="center", va="center", transform=axis.transAxes)
        axis.set(xticks=[], yticks=[])
        return
    edges = np.array([row["from"] for row in rows] + [rows[-1]["to"]])
    middle = 0.5 * (edges[1:] + edges[:-1])
    axis.plot(middle, [100 * row["abs_rel"] for row in rows], "o-", label="mean")
    axis.plot(middle, [100 * row["p95_rel"] for row in rows], "o--", label="95th percentile")
    axis.set(xlabel=label, ylabel="|d − p|/d in %", ylim=(0, None))
    axis.legend(fontsize=8)
    axis.grid(True, alpha=0.3)
