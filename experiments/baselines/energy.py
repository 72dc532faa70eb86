"""The energy that Horn 1990, Szeliski 1991 and Lai & Vemuri 1997 minimise, on the pixels of a mask.

    ∬ (E − R(p, q))² + λ (|∇p|² + |∇q|²) + μ ((Z_x − p)² + (Z_y − q)²)

over height and slopes at once. Z and slopes belong to pixels, differences and means to the edges between them, so no
checkerboard is free. Slopes on the rim may be held.
"""

from typing import NamedTuple

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import spsolve

from baselines.distant import DistantImage, Grid, reflectance, reflectance_slopes


class Unknowns(NamedTuple):
    """Vectors over the masked pixels; z in the unit of the picture's width."""

    p: np.ndarray
    q: np.ndarray
    z: np.ndarray


class Energy:
    """Values, gradients and a Gauss–Newton matrix of the energy for one picture."""

    def __init__(self, image: DistantImage, rim_p: np.ndarray, rim_q: np.ndarray):
        self.image = image
        self.grid = Grid(image.mask, image.spacing)
        self.values = self.grid.vector(image.values)
        self.held = np.isfinite(self.grid.vector(rim_p))
        self.rim = np.nan_to_num(self.grid.vector(rim_p)), np.nan_to_num(self.grid.vector(rim_q))
        self.free = np.where(self.held, 0.0, 1.0)

    def start(self) -> Unknowns:
        """Rim slopes continued harmonically inwards, integrated: a start that breaks the symmetry of a flat one."""
        p, q = (self._harmonic(rim) for rim in self.rim)
        return Unknowns(p, q, self.grid.integrate(p, q))

    def _harmonic(self, rim):
        free = sparse.diags(self.free)
        matrix = free @ self.grid.laplacian + sparse.diags(1.0 * self.held)
        matrix = matrix + 1e-9 * sparse.identity(self.grid.count)
        return spsolve(matrix.tocsc(), np.where(self.held, rim, 0.0))

    def shade(self, x: Unknowns):
        """R clamped at 0, and its slopes (0 in shadow)."""
        value = reflectance(x.p, x.q, self.image.light)
        lit = value > 0
        slopes = reflectance_slopes(x.p, x.q, self.image.light)
        return np.maximum(value, 0), *(np.where(lit, slope, 0) for slope in slopes)

    def value(self, x: Unknowns, smooth: float, integrable: float) -> float:
        g = self.grid
        misfit = self.values - self.shade(x)[0]
        rough = x.p @ (g.laplacian @ x.p) + x.q @ (g.laplacian @ x.q)
        a, b = self._gaps(x)
        return float(misfit @ misfit + smooth * rough + integrable * (a @ a + b @ b))

    def gradient(self, x: Unknowns, smooth: float, integrable: float) -> Unknowns:
        """Half the gradient; zero for held slopes."""
        g = self.grid
        shade, by_p, by_q = self.shade(x)
        misfit = self.values - shade
        a, b = self._gaps(x)
        p = -misfit * by_p + smooth * (g.laplacian @ x.p) - integrable * (g.mean_x.T @ a)
        q = -misfit * by_q + smooth * (g.laplacian @ x.q) - integrable * (g.mean_y.T @ b)
        z = integrable * (g.difference_x.T @ a + g.difference_y.T @ b)
        return Unknowns(self.free * p, self.free * q, z)

    def curvature(self, x: Unknowns, d: Unknowns, smooth: float, integrable: float) -> float:
        """dᵀ H d with the Gauss–Newton H: exact for the quadratic terms."""
        g = self.grid
        _, by_p, by_q = self.shade(x)
        change = by_p * d.p + by_q * d.q
        a, b = self._gaps(d)
        rough = d.p @ (g.laplacian @ d.p) + d.q @ (g.laplacian @ d.q)
        return float(change @ change + smooth * rough + integrable * (a @ a + b @ b))

    def _gaps(self, x: Unknowns):
        g = self.grid
        return g.difference_x @ x.z - g.mean_x @ x.p, g.difference_y @ x.z - g.mean_y @ x.q
