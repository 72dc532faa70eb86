"""Pictures for methods that assume a distant light and parallel rays: exact height, slopes and E on a square grid.

The vase and the lights (0, 0, 1) and (1, 0, 1) are those of the survey by Zhang, Tsai, Cryer & Shah (1999); sphere,
peaks and ripples are formulas. The square is one unit wide, height Z points to the viewer (see `baselines.distant`).
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from baselines.distant import DistantImage, reflectance
from scipy import ndimage

LIGHTS = {"(0,0,1)": (0.0, 0.0, 1.0), "(1,0,1)": (1.0, 0.0, 1.0)}


class DistantScene(NamedTuple):
    """Truth of one picture: height, slopes, the pixels that show the object, and the picture of every light."""

    height: np.ndarray
    p: np.ndarray
    q: np.ndarray
    mask: np.ndarray
    spacing: float

    def image(self, light: tuple[float, float, float]) -> DistantImage:
        unit = np.asarray(light, float) / np.linalg.norm(light)
        shading = np.maximum(reflectance(self.p, self.q, unit), 0)
        return DistantImage(np.where(self.mask, shading, 0), self.mask, unit, self.spacing)

    def summits(self) -> np.ndarray:
        """Rows (x, y, Z) of the highest points: local maxima over the eight neighbours in the mask, in pixels."""
        z = np.where(self.mask, self.height, -np.inf)
        highest = self.mask & (z >= ndimage.maximum_filter(z, 3, mode="constant", cval=-np.inf) - 1e-12)
        labels, count = ndimage.label(highest, np.ones((3, 3)))
        places = ndimage.center_of_mass(highest, labels, range(1, count + 1))
        nearest = [(round(y), round(x)) for y, x in places]
        return np.array([(x, y, self.height[y, x]) for y, x in nearest])

    def rim(self) -> np.ndarray:
        """Pixels of the mask with a neighbour outside it, or at the picture's edge."""
        return self.mask & ~ndimage.binary_erosion(self.mask, border_value=0)

    def depth(self) -> float:
        """Extent in Z: what errors are relative to."""
        return float(np.ptp(self.height[self.mask]))


def vase(x, y):
    """Z = √(f(y)² − x²) of the survey's vase, y upwards from 0 to 1."""
    upwards = 0.5 - y
    up = np.clip(upwards, 0, 1)
    f = 0.15 - 0.1 * up * (6 * up + 1) ** 2 * (up - 1) ** 2 * (3 * up - 2)
    a, b, c = 6 * up + 1, up - 1, 3 * up - 2
    f_up = -0.1 * (a**2 * b**2 * c + up * (12 * a * b**2 * c + 2 * a**2 * b * c + 3 * a**2 * b**2))
    z = np.sqrt(np.maximum(f**2 - x**2, 1e-12))
    return z, -x / z, -f * f_up / z, np.abs(x) < 0.98 * f


def sphere(x, y, radius=0.45):
    """Half a ball, to a slope of about 4.9."""
    z = np.sqrt(np.maximum(radius**2 - x**2 - y**2, 1e-12))
    return z, -x / z, -y / z, np.hypot(x, y) < 0.98 * radius


def peaks(x, y):
    """Three bumps and a dent on a dome that falls to the border."""
    z, p, q = -0.5 * (x**2 + y**2), -x, -y
    for x0, y0, size, height in ((-0.2, -0.15, 0.12, 0.12), (0.22, -0.1, 0.1, 0.09), (0.0, 0.24, 0.13, 0.1),
                                 (0.02, -0.02, 0.07, -0.04)):  # fmt: skip
        bump = height * np.exp(-((x - x0) ** 2 + (y - y0) ** 2) / (2 * size**2))
        z, p, q = z + bump, p - bump * (x - x0) / size**2, q - bump * (y - y0) / size**2
    return z, p, q, np.ones_like(x, bool)


def ripples(x, y, a=0.025, k=4 * np.pi, b=0.15):
    """Egg crate Z = a cos kx cos ky − b (x² + y²): nine crests and many saddles."""
    z = a * np.cos(k * x) * np.cos(k * y) - b * (x**2 + y**2)
    p = -a * k * np.sin(k * x) * np.cos(k * y) - 2 * b * x
    q = -a * k * np.cos(k * x) * np.sin(k * y) - 2 * b * y
    return z, p, q, np.ones_like(x, bool)


FORMULAS: dict[str, Callable] = {"vase": vase, "sphere": sphere, "peaks": peaks, "ripples": ripples}


def distant_scene(name: str, size: int) -> DistantScene:
    """The scene `name` on `size` x `size` pixels."""
    steps = np.linspace(-0.5, 0.5, size)
    x, y = np.meshgrid(steps, steps)
    z, p, q, mask = FORMULAS[name](x, y)
    return DistantScene(np.where(mask, z, 0), np.where(mask, p, 0), np.where(mask, q, 0), mask, 1 / (size - 1))
