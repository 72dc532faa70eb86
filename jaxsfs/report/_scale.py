"""Which colour a number gets, and the bar that says so."""

import dataclasses
import math
from html import escape
from typing import Literal

import cv2
import numpy as np
from jaxtyping import Float, UInt8

_STOPS = 16  # of the bar's gradient
_APART = 0.11  # of the bar: least distance of two numbers
_MAPS = {
    "viridis": cv2.COLORMAP_VIRIDIS,
    "magma": cv2.COLORMAP_MAGMA,
    "summer": cv2.COLORMAP_SUMMER,  # green to yellow: seen on tissue, bright or dark
}


@dataclasses.dataclass(frozen=True)
class Scale:
    """Colours from `low` to `high` in even steps of the value, its logarithm or its root; beyond, the ends' colours.

    `colours`: a map's name; `reverse` begins at its end. `label`: quantity and unit, for the bar.
    """

    low: float
    high: float
    label: str
    colours: Literal["viridis", "magma", "summer", "grey"] = "viridis"
    even: Literal["value", "logarithm", "root"] = "value"
    reverse: bool = False

    def level(self, values: Float[np.ndarray, "*shape"]) -> Float[np.ndarray, "*shape"]:
        """Position on the bar, 0 to 1; 0 for NaN."""
        return np.clip(np.nan_to_num(self.place(values)), 0, 1)

    def place(self, values: Float[np.ndarray, "*shape"]) -> Float[np.ndarray, "*shape"]:
        """Position along the scale, beyond 0 and 1 for values beyond its ends."""
        low, high = self._stretched(np.array([self.low, self.high]))
        return (self._stretched(values) - low) / max(high - low, 1e-30)

    def rgb(self, values: Float[np.ndarray, "*shape"]) -> UInt8[np.ndarray, "*shape 3"]:
        """The colours of `values`."""
        return self._of_level(self.level(values))

    def ticks(self) -> list[float]:
        """Round numbers between the ends, about five."""
        if self.even == "logarithm" and self.high > 20 * self.low:
            return _decades(self.low, self.high)
        return _multiples(self.low, self.high, 5)

    def bar(self) -> str:
        """The colour bar as HTML."""
        stops = self._of_level(np.linspace(0, 1, _STOPS))
        gradient = ",".join("#" + bytes(stop).hex() for stop in stops)
        marks = "".join(f'<span style="left:{100 * place:.1f}%">{tick:.6g}</span>' for tick, place in self._apart())
        ramp = f'<div class="ramp" style="background:linear-gradient(to right,{gradient})"></div>'
        return (
            f'<div class="bar">{ramp}<div class="ticks">{marks}</div><div class="unit">{escape(self.label)}</div></div>'
        )

    def _apart(self) -> list[tuple[float, float]]:
        """The ticks and their places, without those that would print over another."""
        kept: list[tuple[float, float]] = []
        for tick in self.ticks():
            place = float(self.level(np.array([tick]))[0])
            if not kept or abs(place - kept[-1][1]) > _APART:
                kept.append((tick, place))
        return kept

    def _of_level(self, level: Float[np.ndarray, "*shape"]) -> UInt8[np.ndarray, "*shape 3"]:
        level = 1 - level if self.reverse else level
        table = _table(self.colours)
        return table[np.round(255 * level).astype(np.uint8)]

    def _stretched(self, values: Float[np.ndarray, "*shape"]) -> Float[np.ndarray, "*shape"]:
        if self.even == "logarithm":
            return np.log(np.maximum(values, 1e-30))
        return np.sqrt(np.maximum(values, 0)) if self.even == "root" else values


def _table(colours: str) -> UInt8[np.ndarray, "256 3"]:
    if colours == "grey":
        return np.repeat(np.arange(256, dtype=np.uint8)[:, None], 3, axis=1)
    return cv2.applyColorMap(np.arange(256, dtype=np.uint8)[:, None], _MAPS[colours])[:, 0, ::-1]


def ends(values: Float[np.ndarray, "*shape"], lowest: float = 1, highest: float = 99) -> tuple[float, float]:
    """Two percentiles of the finite values, so that a few wild ones do not flatten the rest; 0 and 1 without any."""
    finite = values[np.isfinite(values)]
    if not finite.size:
        return 0.0, 1.0
    low, high = np.percentile(finite, [lowest, highest]).tolist()
    return (low, high) if high > low else (low, low + max(abs(low), 1.0))


def _multiples(low: float, high: float, about: int) -> list[float]:
    step = round_step((high - low) / about)
    first = math.ceil(low / step - 1e-9)
    return [k * step for k in range(first, math.floor(high / step + 1e-9) + 1)]


def _decades(low: float, high: float) -> list[float]:
    exponents = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
    marks = [digit * 10.0**exponent for exponent in exponents for digit in (1, 2, 5)]
    marks = [mark for mark in marks if low <= mark <= high]
    return marks[:: math.ceil(len(marks) / 6)]


def round_step(step: float) -> float:
    """The nearest of 1, 2, 2.5, 5 times a power of ten."""
    power = 10.0 ** math.floor(math.log10(step))
    return min((digit * power for digit in (1, 2, 2.5, 5, 10)), key=lambda near: abs(math.log(near / step)))
