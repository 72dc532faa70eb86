"""How far a fit can be trusted: covariance, and cross-validation by leaving groups of observations out.

Leaving a group g out moves the parameters by one Gauss–Newton step, δ_g = −(JᵀJ − J_gᵀJ_g)⁺ J_gᵀ r_g: no refit. The
delete-a-group jackknife (G − 1)/G Σ δ_g δ_gᵀ feels what the covariance of independent residuals cannot: errors that
the edges of one ring, arc or photograph share.
"""

import jax
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from jaxsfs.calibration._fit import Fit, free_for
from jaxsfs.calibration._lens import LENS_SIZE, lens_named, rays
from jaxsfs.camera import AbstractCentralCamera


def left_out_steps(found: Fit, group: Int[np.ndarray, " count"]) -> Float[np.ndarray, "groups size"]:
    """Change of the parameters when each group is left out."""
    free = free_for(found.name, found.setup)
    kept = found.weight > 0
    jacobian, residual = found.jacobian[kept][..., free], found.standardised[kept]
    group = group[kept]
    prior = np.diag(1 / found.setup.prior_sd[free] ** 2)
    normal = np.einsum("npi,npj->ij", jacobian, jacobian) + prior
    names = np.unique(group)
    steps = np.zeros((len(names), len(free)))
    for row, name in enumerate(names):
        j, r = jacobian[group == name].reshape(-1, free.sum()), residual[group == name].reshape(-1)
        rest = normal - j.T @ j
        # what only this group knows (its own pose, when a photograph is left out) stays where it is
        known = np.diag(rest) > 1e-6 * np.diag(normal)
        step = np.zeros(len(rest))
        step[known] = solve_scaled(rest[np.ix_(known, known)], (j.T @ r)[known])
        steps[row, free] = step
    return steps


def shared_shift(found: Fit) -> Float[np.ndarray, " size"]:
    """Change of the parameters when every observation errs by its `systematic` sd at once."""
    free = free_for(found.name, found.setup)
    kept = found.weight > 0
    jacobian = found.jacobian[kept][..., free].reshape(-1, free.sum())
    error = (found.setup.systematic * found.setup.scale[:, None])[kept].reshape(-1) / found.noise
    shift = np.zeros(len(free))
    normal = jacobian.T @ jacobian + np.diag(1 / found.setup.prior_sd[free] ** 2)
    shift[free] = solve_scaled(normal, jacobian.T @ error)
    return shift


def solve_scaled(normal: Float[np.ndarray, "n n"], side: Float[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
    """normal⁻¹·side after scaling to unit diagonal, directions without data damped."""
    scale = 1 / np.sqrt(np.maximum(np.diag(normal), 1e-300))
    values, vectors = np.linalg.eigh(normal * np.outer(scale, scale))
    values = np.maximum(values, 1e-12)
    return scale * (vectors @ ((vectors.T @ (scale * side)) / values))


def jackknife(steps: Float[np.ndarray, "groups size"]) -> Float[np.ndarray, "size size"]:
    """(G − 1)/G Σ δ δᵀ about the mean."""
    count = len(steps)
    centred = steps - steps.mean(axis=0)
    return (count - 1) / max(count, 1) * centred.T @ centred


def larger(first: Float[np.ndarray, "n n"], second: Float[np.ndarray, "n n"]) -> Float[np.ndarray, "n n"]:
    """The covariance that `first` becomes when each of its sds is raised to `second`'s where that is larger; the
    correlations are those of `first`."""
    a, b = np.sqrt(np.diag(first)), np.sqrt(np.diag(second))
    ratio = np.where(a > 0, np.maximum(b / np.maximum(a, 1e-300), 1), 1)
    return first * np.outer(ratio, ratio)


def pixel_sd_map(found: Fit, covariance: Float[np.ndarray, "size size"], columns: int = 33) -> Float[np.ndarray, "r c"]:
    """sd in px of where a fixed direction is seen, over a coarse grid of the image (rows × columns); NaN where the lens
    has no ray.

    A rotation of the camera as a whole is taken out (it is the pose's, not the lens's): the best small rotation is
    projected out of the rays' changes with each of the parameters.
    """
    width, height = found.setup.size
    rows = max(2, round(columns * height / width))
    u, v = np.meshgrid(np.linspace(0, width - 1, columns), np.linspace(0, height - 1, rows))
    pixels = np.stack([u.ravel(), v.ravel()], axis=1)
    seen = rays(lens_named(found.name).build, found.parameters[:LENS_SIZE], pixels)
    inside = np.hypot(*(pixels - found.parameters[1:3]).T) < used_radius(found)
    x, y, z = seen.ray.T
    zero = np.zeros_like(x)
    turns = np.stack([np.stack([zero, -z, y], 1), np.stack([z, zero, -x], 1), np.stack([-y, x, zero], 1)], axis=2)
    fitted = np.linalg.lstsq(turns[inside].reshape(-1, 3), seen.by_lens[inside].reshape(-1, LENS_SIZE), rcond=None)[0]
    change = seen.by_lens - np.einsum("nij,jk->nik", turns, fitted)
    to_pixel = np.linalg.pinv(seen.slope)
    in_pixels = np.einsum("nij,njk->nik", to_pixel, change)
    spread = np.einsum("nik,kl,nil->n", in_pixels, covariance[:LENS_SIZE, :LENS_SIZE], in_pixels)
    valid = np.asarray(_is_valid(found.camera, pixels))
    return np.where(valid, np.sqrt(spread), np.nan).reshape(rows, columns)


@jax.jit
def _is_valid(camera: AbstractCentralCamera, pixels: Float[Array, "count 2"]) -> Bool[Array, " count"]:
    return jax.vmap(camera.is_valid)(pixels)


def used_radius(found: Fit) -> float:
    """Distance in px of the outermost used observation from the principal point."""
    rows = found.setup.observations.pixel[found.weight > 0]
    return float(np.max(np.hypot(*(rows - found.parameters[1:3]).T)))


def correlations(found: Fit) -> dict[tuple[str, str], float]:
    """Pairs among the fitted lens parameters, heights and tilts whose correlation exceeds 0.95 in size."""
    free = np.nonzero(free_for(found.name, found.setup))[0]
    sd = np.sqrt(np.diag(found.covariance))
    pairs = {}
    for i, a in enumerate(free):
        for b in free[i + 1 :]:
            value = found.covariance[a, b] / max(sd[a] * sd[b], 1e-300)
            if abs(value) > 0.95:
                pairs[parameter_name(int(a)), parameter_name(int(b))] = float(value)
    return pairs


def parameter_name(index: int) -> str:
    """What a user calls parameter `index`."""
    lens = ("f", "cx", "cy", "aspect", "k1", "k2", "k3", "k4", "line width", "second scale")
    if index < len(lens):
        return lens[index]
    view, part = divmod(int(index) - len(lens), 6)
    return f"{('tilt x', 'tilt y', 'roll', 'offset x', 'offset y', 'height')[part]} of photograph {view + 1}"
