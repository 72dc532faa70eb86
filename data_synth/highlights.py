"""What makes the highlights of a wet, coloured surface hard: tissue of uneven colour, and sparse glints."""

import numpy as np
from jaxtyping import Float
from scipy import ndimage

from data_synth.effects import LUMINANCE, TISSUE, Colour
from data_synth.viewing import View
from jaxsfs.forms import Scalar


def tissue_colours(
    view: View, *, seed: int, variation: Scalar = 0.04, colour: Colour = TISSUE, patch: Scalar = 0.12
) -> Float[np.ndarray, "height width 3"]:
    """Body colours that drift over the picture: k_d exp(`variation` · smooth noise), all of the luminance of `colour`.

    Only the hue and the saturation vary, so that E stays the shading. `variation`: standard deviation of ln k_d per
    channel; `patch`: σ of the patches as a share of the short side. The same for the same seed.
    """
    height, width = view.surface.range.shape
    noise = np.random.default_rng(seed).standard_normal((height, width, 3))
    sigma = patch * min(height, width)
    smooth = ndimage.gaussian_filter(noise, (sigma, sigma, 0), mode="wrap")
    smooth /= smooth.std(axis=(0, 1))
    colours = np.asarray(colour, float) * np.exp(variation * smooth)
    return colours * (LUMINANCE @ np.asarray(colour, float) / (colours @ LUMINANCE))[..., None]


def wet_glints(
    view: View, *, seed: int, count: int = 25, strength: Scalar = 3.0, size: Scalar = 0.006
) -> Float[np.ndarray, "height width"]:
    """Sparse highlights of a wet surface, as c_I in the unit of E: elongated spots, most where it faces the light.

    Small ripples turn the normal to the light at places that the smooth surface does not show: more often where θ is
    small (weight cos⁸θ). `strength`: typical peak relative to the local E; `size`: σ of a spot's short axis as a
    share of the short side. The same for the same seed.
    """
    rng = np.random.default_rng(seed)
    valid = np.asarray(view.surface.valid)
    weight = np.where(valid, np.asarray(view.cosines), 0).ravel() ** 8
    height, width = valid.shape
    places = rng.choice(height * width, size=count, p=weight / weight.sum())
    shading = np.asarray(view.irradiance.values)
    v, u = np.indices(valid.shape)
    glints = np.zeros(valid.shape)
    for place in places:
        row, column = divmod(int(place), width)
        angle, peak = rng.uniform(0, np.pi), strength * rng.uniform(0.3, 2) * shading[row, column]
        short = max(0.7, size * min(height, width) * rng.uniform(0.6, 1.6))
        along = (u - column) * np.cos(angle) + (v - row) * np.sin(angle)
        across = (v - row) * np.cos(angle) - (u - column) * np.sin(angle)
        stretched = along / rng.uniform(1, 3)
        glints += peak * np.exp(-(stretched**2 + across**2) / (2 * short**2))
    return np.where(valid, glints, 0)
