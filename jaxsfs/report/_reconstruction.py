"""The report of a reconstruction: a page to look at."""

import json
from collections.abc import Mapping
from typing import Any

import numpy as np
from jaxtyping import Float, UInt8

from jaxsfs.geometry import Geometry, geometry
from jaxsfs.preparation import Preparation
from jaxsfs.reconstruction import Reconstruction
from jaxsfs.report._fronts import fronts_panel
from jaxsfs.report._page import code, heading, page, paragraph, table
from jaxsfs.report._panels import (
    colour_panel,
    grid,
    image as picture,
    legend,
    map_panel,
    panel,
    photograph_panel,
    png,
    stride,
)
from jaxsfs.report._scale import Scale, ends
from jaxsfs.report._viewer import script, viewer

# What became of a pixel: colour of the veil over the photograph, and words. Later ones cover earlier ones.
_KINDS = (
    ("#101418", "outside the mask"),
    ("#d7263d", "left out: clipped, black or without a ray"),
    ("#29d3ff", "highlight, measured by colour"),
    ("#43c463", "clipped, measured in other channels"),
    ("#ffd21f", "filled from the surroundings: a guess"),
    ("#ff4fd8", "occluding contour, beyond which range jumps"),
)
_VEIL = 0.72


def reconstruction_page(
    result: Reconstruction,
    prepared: Preparation,
    photograph: UInt8[np.ndarray, "height width 3"],
    record: Mapping[str, Any],
    *,
    residual: Float[np.ndarray, "height width"],
    uncertainty: Float[np.ndarray, "height width"] | None = None,
    usable: np.ndarray | None = None,
) -> str:
    """A self-contained HTML page on `result`: status in words, a mesh to turn and measure on, maps, fronts, settings.

    `prepared`: the irradiance that was used and what became of the pixels; `photograph` as 8-bit red, green, blue;
    `record`: what result.json holds (status, unit, options with their origin, figures, command, versions).
    `residual`: |E_rerendered − E|/mean(E), NaN where there is none. `uncertainty`: 1σ of the range in the unit of
    `record`, NaN where there is none. `usable`: the pixels of the mask, all if not given.
    """
    unit = record["unit"]
    space, valid = geometry(result.surface), np.asarray(result.surface.valid)
    distance = np.where(valid, np.asarray(result.surface.range, np.float64), np.nan)
    scale = _length_scale(distance, f"range / {unit}")
    panels = [
        photograph_panel("Photograph", photograph),
        _irradiance_panel(prepared),
        _mask_panel(prepared, photograph, np.ones_like(valid) if usable is None else usable, result.surface.contours),
        map_panel("Range", distance, scale, "Distance from the projection centre."),
        _depth_panel(space, valid, unit),
        _normals_panel(space),
        fronts_panel(photograph, distance, valid, scale),
        _residual_panel(residual),
    ]
    if uncertainty is not None:
        bar = Scale(0.0, ends(uncertainty)[1], f"1σ of the range / {unit}", "magma", "root")
        panels.append(map_panel("Uncertainty", uncertainty, bar, "One standard deviation of the range."))
    status = record["status"]
    parts = [
        paragraph(status["message"], "verdict" if status["trustworthy"] else "warning"),
        paragraph(_about_scale(unit)),
        viewer(result.surface, photograph, scale, unit, space),
        grid(panels),
        heading("Figures"),
        table(_figures(record)),
        heading("Settings"),
        table(_settings(record), ("setting", "value", "from")),
        heading("How it was made"),
        code(record["command"]),
        code(json.dumps({"camera": record["camera"], "versions": record["versions"]}, indent=2)),
        script(),
    ]
    return page(f"Reconstruction of {record['image']}", parts)


def _about_scale(unit: str) -> str:
    if unit != "scene units":
        return f"Lengths are in {unit}."
    return (
        "Lengths are in scene units: one image gives the shape up to one factor. A known range (--known-range) or a "
        "calibrated camera file makes them millimetres."
    )


def _length_scale(lengths: Float[np.ndarray, "height width"], label: str) -> Scale:
    low, high = ends(lengths)
    return Scale(low, high, label, even="logarithm" if low > 0 else "value", reverse=True)


def _irradiance_panel(prepared: Preparation) -> str:
    values = np.asarray(prepared.irradiance.values, np.float64)
    values = np.where(np.asarray(prepared.irradiance.valid), values, np.nan)
    scale = Scale(0.0, ends(values, highest=99.7)[1], "E, linear light, full scale 1 before fall-off", "grey", "root")
    note = "What the solver reads: response and fall-off taken out, highlights removed, channels weighted."
    return map_panel("Irradiance", values, scale, note)


def _mask_panel(
    prepared: Preparation, photograph: UInt8[np.ndarray, "height width 3"], usable: np.ndarray, contours
) -> str:
    used = np.asarray(prepared.irradiance.valid)
    torn = np.zeros_like(used) if contours is None else np.asarray(contours)
    of_used = (mark & used for mark in (prepared.highlights, prepared.measured, prepared.filled, torn))
    marks = (~usable, usable & ~used, *of_used)
    step = stride(*used.shape)
    shown = photograph[::step, ::step].astype(np.float32)
    rows = [("transparent", f"used: {used.mean():.2%}")]
    for (colour, words), mark in zip(_KINDS, marks, strict=True):
        ink = np.frombuffer(bytes.fromhex(colour[1:]), np.uint8)
        shown = np.where(mark[::step, ::step, None], (1 - _VEIL) * shown + _VEIL * ink, shown)
        if mark.any():
            rows.append((colour, f"{words}: {mark.mean():.2%}"))
    title = "Mask, clipped pixels, contours"
    return panel(title, picture(png(np.round(shown).astype(np.uint8)), title), legend(rows))


def _depth_panel(space: Geometry, valid: np.ndarray, unit: str) -> str:
    depth = np.where(valid, space.points[..., 2].astype(np.float64), np.nan)
    return map_panel("Depth", depth, _length_scale(depth, f"depth / {unit}"), "z along the optical axis.")


def _normals_panel(space: Geometry) -> str:
    shown = space.has_normal & np.isfinite(space.normals).all(axis=-1)
    facing = np.where(shown[..., None], space.normals, 0) * [1, -1, -1]
    rows = (("#ff8080", "to the right"), ("#80ff80", "upwards"), ("#8080ff", "towards the camera"))
    title = "Normals"
    body = colour_panel(title, np.round(127.5 * (1 + facing)).astype(np.uint8), shown)
    return body.replace("<figcaption>", legend(rows) + "<figcaption>", 1)


def _residual_panel(residual: Float[np.ndarray, "height width"]) -> str:
    scale = Scale(0.0, ends(residual)[1], "|E rerendered − E| / mean E", "magma", "root")
    note = "Tests the solution of the equation, not the photometry: one image fits any response and fall-off."
    return map_panel("Residual", residual, scale, note)


def _figures(record: Mapping[str, Any]) -> list[tuple[str, Any]]:
    figures = record["figures"]
    rows = [(f"range, {name} / {record['unit']}", value) for name, value in figures["range"].items()]
    rows += [(name.replace("_", " "), value) for name, value in figures["solution"].items()]
    rows += [(f"pixels {name.replace('_', ' ')}", figures["photograph"][name]) for name in ("used", "outside")]
    return rows


def _settings(record: Mapping[str, Any]) -> list[tuple[str, Any, str]]:
    return [(name.replace("_", "-"), entry["value"], entry["origin"]) for name, entry in record["options"].items()]
