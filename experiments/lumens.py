"""Tubes as a colonoscope sees them: photometry near the preset's, light between the walls, vessels, 8 bit."""

import math
from typing import NamedTuple

import cv2
import jax
import jax.numpy as jnp
import numpy as np

from data_synth import AbstractScene, FoldedColon, Tube, View, observe, take_photo, vessel_colours
from data_synth.effects import TISSUE
from jaxsfs import CosineFalloff, GammaResponse, Perspective, Power

PRESET = (2.2, 1.6, 0.65)  # γ, μ, a
SPREAD = (0.12, 0.4, 0.12)  # 1σ of ln γ, μ, a from scope to scope
_GRID = 30  # walls in a row that light each other


class Lumen(NamedTuple):
    """A view, its stored photograph (full scale 1), and the γ, μ, a that made it."""

    view: View
    stored: np.ndarray
    photometry: tuple[float, float, float]


def lumen(seed: int, size: int) -> Lumen:
    """A folded tube, every fourth a straight one, always the same for the same seed."""
    rng = np.random.default_rng(seed)
    scene = _scene(rng, straight=seed % 4 == 0)
    gamma = PRESET[0] * math.exp(SPREAD[0] * rng.standard_normal())
    mu = PRESET[1] + SPREAD[1] * rng.standard_normal()
    power = float(np.clip(PRESET[2] + SPREAD[2] * rng.standard_normal(), 0.4, 1.0))
    f = size / 2 / math.tan(math.radians(rng.uniform(40, 50)))
    camera = Perspective(f, f, (size - 1) / 2, (size - 1) / 2, size, size)
    with jax.enable_x64(True):
        view = observe(scene, camera, reflectance=Power(jnp.asarray(power)))
        colours = vessel_colours(view, seed=seed, strength=0.25) * more_light(view)
        photo = take_photo(
            view,
            body_colour=colours,
            falloff=CosineFalloff(jnp.asarray(mu)),
            response=GammaResponse(jnp.asarray(gamma)),
            read_noise=0.004,
            seed=seed,
        )
    return Lumen(jax.tree.map(np.asarray, view), np.asarray(photo.stored) / 255.0, (gamma, mu, power))


def _scene(rng: np.random.Generator, *, straight: bool) -> AbstractScene:
    def draw(*bounds: tuple[float, float]) -> list[float]:
        return [float(rng.uniform(*pair)) for pair in bounds]

    if straight:
        return Tube(*draw((0.8, 1.3), (-0.35, 0.35), (-0.35, 0.35), (3, 7)))
    folds = draw((0.8, 1.2), (0.1, 0.35), (0.9, 1.8), (0.8, 1.8), (2, 4), (-0.3, 0.3), (-0.5, 0.5))
    return FoldedColon(*folds, *draw((-0.35, 0.35), (-0.35, 0.35), (4.5, 7)))


def more_light(view: View) -> np.ndarray:
    """What the visible walls' light on each other multiplies E by, per channel: diffuse walls of the tissue's albedo,
    B = E + ρ F B on a coarse grid of patches, F their form factors without shadows."""
    camera, distance = view.camera, np.asarray(view.surface.range)
    assert isinstance(camera, Perspective)
    direct, cosines, rays = (np.asarray(part) for part in (view.irradiance.values, view.cosines, camera.rays()))
    step = max(1, len(direct) // _GRID)
    coarse = np.s_[step // 2 :: step, step // 2 :: step]
    seen = np.asarray(view.surface.valid)[coarse] & (cosines[coarse] > 0.05)
    ray, far, normal, cosine = (part[coarse][seen] for part in (rays, distance, np.asarray(view.normals), cosines))
    area = far**2 * ray[:, 2] ** 3 * (step / float(camera.fx)) ** 2 / cosine
    form = _form_factors(ray * far[:, None], normal, area)
    start = direct[coarse][seen]
    lit = direct > 0
    factors = np.ones((*direct.shape, 3))
    for channel, albedo in enumerate(TISSUE):
        added = np.zeros(seen.shape)
        added[seen] = np.linalg.solve(np.eye(len(start)) - float(albedo) * form, start) - start
        share = np.maximum(cv2.GaussianBlur(seen.astype(float), (0, 0), 1), 1e-3)
        added = cv2.resize(cv2.GaussianBlur(added, (0, 0), 1) / share, direct.shape[::-1])
        factors[..., channel] = np.where(lit, 1 + added / np.where(lit, direct, 1), 1)
    return factors


def _form_factors(points: np.ndarray, normals: np.ndarray, areas: np.ndarray) -> np.ndarray:
    apart = points[None] - points[:, None]
    square = (apart**2).sum(axis=-1) + 0.5 * np.median(areas)  # patches are no points
    towards = apart / np.sqrt(square)[..., None]
    leaving = np.maximum((towards * normals[:, None]).sum(axis=-1), 0)
    arriving = np.maximum(-(towards * normals[None]).sum(axis=-1), 0)
    form = leaving * arriving * areas[None] / (np.pi * square)
    np.fill_diagonal(form, 0)
    return form / np.maximum(1, form.sum(axis=1, keepdims=True) / 0.9)
