"""Synthetic photographs of printed targets, with known camera and pose: the ground truth of the calibrations.

Each pixel is the mean over supersampled rays of ink × near-light shading (eq. 5 on the paper's plane), then blur,
response, noise, glare, field mask and 8 bits, in the order in which a real scope adds them.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, UInt8
from scipy.ndimage import gaussian_filter

from data_synth.target_patterns import AbstractPattern
from jaxsfs.calibration import PlanePose
from jaxsfs.camera import AbstractCamera
from jaxsfs.photometry import AbstractFalloff, AbstractResponse, NoFalloff, SRGBResponse


class Studio(eqx.Module):
    """What the photograph suffers.

    `blur`: sd of the Gaussian in px. `noise`: sd in stored units (full scale 1). `glares`: rows (u, v, radius) in
    px, saturated discs with soft rims. `field`: "full", "round" or "octagon"; `field_radius` is a fraction of half
    the image height (> 1 cuts the field at top and bottom). `exposure`: stored value of the brightest paper.
    """

    falloff: AbstractFalloff = NoFalloff()
    response: AbstractResponse = SRGBResponse()
    blur: float = 1.0
    noise: float = 0.01
    exposure: float = 0.85
    glares: tuple[tuple[float, float, float], ...] = ()
    field: str = eqx.field(default="full", static=True)
    field_radius: float = 0.98
    supersampling: int = eqx.field(default=4, static=True)


def photograph(
    camera: AbstractCamera,
    pattern: AbstractPattern,
    pose: PlanePose,
    studio: Studio,
    seed: int,
    gain: float | None = None,
) -> UInt8[np.ndarray, "height width"]:
    """The 8-bit grey photograph of `pattern` at `pose`: stored = response(gain·V(α)·ρ(X, Y)·(n·d)³/h²) + noise.

    `gain` in mm² (so that gain·ρ is what `calibrate white` finds); without it the exposure fixes the brightest paper.
    """
    rng = np.random.default_rng(seed)
    # plain numbers would be compiled in as constants, once per photograph
    moving = jax.tree.map(lambda leaf: jnp.asarray(leaf, float), (camera, pattern, pose, studio.falloff))
    linear, paper = (np.asarray(part, float) for part in _irradiance(moving, studio.supersampling))
    if gain is None:
        brightest = studio.response.decode(jnp.asarray(studio.exposure, float))
        gain = float(brightest) / float(paper.max())
    linear = gaussian_filter(gain * linear, studio.blur) + _glare(camera, studio.glares)
    field = _field(camera, studio)
    linear = linear * gaussian_filter(field.astype(float), 1.0)
    stored = np.asarray(studio.response.encode(jnp.asarray(np.clip(linear, 0, 1))))
    stored = stored + studio.noise * rng.standard_normal(stored.shape) * np.where(field, 1, 0.3)
    return np.round(255 * np.clip(stored, 0, 1)).astype(np.uint8)


@eqx.filter_jit
def _irradiance(
    scene: tuple[AbstractCamera, AbstractPattern, PlanePose, AbstractFalloff], count: int
) -> tuple[Float[Array, "height width"], Float[Array, "height width"]]:
    """Mean over the supersampled rays of V(α)·ink·(n·d)³/h², and the same of the bare paper."""
    camera, pattern, pose, falloff = scene
    steps = (jnp.arange(count, dtype=float) + 0.5) / count - 0.5
    shifts = jnp.stack(jnp.meshgrid(steps, steps), axis=-1).reshape(-1, 2)

    def value(pixel):
        ray = camera.ray(pixel)
        facing = pose.facing(ray)
        seen = camera.is_valid(pixel) & (facing > 0.02)
        shading = jnp.where(seen, facing, 0) ** 3 / pose.height**2 * falloff(jnp.maximum(ray[2], 0))
        return shading * pattern.ink(pose.on_target(ray)), shading

    def add(total, shift):
        one = jax.vmap(jax.vmap(value))(camera.pixels() + shift[None, None, :])
        return jax.tree.map(jnp.add, total, one), None

    zero = jnp.zeros((camera.height, camera.width))
    total, _ = jax.lax.scan(add, (zero, zero), shifts)
    return total[0] / count**2, total[1] / count**2


def _glare(camera: AbstractCamera, glares) -> np.ndarray:
    v, u = np.mgrid[: camera.height, : camera.width]
    total = np.zeros(u.shape)
    for centre_u, centre_v, radius in glares:
        distance = np.hypot(u - centre_u, v - centre_v)
        total += 2.0 * np.exp(-((distance / radius) ** 4))
    return total


def _field(camera: AbstractCamera, studio: Studio) -> np.ndarray:
    v, u = np.mgrid[: camera.height, : camera.width]
    x, y = np.abs(u - (camera.width - 1) / 2), np.abs(v - (camera.height - 1) / 2)
    radius = studio.field_radius * camera.height / 2
    if studio.field == "full":
        return np.ones(u.shape, bool)
    if studio.field == "round":
        return np.hypot(x, y) < radius
    if studio.field == "octagon":
        side = 1.2 * radius
        return (x < side) & (y < radius) & (x + y < 0.72 * (side + radius))
    raise ValueError(f"field must be 'full', 'round' or 'octagon', got {studio.field!r}")
