"""C.-H. Lee & A. Rosenfeld, "Improved methods of estimating shape from shading using the light source coordinate
system", Artificial Intelligence 26 (1985) 125–143.

Every patch is taken for a piece of a sphere, seen from the light: there the slant is arccos E, and the tilt follows
from the first derivatives, n' ∝ −(E_τ, E_⊥/cos σ), with E_τ the derivative along the light's tilt, E_⊥ across it and
σ the light's slant. No second derivatives, so less noise than Pentland 1984.
"""

import numpy as np

from baselines.distant import DistantImage, Relief, derivatives, relief_from_slopes


def reconstruct(image: DistantImage) -> Relief:
    """Normals in the frame of the light, turned back, integrated; convex patches."""
    e_x, e_y, *_ = derivatives(image.values, image.mask, image.spacing)
    sx, sy, cosine = image.light
    sine, tilt = np.hypot(sx, sy), np.arctan2(sy, sx)
    along = e_x * np.cos(tilt) + e_y * np.sin(tilt)
    across = e_y * np.cos(tilt) - e_x * np.sin(tilt)
    length = np.hypot(along, across / cosine)
    slant_sine = np.sqrt(np.maximum(1 - image.values**2, 0))
    scale = np.where(length > 0, slant_sine / np.where(length > 0, length, 1), 0)
    a, b, c = -along * scale, -across / cosine * scale, image.values
    # light frame: x' = (cos τ cos σ, sin τ cos σ, −sin σ), y' = (−sin τ, cos τ, 0), z' = s
    nx = a * np.cos(tilt) * cosine - b * np.sin(tilt) + c * sx
    ny = a * np.sin(tilt) * cosine + b * np.cos(tilt) + c * sy
    nz = -a * sine + c * cosine
    known = image.mask & (image.values > 0) & (nz > 1e-3)
    nz = np.where(known, nz, 1)
    return relief_from_slopes(image, np.where(known, -nx / nz, np.nan), np.where(known, -ny / nz, np.nan))
