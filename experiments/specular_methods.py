"""The ways to remove highlights that `specular_table.py` compares, and proof that the published ones work."""

from collections.abc import Callable
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from baselines_specular import shen_zheng, yang

from jaxsfs import SRGBResponse
from jaxsfs.specular import RED_MINUS_GREEN, body_colour, remove_highlights, separate

SRGB = SRGBResponse()


class Body(NamedTuple):
    """Body image in linear light, and the pixels whose value a method vouches for."""

    linear: np.ndarray
    known: np.ndarray


def off(linear, valid, clipped) -> Body:
    return Body(linear, valid & ~clipped)


def mask_and_fill(linear, valid, clipped) -> Body:
    found = remove_highlights(linear, valid, saturated=clipped, method="mask")
    return Body(found.values, valid & ~found.unknown)


def red_minus_green(linear, valid, clipped) -> Body:
    """The paper's a = (1, −1, 0), brought to the body's scale with its colour."""
    colour = body_colour(linear, valid & ~clipped)
    return Body(np.maximum(separate(linear, colour, vector=RED_MINUS_GREEN)[0], 0), valid & ~clipped)


def automatic(linear, valid, clipped) -> Body:
    return Body(remove_highlights(linear, valid, saturated=clipped, method="dichromatic").values, valid & ~clipped)


def yang_2010(linear, valid, clipped) -> Body:
    return Body(yang.body_image(linear, valid), valid & ~clipped)


def shen_zheng_2013(linear, valid, clipped) -> Body:
    return Body(shen_zheng.body_image(linear, valid), valid & ~clipped)


def ours(linear, valid, clipped) -> Body:
    found = remove_highlights(linear, valid, saturated=clipped)
    return Body(found.values, valid & ~found.unknown)


METHODS: dict[str, Callable[..., Body]] = {
    "off": off,
    "mask + fill": mask_and_fill,
    "R−G": red_minus_green,
    "automatic a": automatic,
    "Yang 2010": yang_2010,
    "Shen–Zheng 2013": shen_zheng_2013,
    "ours": ours,
}


def stored(linear: np.ndarray) -> np.ndarray:
    return np.asarray(SRGB.encode(jnp.asarray(np.clip(linear, 0, 1))))


def psnr(picture: np.ndarray, truth: np.ndarray, valid: np.ndarray) -> float:
    return float(-10 * np.log10(((picture - truth)[valid] ** 2).mean()))


def own_ground() -> dict[str, float]:
    """PSNR of the rivals on a picture that meets their assumptions, over nothing done at all."""
    v, u = np.indices((128, 160)) / 160
    shading = 0.3 + 0.3 * np.exp(-((u - 0.5) ** 2 + (v - 0.4) ** 2) / 0.1)
    body = np.where((u > 0.5)[..., None], [0.75, 0.35, 0.28], [0.7, 0.5, 0.2]) * shading[..., None]
    spots = ((0.3, 0.3, 0.03), (0.7, 0.5, 0.04), (0.52, 0.6, 0.03))
    light = sum(0.4 * np.exp(-((u - x) ** 2 + (v - y) ** 2) / (2 * s * s)) for x, y, s in spots)
    linear, valid = body + np.asarray(light)[..., None], np.ones(u.shape, bool)
    rivals = {"Yang 2010": yang.body_image, "Shen–Zheng 2013": shen_zheng.body_image}
    found = {name: psnr(stored(rival(linear, valid)), stored(body), valid) for name, rival in rivals.items()}
    return {"off": psnr(stored(linear), stored(body), valid)} | found
