"""Pentland's two methods, for a distant light of known direction and albedo 1.

`local`: A. P. Pentland, "Local shading analysis", PAMI 6 (1984) 170–187. Every patch is taken for a piece of a
sphere. There the Hessian of E is −(s_z/(R² n_z³)) (n_z² I + m mᵀ), m = (n_x, n_y), so the ratio of its eigenvalues is
n_z² (slant) and the eigenvector of the larger one is the tilt, whatever the light. Of the two tilts the one that
explains E is taken; for a frontal light, where both do, the one that makes the surface convex.

`linear`: A. P. Pentland, "Linear shape from shading", IJCV 4 (1990) 153–162 (first at ICCV 1988). E ≈ s_z − s_x p −
s_y q to first order in the slopes, which is divided out in the Fourier domain. Nothing of first order is left of E
for a frontal light, so that is refused.
"""

import numpy as np

from baselines.distant import STEEPEST, DistantImage, Grid, Relief, derivatives, reflectance, relief_from_slopes


def local(image: DistantImage) -> Relief:
    """Slopes of the locally spherical patches, integrated."""
    e_x, e_y, e_xx, e_xy, e_yy = derivatives(image.values, image.mask, image.spacing)
    lit = image.values > 0
    mean, half = 0.5 * (e_xx + e_yy), np.hypot(0.5 * (e_xx - e_yy), e_xy)
    larger, smaller = np.abs(mean) + half, np.abs(np.abs(mean) - half)
    cosine2 = np.clip(smaller / np.where(larger > 0, larger, 1), 1 / (1 + STEEPEST**2), 1)
    # half the angle of (E_xx − E_yy, 2 E_xy) is the eigenvector of the larger signed eigenvalue
    tilt = 0.5 * np.arctan2(2 * e_xy, e_xx - e_yy) + np.where(mean < 0, np.pi / 2, 0)
    steepness = np.sqrt(1 / cosine2 - 1)
    p, q = -steepness * np.cos(tilt), -steepness * np.sin(tilt)
    gap = [np.abs(reflectance(sign * p, sign * q, image.light) - image.values) for sign in (1, -1)]
    # convex: away from the brightest point the normal leans away, n ∝ −∇E, so (p, q) ∝ ∇E
    flip = p * e_x + q * e_y < 0 if image.frontal else gap[1] < gap[0]
    sign = np.where(flip, -1.0, 1.0)
    known = np.isfinite(p) & lit & image.mask
    return relief_from_slopes(image, np.where(known, sign * p, np.nan), np.where(known, sign * q, np.nan))


def linear(image: DistantImage, damping: float = 0.1) -> Relief:
    """Z by the transfer function −i(ω_x s_x + ω_y s_y); `damping` keeps the directions it cannot see finite.

    Raises ValueError for a frontal light.
    """
    if image.frontal:
        raise ValueError("the linear method needs an oblique light: a frontal one leaves nothing of first order")
    e = np.where(image.mask, image.values, image.light[2])
    size = e.shape
    # even extension: no jump at the border
    wide = np.pad(e, [(0, size[0]), (0, size[1])], mode="symmetric") - image.light[2]
    wx = 2 * np.pi * np.fft.fftfreq(wide.shape[1], image.spacing)[None]
    wy = 2 * np.pi * np.fft.fftfreq(wide.shape[0], image.spacing)[:, None]
    transfer = -1j * (wx * image.light[0] + wy * image.light[1])
    floor = (damping * 2 * np.pi) ** 2
    spectrum = np.fft.fft2(wide) * np.conj(transfer) / (np.abs(transfer) ** 2 + floor)
    z = np.real(np.fft.ifft2(spectrum))[: size[0], : size[1]]
    grid = Grid(image.mask, image.spacing)
    p, q = grid.slopes(grid.vector(z))
    return Relief(np.where(image.mask, z, np.nan), grid.image(p), grid.image(q))
