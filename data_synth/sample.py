"""One synthetic sample: the photograph, the truth behind it, and the files' descriptions of both."""

from collections.abc import Mapping
from typing import Any

import equinox as eqx
import jax
import numpy as np
from jaxtyping import Bool, Float

from data_synth.catalogue import default_camera, scene_from_dict, scene_from_text, scene_to_dict
from data_synth.effects import LUMINANCE, TISSUE, Photo, take_photo
from data_synth.scene import AbstractScene
from data_synth.viewing import observe
from jaxsfs.camera import AbstractCamera, AbstractCentralCamera, CameraFile
from jaxsfs.forms import Scalar
from jaxsfs.photometry import parse_falloff, parse_response
from jaxsfs.reflectance import parse_reflectance


class Sample(eqx.Module):
    """What `jaxsfs render` writes, computed in double precision, as NumPy arrays.

    `photo.stored` is image.png; `range` (for an orthographic camera z), `depth` and `normals` are NaN where not
    `valid`; `discontinuities` marks pixels beside an occlusion; `camera_file` holds camera and photometry;
    `description` goes to scene.json and renders the same sample again.
    """

    photo: Photo
    range: Float[np.ndarray, "height width"]
    depth: Float[np.ndarray, "height width"]
    normals: Float[np.ndarray, "height width 3"]
    valid: Bool[np.ndarray, "height width"]
    discontinuities: Bool[np.ndarray, "height width"]
    camera_file: CameraFile
    description: dict[str, Any]


def render_scene(
    scene: str | Mapping[str, Any] | AbstractScene,
    *,
    camera: AbstractCamera | None = None,
    width: int = 640,
    height: int = 480,
    half_field_deg: Scalar = 50,
    response: str = "srgb",
    falloff: str = "none",
    reflectance: str = "lambertian",
    shine: Scalar = 0.0,
    lobe: Scalar = 40,
    blur_px: Scalar = 0.0,
    read_noise: Scalar = 0.0,
    shot_noise: Scalar = 0.0,
    seed: int = 0,
    bits: int = 8,
) -> Sample:
    """Renders a scene: a name, `random:SEED`, the parsed content of a scene.json, or a scene.

    Without a `camera`, `default_camera` of the given size. The field is round, `half_field_deg` about the optical
    axis, black outside. `seed` is that of the noise. The camera file's photometry gets response, falloff,
    reflectance and `gain_albedo`, the g with: linear luminance = g · V · G(cos θ)/r² (Rec. 709 weights).

    Raises ValueError for an unknown scene, form or value, and where the scene fills no pixel.
    """
    name = scene if isinstance(scene, str) else None
    if isinstance(scene, str):
        scene = scene_from_text(scene)
    elif isinstance(scene, Mapping):
        name, scene = scene.get("name"), scene_from_dict(scene)
    with jax.enable_x64(True):
        camera = default_camera(scene, width, height, half_field_deg) if camera is None else camera
        field = half_field_deg if isinstance(camera, AbstractCentralCamera) else None
        view = observe(scene, camera, reflectance=parse_reflectance(reflectance), half_field_deg=field)
        photo = take_photo(
            view,
            shine=shine,
            lobe=lobe,
            falloff=parse_falloff(falloff),
            response=parse_response(response),
            blur_px=blur_px,
            read_noise=read_noise,
            shot_noise=shot_noise,
            seed=seed,
            bits=bits,
        )
        valid = np.asarray(view.surface.valid)
        distance = np.where(valid, view.surface.range, np.nan)
        depth = np.where(valid, view.surface.depth(), np.nan)
        normals = np.where(valid[..., None], view.normals, np.nan)
        discontinuities = np.asarray(view.discontinuities())
    photometry = {
        "response": response,
        "falloff": falloff,
        "reflectance": reflectance,
        "gain_albedo": photo.gain * float(LUMINANCE @ np.asarray(TISSUE, float)),
    }
    effects = {
        "shine": shine,
        "lobe": lobe,
        "blur_px": blur_px,
        "read_noise": read_noise,
        "shot_noise": shot_noise,
        "seed": seed,
        "bits": bits,
        "half_field_deg": half_field_deg,
    }
    description = {"name": name or "custom", **scene_to_dict(scene), "effects": effects}
    file = CameraFile(camera, photometry, {})
    return Sample(photo, distance, depth, normals, valid, discontinuities, file, description)
