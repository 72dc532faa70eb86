"""The part of an endoscope picture that shows something: a round or octagonal field inside a dark border."""

from typing import Literal

import cv2
import equinox as eqx
import numpy as np
from jaxtyping import Bool, Float

Shape = Literal["round", "straight-sided", "irregular", "whole image"]

_SMALLEST_IMAGE = 16  # px; below this there is no telling a border from a picture
_DARKEST_BORDER = 0.12  # stored value: no border is brighter (video black is 16/255 = 0.063)
_ABOVE_BORDER = 6 / 255  # a lit pixel is at least this much brighter than the border …
_NOISE_FACTOR = 4.0  # … and than this many standard deviations of the border's noise
_SMALLEST_FIELD = 0.005  # share of the image
_SMALLEST_BORDER = 0.003
_NEARLY_CONVEX = 0.85  # field over its convex hull
_THRESHOLDS = (0.08, 0.12, 0.18, 0.25)  # tried beside the lowest one: shares of the way from border to field …
_MUCH_STEEPER = 3.0  # … and taken where the rim is this much steeper there, which says that the border glows …
_NOT_MUCH_SMALLER = 0.75  # … and the region this large at least
_KINK = 1.6  # the step over the rim, over that just outside it; a corner that vignetting darkens has about 1
_EROSION_PX = (2, 8)
_BAY_DEPTH = 0.2  # of its length
_SMALLEST_BAY = 0.0005  # share of the image

Grey = Float[np.ndarray, "height width"]
Mask = Bool[np.ndarray, "height width"]
Circle = tuple[np.ndarray, float]  # centre (u, v) and radius in px


class FieldMask(eqx.Module):
    """`mask`: the pixels inside the field, the blurred rim left out. `shape` and `description` say what was found;
    `share`: part of the image that the mask holds, in [0, 1]."""

    mask: Mask
    shape: Shape
    share: float
    description: str


def find_field(photo: Float[np.ndarray, "height width *channels"]) -> FieldMask:
    """The lit field of an endoscope picture, found by its dark border; the whole image where there is none.

    A border is dark, even, reaches at least two corners of the image, and ends in a step. The field is the largest
    bright region, its holes filled (a lumen is dark too), made convex when it nearly is (a lumen at the rim), but not
    beyond the circle when it is round; its rim is taken off as far as it is blurred, 2 to 8 px.

    `photo`: (height, width) or (height, width, channels), stored values in [0, 1]. Raises nothing: a picture that is
    dark all over has no border either.
    """
    height, width = photo.shape[:2]
    brightest = photo.max(axis=2) if photo.ndim == 3 else photo
    whole = FieldMask(np.ones((height, width), bool), "whole image", 1.0, "no dark border: the whole image")
    if min(height, width) < _SMALLEST_IMAGE:
        return whole
    smooth = cv2.GaussianBlur(np.ascontiguousarray(brightest, np.float32), (0, 0), 1.2)
    level, lowest = _border(smooth)
    if level > _DARKEST_BORDER:
        return whole
    lit = _region_brighter_than(lowest, smooth)
    if lit.mean() < _SMALLEST_FIELD:
        return whole
    typical = float(np.median(smooth[lit]))
    lit = _without_glow(lit, [level + share * (typical - level) for share in _THRESHOLDS], smooth)
    corners = sum(not lit[v, u] for v in (0, -1) for u in (0, -1))
    if corners < 2 or not _SMALLEST_FIELD < lit.mean() < 1 - _SMALLEST_BORDER or not _ends_in_kink(smooth, lit):
        return whole
    mask, shape, circle = _shaped(lit)
    mask = _eroded(mask, smooth, circle)
    return FieldMask(mask, shape, float(mask.mean()), _words(mask, shape))


def _border(smooth: Grey) -> tuple[float, float]:
    """Level of the dark border, if there is one, and the value above which a pixel is lit."""
    ring = np.concatenate([smooth[:2].ravel(), smooth[-2:].ravel(), smooth[:, :2].ravel(), smooth[:, -2:].ravel()])
    # The dark end of the ring: a field that reaches the image borders leaves little more than the corners.
    level = float(np.percentile(ring, 10))
    near = ring[ring < level + 2 * _ABOVE_BORDER]
    noise = 1.4826 * float(np.median(np.abs(near - np.median(near))))
    return level, level + max(_ABOVE_BORDER, _NOISE_FACTOR * noise)


def _region_brighter_than(threshold: float, smooth: Grey) -> Mask:
    """The largest region above `threshold`, with its holes."""
    # Opening takes away noise, and the letters that machines write into the border.
    bright = cv2.morphologyEx((smooth > threshold).astype(np.uint8), cv2.MORPH_OPEN, _disc(2))
    return _filled(_largest_region(bright > 0))


