"""Residuals in px of all kinds of targets, with their derivatives.

A residual is a misfit on the ray sphere or on the paper times a metric in px per unit of it. Derivatives are those of
the misfit alone; those of the metric need the second derivatives of the lens, which take long to compile. For rings the
metric is computed from the parameters at which a solve starts, and held, so that residual and derivative belong to one
objective; points and lines cannot do so, see `live_residuals`.
"""

from typing import NamedTuple

from jaxtyping import Bool, Float

from jaxsfs.calibration._arrays import AnyArray, module_of, sum_by_group
from jaxsfs.calibration._lens import LENS_SIZE, Rays, images, rays
from jaxsfs.calibration._plane import by_rotation, rotate
from jaxsfs.calibration._problem import VIEW_SIZE, VIEWS_AT, Observations


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
    """px per unit of each row's misfit at these parameters, `seen` being what `look` returns for them."""
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


def _line_metric(o: Observations, seen: Rays, view: Float[AnyArray, "count 6"]) -> Float[AnyArray, " count"]:
    """1/|∇(n·d)|, n the normal of the line's best great circle; 0 for lines without one."""
    xp = module_of(view)
    circles, group = great_circles(o, seen.ray), o.group
    gradient = xp.einsum("ni,nij->nj", circles.normal[group], seen.slope)
    return xp.where(circles.defined[group], 1 / xp.sqrt(xp.sum(gradient**2, axis=1) + 1e-18), 0.0)


def _line(
    o: Observations, parameters, seen: Rays, view: Float[AnyArray, "count 6"], held: Float[AnyArray, " count"]
) -> Residuals:
    """Sampson distance (n·d)/|∇(n·d)|, n found from the rays themselves (smallest eigenvector of Σ w d dᵀ)."""
    xp = module_of(parameters)
    circles = great_circles(o, seen.ray)
    normal = circles.normal[o.group]
    distance = xp.sum(normal * seen.ray, axis=1)
    turned = normals_by_lens(o, seen, circles)[o.group]
    by_lens = xp.einsum("ni,nij->nj", normal, seen.by_lens) + xp.einsum("ni,nip->np", seen.ray, turned)
    rows = by_lens, xp.zeros((len(held), 2)), xp.zeros((len(held), VIEW_SIZE))
    return Residuals((held * distance)[:, None], *((held[:, None] * part)[:, None] for part in rows))


def _no_metric(o: Observations, seen: Rays, view: Float[AnyArray, "count 6"]) -> Float[AnyArray, " count"]:
    return module_of(view).ones_like(view[:, 0])


_METRICS = {"points": _no_metric, "rings": _ring_metric, "lines": _line_metric}
_RESIDUALS = {"points": _point, "rings": _ring, "lines": _line}
