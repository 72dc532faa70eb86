"""Parts of the picture that lie wholly behind occluding contours: the brightness leaves their range open.

Such a part, the valley behind a fold that runs all round, gets nothing from the picture's rim, and no front may enter
it. Its own brightness allows every range between two solutions: the one that goes on where the contour ends (no jump:
what is hidden cannot be nearer than what hides it) and the one whose points face the light wherever nothing says
otherwise (the largest jump). We enter it at a given share of the way between the two, in ln r.
"""

import cv2
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float
from scipy import ndimage

Image = Float[Array, "height width"]
Mask = Bool[np.ndarray, "height width"]

# Chosen on folded tubes of tuning seeds, as the most that never makes the error larger than it is without contours:
# 0 (no jump) gains nothing where folds hide much; 0.3 gains more in the mean but loses a fifth where they hide little.
_SHARE = 0.2
_ANY = np.ones((3, 3), bool)
_LESS = 1e-3  # ln r: a contour is nearer than the part beside it when it is nearer by more


def entries(
    usable: Mask, contours: Mask, w: Float[np.ndarray, "height width"], whole: Float[np.ndarray, "height width"]
) -> Mask:
    """Pixels beside the contours of parts that are wholly behind them.

    `w`: solution with contours cut. `whole`: the same with the contours' own pixels, which have the nearer side's
    range. A part lies behind its contours if it does not touch the picture's rim and most of the contour beside it is
    nearer.
    """
    inside = usable & ~contours
    count, labels = cv2.connectedComponents(inside.astype(np.uint8), connectivity=8)
    parts = np.asarray(labels, np.intp)
    filled = np.asarray(ndimage.binary_fill_holes(usable), bool)
    at_rim = inside & ~np.asarray(ndimage.binary_erosion(filled, _ANY), bool)
    nearest = ndimage.minimum_filter(np.where(contours, whole, np.inf), 3)
    border = inside & np.isfinite(nearest)
    beside = np.bincount(parts[border], minlength=count)
    nearer = np.bincount(parts[border & (nearest < w - _LESS)], minlength=count)
    behind = nearer > 0.5 * np.maximum(beside, 1)
    behind[parts[at_rim]] = False
    return border & behind[parts]


def limits_behind(
    entering: Bool[Array, "height width"], contours: Bool[Array, "height width"], w: Image, whole: Image, limit: Image
) -> Image:
    """Deadlines with those of `entering` brought forward towards the contour beside them."""
    padded = jnp.pad(jnp.where(contours, whole, jnp.inf), 1, constant_values=jnp.inf)
    height, width = w.shape
    windows = [padded[dv : dv + height, du : du + width] for dv in range(3) for du in range(3)]
    nearest = jnp.min(jnp.stack(windows), axis=0)
    nearest = jnp.where(entering, nearest, 0)
    brought = nearest + _SHARE * jnp.maximum(w - nearest, 0)
    return jnp.where(entering, jnp.minimum(limit, brought), limit)