def _largest_region(mask: Mask) -> Mask:
    count, labels, statistics, _ = cv2.connectedComponentsWithStats(mask.astype(np.uint8), connectivity=4)
    if count < 2:
        return np.zeros(mask.shape, bool)
    return labels == 1 + int(np.argmax(statistics[1:, cv2.CC_STAT_AREA]))


def _without_glow(lit: Mask, thresholds: list[float], smooth: Grey) -> Mask:
    """`lit`, or the region above one of the higher `thresholds` where that ends in a much steeper rim."""
    candidates = [_region_brighter_than(threshold, smooth) for threshold in thresholds]
    candidates = [region for region in candidates if region.sum() > _NOT_MUCH_SMALLER * lit.sum()]
    best = max([lit, *candidates], key=lambda region: _steepness(smooth, region))
    return best if _steepness(smooth, best) > _MUCH_STEEPER * _steepness(smooth, lit) else lit


def _filled(region: Mask) -> Mask:
    """`region` and the holes in it: all that the surround does not reach from the image border."""
    count, labels = cv2.connectedComponents((~region).astype(np.uint8), connectivity=4)
    labels = np.asarray(labels, np.int32)
    outside = np.zeros(count, bool)
    for side in (labels[0], labels[-1], labels[:, 0], labels[:, -1]):
        outside[side] = True
    outside[0] = False  # label 0 is the region itself
    return ~outside[labels]


def _steepness(smooth: Grey, region: Mask) -> float:
    """Mean rise of brightness over the region's rim; a threshold is right where this is largest."""
    if not region.any() or region.all():
        return 0.0
    inside, outside = _bands(smooth, region, (0, 2)), _bands(smooth, ~region, (0, 2))
    return float(inside.mean() - outside.mean())


def _ends_in_kink(smooth: Grey, region: Mask) -> bool:
    """Whether the rim is a step out of an even surround, not one contour of a gradual darkening."""
    inside, near, far = (
        _bands(smooth, region, (2, 5)),
        _bands(smooth, ~region, (2, 5)),
        _bands(smooth, ~region, (8, 11)),
    )
    if not inside.size or not near.size or not far.size:
        return False
    step, outside = np.mean(inside) - np.mean(near), np.mean(near) - np.mean(far)
    return bool(step > _KINK * max(outside, 0.25 * _ABOVE_BORDER))


def _bands(smooth: Grey, region: Mask, distances: tuple[int, int]) -> np.ndarray:
    """Values of the pixels of `region` that lie at these distances (px) from its rim."""
    inward = _distance_inside(region)
    return smooth[(inward > distances[0]) & (inward <= distances[1])]


def _shaped(lit: Mask) -> tuple[Mask, Shape, Circle | None]:
    """The field with the bays that dark tissue leaves in its rim filled up, what it looks like, and its circle."""
    contour = max(cv2.findContours(lit.astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)[0], key=len)
    hull_points = cv2.convexHull(contour)
    hull = _polygon(hull_points, lit.shape)
    if lit.sum() < _NEARLY_CONVEX * hull.sum():
        radius = max(2, round(0.01 * min(lit.shape)))
        closed = cv2.morphologyEx(np.pad(lit, radius, mode="edge").astype(np.uint8), cv2.MORPH_CLOSE, _disc(radius)) > 0
        return _filled(closed[radius:-radius, radius:-radius]), "irregular", None
    rim = _off_image_border(_polygon_rim(hull), lit.shape)
    circle = _circle(rim)
    if circle is None:
        return lit | _bays(lit, hull), "irregular", None
    centre, radius, misfit = circle
    if misfit < min(_polygon_misfit(hull_points, rim), 0.02 * radius):
        inside = _disc_mask((centre, radius + 1), lit.shape)
        return lit | _bays(lit, hull & inside), "round", (centre, radius + 1)
    return lit | _bays(lit, hull), "straight-sided", None


def _bays(lit: Mask, hull: Mask) -> Mask:
    """The deep parts of `hull` that are not lit: a lumen at the rim. Where the rim itself is hollow, as after a lens's
    distortion was removed, the dent is shallow, and it shows nothing."""
    count, labels, statistics, _ = cv2.connectedComponentsWithStats((hull & ~lit).astype(np.uint8), connectivity=4)
    depth = _distance_inside(hull)
    bays = np.zeros(lit.shape, bool)
    for label in range(1, count):
        left, top, width, height, area = statistics[label]
        if area < _SMALLEST_BAY * lit.size:
            continue
        box = np.s_[top : top + height, left : left + width]
        region = labels[box] == label
        if depth[box][region].max() > _BAY_DEPTH * np.hypot(width, height):
            bays[box] |= region
    return bays


