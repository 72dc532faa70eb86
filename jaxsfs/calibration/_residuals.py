"""Residuals in px of all kinds of targets, with their derivatives.

A residual is a misfit on the ray sphere or on the paper times a metric in px per unit of it. The metric is computed for
the parameters at which a solve starts, and held, so that residual and derivative belong to one objective and no second
derivatives of the lens are compiled. Of lines its logarithm is held to first order: nothing else fixes the unit of
their misfit, and rays would gain by shrinking to the axis or by spreading. Points need none.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from jaxsfs._arrays import AnyArray, module_of
from jaxsfs.calibration._arrays import sum_by_group
from jaxsfs.calibration._lens import LENS_SIZE, Rays, images, rays
from jaxsfs.calibration._plane import by_rotation, rotate
from jaxsfs.calibration._problem import VIEW_SIZE, VIEWS_AT, Observations

_STEP = 1e-6  # of the forward differences
_LEAST_GROWTH, _MOST_GROWTH = 0.7, 20.0  # of the logarithm of a line's metric during a solve, down and up


class Residuals(NamedTuple):
    """Rows × parts in px, and their derivatives by the lens, the extra parameters and the row's own photograph."""

    value: Float[AnyArray, "count parts"]
    by_lens: Float[AnyArray, "count parts 8"]
    by_extra: Float[AnyArray, "count parts 2"]
    by_view: Float[AnyArray, "count parts 6"]


def look(o: Observations, parameters: Float[AnyArray, " size"]) -> Rays:
    """The rays of all rows."""
    return rays(o.build, parameters[:LENS_SIZE], o.pixel)


def metric(o: Observations, parameters: Float[AnyArray, " size"], seen: Rays) -> Float[AnyArray, "count ..."]:
    """px per unit of each row's misfit about these parameters, `seen` being what `look` returns for them: one number a
    row, for lines ten (see `_held_line_metric`)."""
    if o.kind == "lines":
        return _held_line_metric(o, parameters, seen)
    return _METRICS[o.kind](o, seen, _of_rows(o, parameters))


def residuals(
    o: Observations, parameters: Float[AnyArray, " size"], seen: Rays, held: Float[AnyArray, "count ..."]
) -> tuple[Float[AnyArray, "count parts"], Float[AnyArray, "count parts size"]]:
    """Unweighted residuals ((u, v) of projected minus seen for points, one signed distance for rings and lines) and
    their derivatives by all parameters, the metric being held."""
    found = _RESIDUALS[o.kind](o, parameters, seen, _of_rows(o, parameters), held)
    by_own = module_of(parameters).concatenate([found.by_lens, found.by_extra, found.by_view], axis=2)
    return found.value, _scattered(o, by_own, len(parameters))


def _scattered(o: Observations, by_own: Float[AnyArray, "count parts 16"], size: int):
    """Derivatives by all parameters from those by the lens, the extra parameters and the row's own photograph."""
    xp, views = module_of(by_own), (size - VIEWS_AT) // VIEW_SIZE
    own = xp.where(o.group[:, None] == xp.arange(views)[None], 1.0, 0.0)
    by_views = own[:, None, :, None] * by_own[:, :, None, VIEWS_AT:]
    by_views = by_views.reshape(*by_own.shape[:2], views * VIEW_SIZE)
    return xp.concatenate([by_own[..., :VIEWS_AT], by_views], axis=2)


def _of_rows(o: Observations, parameters: Float[AnyArray, " size"]) -> Float[AnyArray, "count 6"]:
    """The six numbers of every row's photograph."""
    if len(parameters) == VIEWS_AT:
        return module_of(parameters).zeros((len(o.group), VIEW_SIZE))
    return parameters[VIEWS_AT:].reshape(-1, VIEW_SIZE)[o.group]


class _OnPaper(NamedTuple):
    """Where a pixel sees the sheet: `foot`, from the foot of the perpendicular (mm), its distance R from the rings'
    middle, ∇R on the paper (`towards`) and ∂R/∂d in the camera's frame (`fall`)."""

    foot: Float[AnyArray, "count 2"]
    radius: Float[AnyArray, " count"]
    towards: Float[AnyArray, "count 2"]
    fall: Float[AnyArray, "count 3"]


