"""B. K. P. Horn, "Height and gradient from shading", IJCV 5 (1990) 37–75.

The energy of `energy` with both height and slopes unknown, R linearised about the present slopes, and λ taken to zero
in stages, so that at the end smoothness costs no accuracy. The 2 x 2 step for (δp, δq) is Horn's; his relaxation step
for Z is replaced by the solution of its Poisson equation, which is where that step leads.
"""

import numpy as np

from baselines.distant import DistantImage, Relief
from baselines.energy import Energy, Unknowns


def reconstruct(
    image: DistantImage,
    rim_p: np.ndarray,
    rim_q: np.ndarray,
    stages: tuple[float, ...] = (1e-2, 1e-3, 1e-4, 1e-5, 0.0),
    iterations: int = 300,
    integrable: float = 0.1,
) -> Relief:
    """`stages`: λ for a picture 1 unit wide, `iterations` each; `integrable`: μ; rim slopes held where given."""
    energy = Energy(image, rim_p, rim_q)
    grid, x = energy.grid, energy.start()
    for smooth in stages:
        stiff = 4 * smooth / image.spacing**2
        for _ in range(iterations):
            shade, by_p, by_q = energy.shade(x)
            misfit = energy.values - shade
            z_x, z_y = grid.slopes(x.z)
            pull_p = stiff * (grid.mean_of_neighbours(x.p) - x.p) + integrable * (z_x - x.p) + misfit * by_p
            pull_q = stiff * (grid.mean_of_neighbours(x.q) - x.q) + integrable * (z_y - x.q) + misfit * by_q
            a, b, c = stiff + integrable + by_p**2, by_p * by_q, stiff + integrable + by_q**2
            determinant = a * c - b**2
            p = x.p + energy.free * (c * pull_p - b * pull_q) / determinant
            q = x.q + energy.free * (a * pull_q - b * pull_p) / determinant
            x = Unknowns(p, q, grid.integrate(p, q))
    return Relief(grid.image(x.z), grid.image(x.p), grid.image(x.q))