def _polygon(points: np.ndarray, shape: tuple[int, ...]) -> Mask:
    canvas = np.zeros(shape, np.uint8)
    cv2.fillPoly(canvas, [points.astype(np.int32)], 1)
    return canvas > 0


def _polygon_rim(mask: Mask) -> np.ndarray:
    """(n, 2) rim pixels (u, v) of a convex mask, each once."""
    contour = cv2.findContours(mask.astype(np.uint8), cv2.RETR_EXTERNAL, cv2.CHAIN_APPROX_NONE)[0][0]
    return contour[:, 0].astype(float)


def _off_image_border(rim: np.ndarray, shape: tuple[int, ...]) -> np.ndarray:
    height, width = shape
    inner = (rim > 2).all(axis=1) & (rim[:, 0] < width - 3) & (rim[:, 1] < height - 3)
    return rim[inner]


def _circle(rim: np.ndarray) -> tuple[np.ndarray, float, float] | None:
    """Centre, radius and median misfit (px) of the circle through most of the rim; None without enough of it.

    Algebraic fit (Kåsa), repeated without the worst points: a notch or a cut is not part of the circle.
    """
    if len(rim) < 12:
        return None
    misfit = np.zeros(len(rim))
    centre, radius = rim.mean(axis=0), 0.0
    for _ in range(5):
        kept = rim[misfit <= np.percentile(misfit, 80)]
        system = np.column_stack([2 * kept, np.ones(len(kept))])
        solution, *_ = np.linalg.lstsq(system, (kept**2).sum(axis=1), rcond=None)
        centre = solution[:2]
        radius = float(np.sqrt(max(solution[2] + centre @ centre, 0.0)))
        misfit = np.abs(np.hypot(*(rim - centre).T) - radius)
    return centre, radius, float(np.median(misfit))


def _polygon_misfit(hull_points: np.ndarray, rim: np.ndarray) -> float:
    """Median distance (px) of the rim from the best polygon of at most eight corners."""
    perimeter = cv2.arcLength(hull_points, True)
    share = 0.002
    polygon = cv2.approxPolyDP(hull_points, share * perimeter, True)
    while len(polygon) > 8:
        share *= 1.3
        polygon = cv2.approxPolyDP(hull_points, share * perimeter, True)
    polygon = polygon.astype(np.float32)
    distances = [abs(cv2.pointPolygonTest(polygon, (float(u), float(v)), True)) for u, v in rim[:: len(rim) // 400 + 1]]
    return float(np.median(distances))


def _eroded(mask: Mask, smooth: Grey, circle: Circle | None) -> Mask:
    """Without the rim, as far in as it is blurred."""
    low, high = _EROSION_PX
    # Where the image border cuts the field, the rim goes on beyond it.
    margin = high + 1
    beyond = np.pad(mask, margin, mode="edge")
    if circle is not None:
        (u, v), radius = circle
        continued = _disc_mask((np.array([u + margin, v + margin]), radius), beyond.shape)
        continued[margin:-margin, margin:-margin] = True
        beyond &= continued
    inward = _distance_inside(beyond)[margin:-margin, margin:-margin]
    rings = [smooth[(inward > d) & (inward <= d + 1)] for d in range(high + 5)]
    levels = [float(np.median(ring)) if ring.size else 0.0 for ring in rings]
    # A blurred ring is darker than the trend of the rings inside it; one that is only darker lit follows the trend.
    depth = next((d for d in range(low, high) if levels[d] >= 0.95 * (2 * levels[d + 2] - levels[d + 4])), high)
    return _largest_region(inward > depth)


def _disc_mask(circle: Circle, shape: tuple[int, ...]) -> Mask:
    (centre_u, centre_v), radius = circle
    v, u = np.ogrid[: shape[0], : shape[1]]
    return (u - centre_u) ** 2 + (v - centre_v) ** 2 < radius**2


def _distance_inside(mask: Mask) -> Grey:
    """Distance (px) to the nearest pixel outside the mask; the image's own border is no rim."""
    return cv2.distanceTransform(mask.astype(np.uint8), cv2.DIST_L2, 5)


def _disc(radius: int) -> np.ndarray:
    return cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * radius + 1, 2 * radius + 1))


def _words(mask: Mask, shape: Shape) -> str:
    sides = {"top": mask[0], "bottom": mask[-1], "left": mask[:, 0], "right": mask[:, -1]}
    cut = [name for name, side in sides.items() if side.any()]
    where = f", cut by the image border ({', '.join(cut)})" if cut else ""
    rows, columns = np.nonzero(mask.any(axis=1))[0], np.nonzero(mask.any(axis=0))[0]
    if not len(rows):
        return "no field"
    size = f"{columns[-1] - columns[0] + 1} x {rows[-1] - rows[0] + 1} px"
    return f"{shape} field of {size}{where}, {mask.mean():.0%} of the image"