def _on_paper(ray: Float[AnyArray, "count 3"], view: Float[AnyArray, "count 6"]) -> _OnPaper:
    xp = module_of(ray)
    height, local = xp.exp(view[:, 5:]), rotate(-view[:, :3], ray)
    depth = xp.maximum(local[:, 2:], 1e-2)
    foot = height * local[:, :2] / depth
    point = foot - view[:, 3:5]
    radius = xp.sqrt(xp.sum(point**2, axis=1) + 1e-12)
    towards = point / radius[:, None]
    fall = xp.concatenate([towards * height, -xp.sum(towards * foot, axis=1, keepdims=True)], axis=1) / depth
    return _OnPaper(foot, radius, towards, rotate(view[:, :3], fall))


def _ring_metric(o: Observations, seen: Rays, view: Float[AnyArray, "count 6"]) -> Float[AnyArray, " count"]:
    """1/|∇R|, R(u, v) the radius on the paper of the point that a pixel sees."""
    xp = module_of(view)
    gradient = xp.einsum("ni,nij->nj", _on_paper(seen.ray, view).fall, seen.slope)
    return 1 / xp.sqrt(xp.sum(gradient**2, axis=1) + 1e-12)


def _ring(
    o: Observations, parameters, seen: Rays, view: Float[AnyArray, "count 6"], held: Float[AnyArray, " count"]
) -> Residuals:
    """(R(u, v) − R_k ∓ width/2)/|∇R| ∓ shift: the distance in px of the edge point from the printed edge's image."""
    xp = module_of(parameters)
    paper = _on_paper(seen.ray, view)
    misfit = paper.radius - o.target[:, 0] - o.polarity * parameters[LENS_SIZE] / 2
    by_height = xp.sum(paper.towards * paper.foot, axis=1, keepdims=True)
    by_view = [by_rotation(view[:, :3], xp.cross(paper.fall, seen.ray)), -paper.towards, by_height]
    by_extra = xp.stack([-o.polarity / 2, xp.zeros_like(misfit)], axis=1)
    rows = xp.einsum("ni,nij->nj", paper.fall, seen.by_lens), by_extra, xp.concatenate(by_view, axis=1)
    return Residuals(
        (held * misfit - o.polarity * o.shift)[:, None], *((held[:, None] * part)[:, None] for part in rows)
    )


def _point(
    o: Observations, parameters, seen: Rays, view: Float[AnyArray, "count 6"], held: Float[AnyArray, " count"]
) -> Residuals:
    """Projected minus seen: already in px."""
    xp = module_of(parameters)
    scaled = o.target * xp.exp(parameters[None, LENS_SIZE:VIEWS_AT])
    height = xp.exp(view[:, 5:])
    across, down, away = (rotate(view[:, :3], xp.broadcast_to(unit, (len(o.pixel), 3))) for unit in xp.eye(3))
    place = scaled + view[:, 3:5]
    point = across * place[:, :1] + down * place[:, 1:] + away * height
    found = images(o.build, parameters[:LENS_SIZE], point)
    moment = xp.cross(xp.broadcast_to(point[:, None], found.by_point.shape), found.by_point)
    turn = by_rotation(xp.broadcast_to(view[:, None, :3], found.by_point.shape), moment)
    shifts = xp.einsum("npi,nik->npk", found.by_point, xp.stack([across, down, away * height], axis=2))
    by_extra = shifts[..., :2] * scaled[:, None]
    return Residuals(found.pixel - o.pixel, found.by_lens, by_extra, xp.concatenate([turn, shifts], axis=2))


class Circles(NamedTuple):
    """Best great circle of every line: its `normal` and how that turns with a change of Σ w d dᵀ, δn = −turn·(δΣ n);
    whether a line has the three points that it takes."""

    normal: Float[AnyArray, "lines 3"]
    turn: Float[AnyArray, "lines 3 3"]
    defined: Bool[AnyArray, " lines"]


def great_circles(o: Observations, ray: Float[AnyArray, "count 3"]) -> Circles:
    xp = module_of(ray)
    spread = sum_by_group(o.weight[:, None, None] * ray[:, :, None] * ray[:, None, :], o.group, o.groups)
    defined = sum_by_group(xp.where(o.weight > 0, 1.0, 0.0), o.group, o.groups) >= 3
    # a harmless matrix with distinct eigenvalues for the others
    spread = xp.where(defined[:, None, None], spread, xp.diag(xp.array([1.0, 2.0, 3.0]))[None])
    values, vectors = xp.linalg.eigh(spread)
    gain = 1 / xp.maximum(values[:, 1:] - values[:, :1], 1e-12)
    turn = xp.einsum("gik,gk,gjk->gij", vectors[:, :, 1:], gain, vectors[:, :, 1:])
    return Circles(vectors[:, :, 0], turn, defined)


