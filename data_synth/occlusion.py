"""Where range jumps between neighbouring pixels."""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from data_synth.scene import AbstractScene
from jaxsfs.camera import AbstractCamera
from jaxsfs.surface import Surface

# A jump is a relative difference of range of more than JUMP that survives between rays 2^-HALVINGS px apart. There,
# a continuous wall differs by 1e-8 or so, and the rounded limb itself, which ends like a square root, by 1e-4.
JUMP = 2e-3
HALVINGS = 26
_CHUNK = 4096  # rays per call: one compiled shape for any number of pairs


def find_cuts(scene: AbstractScene, surface: Surface) -> Bool[Array, "height width 2"]:
    """Neighbours that an occlusion separates: `[v, u, 0]` pixel (u, v) and (u + 1, v), `[v, u, 1]` and (u, v + 1).

    Exact up to JUMP: the segment between the two pixel centres is bisected, each time keeping the half across which
    range differs more; what remains different between rays that all but coincide is a jump. A second jump inside
    the same segment (a part thinner than a pixel) is not looked for.
    """
    valid = np.asarray(surface.valid)
    cuts = np.zeros((*valid.shape, 2), bool)
    if not scene.occludes:
        return jnp.asarray(cuts)
    distance = np.asarray(surface.range)
    pixels = np.asarray(surface.camera.pixels())
    for direction, (near, far) in enumerate(((np.s_[:, :-1], np.s_[:, 1:]), (np.s_[:-1], np.s_[1:]))):
        # written through a view: the last column (row) has no neighbour
        both = valid[near] & valid[far]
        cuts[..., direction][near][both] = _jumps(
            scene,
            surface.camera,
            (pixels[near][both], pixels[far][both]),
            (distance[near][both], distance[far][both]),
        )
    return jnp.asarray(cuts)


def _jumps(scene, camera, ends, distances) -> np.ndarray:
    (low, high), (r_low, r_high) = ends, distances
    alive = np.arange(len(low))
    for halving in range(HALVINGS + 1):
        differs = np.abs(r_high - r_low) > JUMP * np.minimum(r_low, r_high)
        alive, low, high, r_low, r_high = (part[differs] for part in (alive, low, high, r_low, r_high))
        if halving == HALVINGS or not len(alive):
            break
        middle = 0.5 * (low + high)
        r_middle = _distances(scene, camera, middle)
        first = np.abs(r_middle - r_low) > np.abs(r_high - r_middle)
        low, r_low = np.where(first[:, None], low, middle), np.where(first, r_low, r_middle)
        high, r_high = np.where(first[:, None], middle, high), np.where(first, r_middle, r_high)
    jumps = np.zeros(len(ends[0]), bool)
    jumps[alive] = True
    return jumps


def _distances(scene, camera, pixels: np.ndarray) -> np.ndarray:
    """Range at sub-pixel positions; a large number where nothing is hit."""
    padded = np.resize(pixels, (-(-len(pixels) // _CHUNK) * _CHUNK, 2))
    chunks = [np.asarray(_chunk(scene, camera, part)) for part in padded.reshape(-1, _CHUNK, 2)]
    return np.concatenate(chunks)[: len(pixels)]


@jax.jit
def _chunk(scene: AbstractScene, camera: AbstractCamera, pixels: Float[Array, "n 2"]) -> Float[Array, "n"]:
    def distance(pixel):
        return scene.distance(camera.point(pixel, jnp.zeros_like(pixel[0])), camera.ray(pixel))

    # few rays in lockstep: a batch takes as many steps as its slowest ray
    return jnp.minimum(jax.lax.map(distance, pixels, batch_size=64), 1e6)
