"""The photographs that `specular_table.py` compares methods on: what was stored, and the body image under it."""

from itertools import islice
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from mitsuba_scenes import pictured, plastic, shapes
from specular_methods import SRGB

from data_synth import (
    Ball,
    HollowBall,
    Plane,
    View,
    WavyWall,
    default_camera,
    observe,
    random_scene,
    take_photo,
    tissue_colours,
    wet_glints,
)
from data_synth.effects import TISSUE, add_noise, exposure, quantise
from jaxsfs import Perspective

KINDS = ("broad", "glints", "both", "uneven tissue", "tinted light", "grey tissue", "none")
PLASTIC = "rough plastic"
SMOOTH = (Plane, Ball, HollowBall, WavyWall)
NOISE = 0.004
HALF_FIELD = 50.0


class Picture(NamedTuple):
    """What is seen, the stored values (full scale 1), and the body image in linear light."""

    view: View
    values: np.ndarray
    body: np.ndarray


def photograph(seed: int, kind: str, size: tuple[int, int]) -> Picture:
    """A photograph of the kind; highlights are drawn from the seed."""
    if kind == PLASTIC:
        return plastic_photograph(seed, size[1])
    scene = random_scene(seed)
    view = observe(scene, default_camera(scene, *size), half_field_deg=HALF_FIELD)
    rng = np.random.default_rng(seed)
    options: dict = {"shine": rng.uniform(0.15, 0.5), "lobe": rng.uniform(20, 120)}
    if kind in ("glints", "none"):
        options = {}
    if kind not in ("broad", "none"):
        options["glints"] = wet_glints(view, seed=seed)
    if kind in ("uneven tissue", "none"):
        options["body_colour"] = tissue_colours(view, seed=seed)
    if kind == "tinted light":
        options["interface_colour"] = (0.85, 1.0, 0.8)
    if kind == "grey tissue":
        options["body_colour"] = (0.45, 0.45, 0.45)
    photo = take_photo(view, read_noise=NOISE, seed=seed, **options)
    return Picture(view, photo.stored / 255, photo.body)


def plastic_photograph(seed: int, size: int) -> Picture:
    """Mitsuba's picture of a wall with its `roughplastic`; the body is its picture without the coat's reflection.

    What light goes into the coat and comes out again makes it darker at grazing angles than a Lambertian wall.
    """
    rng = np.random.default_rng(seed)
    scene = random_scene(seed)
    focal = size / 2 / np.tan(np.deg2rad(HALF_FIELD))
    view = observe(
        scene, Perspective(focal, focal, (size - 1) / 2, (size - 1) / 2, size, size), half_field_deg=HALF_FIELD
    )
    valid = np.asarray(view.surface.valid)
    roughness = float(rng.uniform(0.1, 0.3))
    whole, body = (
        pictured(shapes(scene, plastic(TISSUE, roughness, coat)), 2 * HALF_FIELD, size, 1, 16, colour=True)
        for coat in (1.0, 0.0)
    )
    gain = exposure(body, valid)
    linear = np.clip(add_noise(gain * whole, seed=seed, read=NOISE), 0, 1)
    values = quantise(np.asarray(SRGB.encode(jnp.asarray(linear))), 8) / 255
    return Picture(view, np.where(valid[..., None], values, 0), np.where(valid[..., None], gain * body, 0))


def chosen(seeds: range, smooth: bool, count: int, kinds: tuple[type, ...] = SMOOTH) -> list[int]:
    """The first `count` seeds of scenes of the `kinds`, or of others."""
    return list(islice((seed for seed in seeds if isinstance(random_scene(seed), kinds) == smooth), count))