def normals_by_lens(o: Observations, seen: Rays, circles: Circles) -> Float[AnyArray, "lines 3 8"]:
    """Derivatives of the normals by the lens."""
    xp, normal = module_of(seen.ray), circles.normal[o.group]
    distance, by_ray = xp.sum(normal * seen.ray, axis=1), xp.einsum("ni,nij->nj", normal, seen.by_lens)
    change = seen.by_lens * distance[:, None, None] + seen.ray[:, :, None] * by_ray[:, None]
    change = sum_by_group(o.weight[:, None, None] * change, o.group, o.groups)
    return -xp.einsum("gij,gjp->gip", circles.turn, change)


def _held_line_metric(o: Observations, parameters, seen: Rays) -> Float[np.ndarray, "count 10"]:
    """m, −(∂ ln m/∂lens)·lens and ∂ ln m/∂lens of m = 1/|∇(n·d)|, n the normal of the line's best great circle; on the
    host. m is 0 for lines without one."""
    circles, lens = great_circles(o, seen.ray), parameters[:LENS_SIZE]
    turned, slopes = normals_by_lens(o, seen, circles), np.zeros((len(o.group), LENS_SIZE))
    at_once = _line_metric(o, seen, circles.normal)
    used = np.nonzero(np.abs(seen.by_lens).max(axis=(0, 1)) > 0)[0]
    for column in used:
        step = _STEP * max(1.0, abs(lens[column]))
        ahead = rays(o.build, lens + step * np.eye(LENS_SIZE)[column], o.pixel)
        moved = _line_metric(o, ahead, circles.normal + step * turned[..., column])
        slopes[:, column] = np.log(moved / at_once) / step
    at_once = np.where(circles.defined[o.group], at_once, 0.0)
    return np.concatenate([at_once[:, None], -slopes @ lens[:, None], slopes], axis=1)


def _line_metric(o: Observations, seen: Rays, normal: Float[AnyArray, "lines 3"]) -> Float[AnyArray, " count"]:
    xp = module_of(normal)
    gradient = xp.einsum("ni,nij->nj", normal[o.group], seen.slope)
    return 1 / xp.sqrt(xp.sum(gradient**2, axis=1) + 1e-18)


def _line(
    o: Observations, parameters, seen: Rays, view: Float[AnyArray, "count 6"], held: Float[AnyArray, "count 10"]
) -> Residuals:
    """Sampson distance (n·d)/|∇(n·d)|, n found from the rays themselves (smallest eigenvector of Σ w d dᵀ)."""
    xp = module_of(parameters)
    circles = great_circles(o, seen.ray)
    normal = circles.normal[o.group]
    distance = xp.sum(normal * seen.ray, axis=1)
    turned = normals_by_lens(o, seen, circles)[o.group]
    by_lens = xp.einsum("ni,nij->nj", normal, seen.by_lens) + xp.einsum("ni,nip->np", seen.ray, turned)
    growth = held[:, 1] + held[:, 2:] @ parameters[:LENS_SIZE]
    # the metric may grow, which keeps rays from becoming one, but hardly shrink, which makes any misfit vanish
    scale = held[:, 0] * xp.exp(xp.clip(growth, -_LEAST_GROWTH, _MOST_GROWTH))
    by_scale = xp.where((growth > -_LEAST_GROWTH) & (growth < _MOST_GROWTH), distance, 0.0)
    by_lens = scale[:, None] * (by_lens + by_scale[:, None] * held[:, 2:])
    count = len(scale)
    return Residuals(
        (scale * distance)[:, None], by_lens[:, None], xp.zeros((count, 1, 2)), xp.zeros((count, 1, VIEW_SIZE))
    )


def _no_metric(o: Observations, seen: Rays, view: Float[AnyArray, "count 6"]) -> Float[AnyArray, " count"]:
    return module_of(view).ones_like(view[:, 0])


_METRICS = {"points": _no_metric, "rings": _ring_metric}
_RESIDUALS = {"points": _point, "rings": _ring, "lines": _line}
