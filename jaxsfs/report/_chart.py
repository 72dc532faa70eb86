"""Curves and clouds of points over two axes, as SVG inside a page."""

import dataclasses
from collections.abc import Sequence
from html import escape
from typing import Literal

import numpy as np
from jaxtyping import Float

from jaxsfs.report._panels import legend
from jaxsfs.report._scale import Scale

_WIDTH, _HEIGHT = 880, 360  # of the drawing, in the units of its view box
_LEFT, _RIGHT, _TOP, _BOTTOM = 78, 12, 12, 48  # of the frame from the drawing's borders
_OUTSIDE = 2.0  # frames: curves that go further are drawn to there
COLOURS = ("#2b6cb0", "#c05621", "#2f855a", "#b83280", "#6b46c1", "#b7791f", "#0e7490", "#9b2c2c", "#718096")


@dataclasses.dataclass(frozen=True)
class Curve:
    """Points (x, y) as a line, as a cloud of small dots, as marks, or as marks joined by a line; `name` for the
    legend."""

    x: Float[np.ndarray, " count"]
    y: Float[np.ndarray, " count"]
    name: str
    colour: str = COLOURS[0]
    style: Literal["line", "cloud", "marks", "both"] = "line"


def chart(
    words: str,
    curves: Sequence[Curve],
    across: Scale,
    up: Scale,
    *,
    level: float | None = None,
    upright: float | None = None,
) -> str:
    """The curves between the ends of two scales, which label the axes; `words` describe the picture to those who do
    not see it. `level`, `upright`: where a thin line runs across or up."""
    drawn = [_axis(across, along=True), _axis(up, along=False)]
    x0, y0, width, height = _frame()
    drawn.append(f'<svg x="{x0}" y="{y0}" width="{width}" height="{height}" viewBox="{x0} {y0} {width} {height}">')
    if level is not None:
        y = _down(up, np.array([level]))[0]
        drawn.append(f'<path class="rule" d="M{x0} {y:.1f}h{width}"/>')
    if upright is not None:
        x = _right(across, np.array([upright]))[0]
        drawn.append(f'<path class="rule" d="M{x:.1f} {y0}v{height}"/>')
    drawn += [_drawn(curve, across, up) for curve in curves]
    drawn.append("</svg>")
    names = legend([(curve.colour, curve.name) for curve in curves])
    picture = f'<svg class="chart" viewBox="0 0 {_WIDTH} {_HEIGHT}" role="img" aria-label="{escape(words)}">'
    return f"<figure>{picture}{''.join(drawn)}</svg>{names}</figure>"


def dots(points: Float[np.ndarray, "count 2"]) -> str:
    """Path data that round line ends turn into dots."""
    return "".join(f"M{x:.1f} {y:.1f}h0" for x, y in points)


def _frame() -> tuple[int, int, int, int]:
    """Left, top, width and height."""
    return _LEFT, _TOP, _WIDTH - _LEFT - _RIGHT, _HEIGHT - _TOP - _BOTTOM


def _right(scale: Scale, values: Float[np.ndarray, " count"]) -> Float[np.ndarray, " count"]:
    left, _, width, _ = _frame()
    return left + width * np.clip(scale.place(values), -_OUTSIDE, 1 + _OUTSIDE)


def _down(scale: Scale, values: Float[np.ndarray, " count"]) -> Float[np.ndarray, " count"]:
    _, top, _, height = _frame()
    return top + height * (1 - np.clip(scale.place(values), -_OUTSIDE, 1 + _OUTSIDE))


def _drawn(curve: Curve, across: Scale, up: Scale) -> str:
    finite = np.isfinite(curve.x) & np.isfinite(curve.y)
    points = np.stack([_right(across, curve.x[finite]), _down(up, curve.y[finite])], axis=1)
    paths = ""
    if curve.style in ("line", "both") and len(points):
        line = "L".join(f"{x:.1f} {y:.1f}" for x, y in points)
        paths += f'<path class="curve" stroke="{curve.colour}" d="M{line}"/>'
    if curve.style != "line":
        kind = "cloud" if curve.style == "cloud" else "marks"
        paths += f'<path class="{kind}" stroke="{curve.colour}" d="{dots(points)}"/>'
    return paths


def _axis(scale: Scale, along: bool) -> str:
    """Ticks with thin lines over the frame, and the label."""
    left, top, width, height = _frame()
    ticks = np.array(scale.ticks())
    words = [f"{0.0 if abs(tick) < 1e-9 * (scale.high - scale.low) else tick:.6g}" for tick in ticks]
    if along:
        lines = "".join(f"M{x:.1f} {top}v{height}" for x in _right(scale, ticks))
        at = [f'x="{x:.1f}" y="{top + height + 18}" text-anchor="middle"' for x in _right(scale, ticks)]
        place = f'x="{left + width / 2:.0f}" y="{_HEIGHT - 8}" text-anchor="middle"'
    else:
        lines = "".join(f"M{left} {y:.1f}h{width}" for y in _down(scale, ticks))
        at = [f'x="{left - 8}" y="{y + 4:.1f}" text-anchor="end"' for y in _down(scale, ticks)]
        place = f'transform="translate(16 {top + height / 2:.0f}) rotate(-90)" text-anchor="middle"'
    numbers = "".join(f"<text {where}>{word}</text>" for where, word in zip(at, words, strict=True))
    return f'<path class="grid" d="{lines}"/>{numbers}<text {place}>{escape(scale.label)}</text>'
