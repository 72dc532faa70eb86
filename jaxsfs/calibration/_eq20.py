"""The paper's own estimators of f, printed beside the fit: eq. (20), its least-squares form, and the closed form."""

import numpy as np
from jaxtyping import Float


def estimators(
    radius: Float[np.ndarray, " count"], printed: Float[np.ndarray, " count"], height: float
) -> dict[str, float]:
    """f in px from image radii (px) of printed radii (mm) seen square-on from `height` mm, α = atan(R/h):

    eq. (20)       f̄ = mean of r/sin α,
    least squares  f = Σ r sin α / Σ sin²α,
    closed form    1/r² = (1/f²)(1 + (h/R)²), a line in 1/R²: f and h at once (needs no height).
    """
    sine = printed / np.hypot(printed, height)
    slope, level = np.polyfit(printed**-2.0, radius**-2.0, 1, w=radius**3 / np.mean(radius**3))
    valid = level > 0 and slope > 0
    return {
        "eq20_f": float(np.mean(radius / sine)),
        "least_squares_f": float(np.sum(radius * sine) / np.sum(sine**2)),
        "closed_form_f": float(1 / np.sqrt(level)) if valid else float("nan"),
        "closed_form_height_mm": float(np.sqrt(slope / level)) if valid else float("nan"),
    }
