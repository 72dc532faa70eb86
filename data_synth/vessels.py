"""Blood under a surface: vessels and patches that darken green and blue far more than red."""

import numpy as np
from jaxtyping import Float
from scipy import ndimage

from data_synth.effects import TISSUE, Colour
from data_synth.viewing import View
from jaxsfs.forms import Scalar

# What blood takes from each channel relative to green: haemoglobin absorbs at 620 nm about an eighth of what it does
# at 540 nm (red here is a broad band about 620 nm), and about as much in the blue as in the green.
EXTINCTION = np.array([0.13, 1.0, 0.95])


def vessel_colours(
    view: View, *, seed: int, vessels: int = 12, strength: Scalar = 0.5, colour: Colour = TISSUE
) -> Float[np.ndarray, "height width 3"]:
    """Body colours k_d exp(−c·EXTINCTION): c is 0 to about 1.5 `strength`, in winding vessels and in smooth patches
    (Beer–Lambert). Albedo varies, so luminance is no longer shading. The same for the same seed."""
    rng = np.random.default_rng(seed)
    height, width = view.surface.range.shape
    short = min(height, width)
    patches = ndimage.gaussian_filter(rng.standard_normal((height, width)), 0.15 * short, mode="wrap")
    blood = 0.25 * strength * (1 + np.tanh(patches / patches.std()))
    lines = np.zeros((height, width))
    for _ in range(vessels):
        u, v, heading = rng.uniform(0, width), rng.uniform(0, height), rng.uniform(0, 2 * np.pi)
        for _ in range(2 * short):
            heading += rng.normal(0, 0.08)
            u, v = u + np.cos(heading), v + np.sin(heading)
            if 0 <= u < width - 1 and 0 <= v < height - 1:
                lines[round(v), round(u)] = 1
    sigma = max(0.8, 0.006 * short)
    soft = ndimage.gaussian_filter(lines, sigma)
    blood = blood + strength * np.minimum(soft / max(np.percentile(soft[lines > 0], 50), 1e-9), 1.0)
    return np.asarray(colour, float) * np.exp(-blood[..., None] * EXTINCTION)
