"""Words that all methods for a distant light share: image, reflectance map, differences on a mask, integration.

Height Z points towards the viewer; x right, y down (array `[y, x]`), p = Z_x, q = Z_y; the normal is
(−p, −q, 1)/√(1 + p² + q²) and E = R(p, q) = max(0, n·s), s the unit vector to the light, albedo 1 (Horn 1975).
"""

from typing import NamedTuple

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import factorized

STEEPEST = 20.0  # slopes beyond are cut: an occluding contour has infinite ones


class DistantImage(NamedTuple):
    """What every method reads: E in [0, 1], the pixels that show the object, unit light, length of a pixel."""

    values: np.ndarray
    mask: np.ndarray
    light: np.ndarray
    spacing: float

    @property
    def frontal(self) -> bool:
        return bool(self.light[2] > 1 - 1e-9)


class Relief(NamedTuple):
    """What every method returns: height (up to a constant) and slopes, NaN where the method has no answer."""

    height: np.ndarray
    p: np.ndarray
    q: np.ndarray


def reflectance(p, q, light):
    """R(p, q), not clamped: negative where the surface faces away from the light."""
    return (light[2] - p * light[0] - q * light[1]) / np.sqrt(1 + p**2 + q**2)


def reflectance_slopes(p, q, light):
    """R_p and R_q."""
    length2 = 1 + p**2 + q**2
    value = (light[2] - p * light[0] - q * light[1]) / length2**1.5
    return -light[0] / np.sqrt(length2) - p * value, -light[1] / np.sqrt(length2) - q * value


def clipped(p, q):
    """Slopes no steeper than `STEEPEST`, direction kept."""
    steep = np.maximum(np.hypot(p, q) / STEEPEST, 1)
    return p / steep, q / steep


class Grid:
    """Differences and means along the edges between neighbouring pixels of a mask, as sparse matrices.

    `difference_x @ z` is ΔZ/spacing on horizontal edges, `mean_x @ p` the mean of both ends; likewise y. `vector` and
    `image` go from picture to the vector of masked pixels and back (NaN outside).
    """

    def __init__(self, mask: np.ndarray, spacing: float):
        self.mask, self.spacing = mask, spacing
        self.count = int(mask.sum())
        index = np.full(mask.shape, -1)
        index[mask] = np.arange(self.count)
        right = mask[:, :-1] & mask[:, 1:]
        below = mask[:-1] & mask[1:]
        self.difference_x, self.mean_x = self._edges(index[:, :-1][right], index[:, 1:][right])
        self.difference_y, self.mean_y = self._edges(index[:-1][below], index[1:][below])
        self.laplacian = (
            self.difference_x.T @ self.difference_x + self.difference_y.T @ self.difference_y
        ).tocsc()  # positive: −∇²
        self._solve = None

    def _edges(self, first, second):
        rows, ones = np.arange(len(first)), np.ones(len(first))
        shape = (len(first), self.count)
        a = sparse.csr_matrix((ones, (rows, first)), shape)
        b = sparse.csr_matrix((ones, (rows, second)), shape)
        return ((b - a) / self.spacing).tocsr(), ((a + b) / 2).tocsr()

    def vector(self, image: np.ndarray) -> np.ndarray:
        return np.asarray(image, float)[self.mask]

    def image(self, vector: np.ndarray) -> np.ndarray:
        picture = np.full(self.mask.shape, np.nan)
        picture[self.mask] = vector
        return picture

    def integrate(self, p: np.ndarray, q: np.ndarray) -> np.ndarray:
        """Z of least squares ∬ (Z_x − p)² + (Z_y − q)² (Horn & Brooks 1986; a Poisson equation), vectors in and out.

        Free at the rim; each connected part has mean zero up to a very weak pull.
        """
        if self._solve is None:
            weak = 1e-9 / self.spacing**2
            self._solve = factorized((self.laplacian + weak * sparse.identity(self.count)).tocsc())
        divergence = self.difference_x.T @ (self.mean_x @ p) + self.difference_y.T @ (self.mean_y @ q)
        return self._solve(divergence)

    def slopes(self, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Central differences of Z (one-sided at the rim), as the mean of the adjacent edges."""
        across, down = np.asarray(self.mean_x.sum(0))[0], np.asarray(self.mean_y.sum(0))[0]
        p = (self.mean_x.T @ (self.difference_x @ z)) / np.maximum(across, 0.5)
        q = (self.mean_y.T @ (self.difference_y @ z)) / np.maximum(down, 0.5)
        return p, q

    def mean_of_neighbours(self, values: np.ndarray) -> np.ndarray:
        """Mean over the four neighbours in the mask: v − (spacing²/degree)(−∇²v)."""
        degree = self.laplacian.diagonal() * self.spacing**2
        return values - self.spacing**2 * (self.laplacian @ values) / np.maximum(degree, 1)


def relief_from_slopes(image: DistantImage, p: np.ndarray, q: np.ndarray) -> Relief:
    """Integrates slopes given as pictures; pixels without slopes count as flat in the integration."""
    grid = Grid(image.mask, image.spacing)
    p, q = clipped(grid.vector(np.nan_to_num(p)), grid.vector(np.nan_to_num(q)))
    return Relief(grid.image(grid.integrate(p, q)), grid.image(p), grid.image(q))


def derivatives(values: np.ndarray, mask: np.ndarray, spacing: float):
    """E_x, E_y, E_xx, E_xy, E_yy by central differences; NaN where the stencil leaves the mask."""
    e = np.where(mask, values, np.nan)
    e_y, e_x = np.gradient(e, spacing)
    e_xy = np.gradient(e_x, spacing, axis=0)
    padded = np.pad(e, 1, constant_values=np.nan)
    e_xx = (padded[1:-1, 2:] - 2 * e + padded[1:-1, :-2]) / spacing**2
    e_yy = (padded[2:, 1:-1] - 2 * e + padded[:-2, 1:-1]) / spacing**2
    return e_x, e_y, e_xx, e_xy, e_yy
