"""`jaxsfs render`: synthetic endoscope views with exact ground truth."""

import dataclasses
import json
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

from tyro.conf import Positional

from jaxsfs.cli._options import FLAT, value
from jaxsfs.cli._terminal import CannotRun, jax_session, progress, say

if TYPE_CHECKING:
    from jaxsfs.camera import AbstractCamera

# options that scene.json records, so that it renders the same sample again
_EFFECTS = ("shine", "lobe", "blur_px", "read_noise", "shot_noise", "seed", "bits", "half_field_deg")
_PHOTOMETRY = ("response", "falloff", "reflectance")


@dataclasses.dataclass(frozen=True)
class RenderOptions:
    # plane, tilted-plane, ball, hollow-ball, wavy-wall, tube, ball-in-bowl, vase, polyps, colon, random:SEED, or a
    # scene.json.
    scene: Annotated[Positional[str], value("SCENE")]
    # Folder for the view.
    out: Annotated[Path, value("FOLDER")]
    # Camera file; without one, a spherical camera with --half-field at the middle of the image's short side. Its
    # photometry is used where the options below do not say otherwise.
    camera: Annotated[Path | None, value("FILE", default="none")] = None
    # Image width without --camera.
    width: Annotated[int | None, value("PX", default="640")] = None
    # Image height without --camera.
    height: Annotated[int | None, value("PX", default="480")] = None
    # Half of the round field's angle.
    half_field_deg: Annotated[float | None, value("DEG", default="50", option="half-field")] = None
    # The tone curve of the photograph.
    response: Annotated[str | None, value("srgb|linear|gamma:G", default="srgb")] = None
    # Light and vignetting over the angle from the optical axis.
    falloff: Annotated[str | None, value("none|cos:MU|exp:MU|cosexp:A,B", default="none")] = None
    # lambertian, power:A, oren-nayar:SIGMA, phong:K,N or blinn-phong:K,N.
    reflectance: Annotated[str | None, value("FORM", default="lambertian")] = None
    # Strength of the highlights.
    shine: Annotated[float | None, value("S", default="0")] = None
    # Sharpness of the highlights.
    lobe: Annotated[float | None, value("N", default="40")] = None
    # Gaussian blur.
    blur_px: Annotated[float | None, value("SIGMA_PX", default="0", option="blur")] = None
    # Standard deviation of the noise in linear light, full scale 1.
    read_noise: Annotated[float | None, value("SD", default="0")] = None
    # Variance of the noise per linear light.
    shot_noise: Annotated[float | None, value("V", default="0")] = None
    # Seed of the noise.
    seed: Annotated[int | None, value("N", default="0")] = None
    # Bits per channel.
    bits: Annotated[Literal[8, 16] | None, value("8|16", default="8")] = None
    # Replace an earlier view.
    force: bool = False
    # Print scene.json instead of a summary.
    json: bool = False


def render(options: Annotated[RenderOptions, FLAT]) -> int:
    """A photograph of a synthetic scene by an endoscope, with the exact surface behind it.

    For example:
      jaxsfs render wavy-wall --half-field 60 --read-noise 0.002 --out view

    Writes image.png, range.tiff and normals.tiff (NaN where there is nothing), camera.json with the photometry, and
    scene.json, which renders the same view again: jaxsfs render view/scene.json --camera view/camera.json --out again
    """
    # the truth is exact to rounding, so that rounding is that of 64 bit
    with jax_session(64):
        _write_view(options)
    return 0


def _camera(options: RenderOptions) -> tuple["AbstractCamera | None", dict[str, str]]:
    """The camera of the command line, if there is one, and its photometry."""
    from jaxsfs.cli._photometric import photometry_texts
    from jaxsfs.files import InputError, read_camera

    if options.camera is None:
        return None, {}
    if not (options.width is None and options.height is None):
        raise InputError("--width and --height are for a view without --camera; the camera file has a size")
    file = read_camera(options.camera)
    return file.camera, photometry_texts(file, options.camera)


def _recorded_effects(scene: Mapping[str, Any], path: Path) -> dict[str, float | int]:
    """The effects that a scene.json was made with."""
    effects = scene.get("effects") or {}
    if not isinstance(effects, Mapping):
        raise CannotRun(f"{path}: 'effects' must be an object such as {{\"shine\": 0.2}}, got {effects!r}")
    for name, number in effects.items():
        whole = name in ("seed", "bits")
        if name not in _EFFECTS or isinstance(number, bool) or not isinstance(number, int if whole else int | float):
            raise CannotRun(f"{path}: 'effects' holds numbers for {', '.join(_EFFECTS)}; got {name!r}: {number!r}")
    return dict(effects)


def _write_view(options: RenderOptions) -> None:
    from data_synth import render_scene
    from jaxsfs import files

    with files.output_folder(options.out, force=options.force) as folder:
        path = Path(options.scene)
        scene: str | Mapping[str, Any] = files.read_json(path) if path.suffix == ".json" else options.scene
        camera, photometry = _camera(options)
        progress(f"rendering {options.scene}")
        recorded = {} if isinstance(scene, str) else _recorded_effects(scene, path)
        given = {name: getattr(options, name) for name in ("width", "height", *_EFFECTS, *_PHOTOMETRY)}
        for names, source in ((_EFFECTS, recorded), (_PHOTOMETRY, photometry)):
            for name in names:
                given[name] = source.get(name) if given[name] is None else given[name]
        chosen = {name: value for name, value in given.items() if value is not None}
        sample = render_scene(scene, camera=camera, **chosen)
        files.write_png(folder / "image.png", sample.photo.stored)
        files.write_tiff(folder / "range.tiff", sample.range, sample.valid, description="range, scene units")
        files.write_tiff(
            folder / "normals.tiff",
            sample.normals,
            sample.valid,
            description="unit normals towards the camera, x right, y down, z forward",
        )
        files.write_camera(folder / "camera.json", sample.camera_file)
        files.write_json(folder / "scene.json", sample.description)
    if options.json:
        print((options.out / "scene.json").read_text(encoding="utf-8"), end="")
    else:
        size = f"{sample.valid.shape[1]} x {sample.valid.shape[0]} px"
        say(f"{options.out}: {json.dumps(sample.description['name'])}, {size}, {sample.valid.mean():.0%} of it filled")
