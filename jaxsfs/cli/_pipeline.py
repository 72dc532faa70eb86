"""What `jaxsfs reconstruct` does: read, turn brightness into irradiance, solve, write."""

import dataclasses
import time
from typing import Any

import numpy as np
from jaxtyping import Bool, Float

from jaxsfs import files
from jaxsfs.camera import CameraFile, camera_to_dict
from jaxsfs.cli._initial import check_mask_size, parse_initial, parse_known_range, read_heights
from jaxsfs.cli._photometric import Photometric, photometric
from jaxsfs.cli._reconstruct_options import ReconstructOptions
from jaxsfs.cli._settings import COMMAND_LINE, DEFAULT, Setting
from jaxsfs.cli._summary import summary
from jaxsfs.cli._terminal import command_line, progress, versions
from jaxsfs.field import find_field
from jaxsfs.initial import AbstractInitial
from jaxsfs.noise import noise_level, smoothing_for
from jaxsfs.photo import clipping_limit, size_message
from jaxsfs.preparation import Preparation, prepare
from jaxsfs.reconstruction import Reconstruction, scaled_to
from jaxsfs.reconstruction import reconstruct as solve

_NOT_TRUSTWORTHY = 3


@dataclasses.dataclass(frozen=True)
class _Input:
    """What was read and decided before solving."""

    file: CameraFile
    photo: files.Photo
    valid: Bool[np.ndarray, "height width"]
    mask: Setting
    settings: Photometric
    smooth: Setting
    initial: AbstractInitial
    known_range: tuple[tuple[int, int], float] | None

    @property
    def size(self) -> tuple[int, int]:
        """(width, height) in px."""
        return self.photo.valid.shape[1], self.photo.valid.shape[0]


def run(options: ReconstructOptions) -> int:
    """Reconstructs as the options say, writes the folder of results, prints a summary; the exit code."""
    start = time.perf_counter()
    with files.output_folder(options.out, force=options.force) as folder:
        progress(f"reading {options.image}")
        given = _read(options)
        progress(f"solving {given.size[0]} x {given.size[1]} px")
        result, prepared = _solved(options, given)
        progress(f"writing {options.out}")
        files.write_surface(folder, result.surface, given.photo.rgb8(), given.settings.unit)
        record = _record(options, given, result, prepared)
        files.write_json(folder / "result.json", record)
    if options.json:
        print((options.out / "result.json").read_text(encoding="utf-8"), end="")
    else:
        print(summary(record, options.out, time.perf_counter() - start))
    return 0 if result.status.trustworthy else _NOT_TRUSTWORTHY


def _read(options: ReconstructOptions) -> _Input:
    file = files.read_camera(options.camera)
    photo = files.read_image(options.image)
    height, width = photo.valid.shape
    if (file.camera.width, file.camera.height) != (width, height):
        raise files.InputError(size_message(str(options.image), (width, height), file.camera))
    settings = photometric(options, file, photo)
    known = None if options.known_range is None else parse_known_range(options.known_range, (width, height))
    initial = (
        parse_initial(_initial(options).value, (width, height))
        if options.heights is None
        else read_heights(options.heights, (width, height))
    )
    mask, origin = _mask(options, photo, settings.response.value)
    valid = photo.valid & mask
    return _Input(file, photo, valid, origin, settings, _smooth(options, photo, valid), initial, known)


def _smooth(options: ReconstructOptions, photo: files.Photo, valid: Bool[np.ndarray, "height width"]) -> Setting:
    given = options.smooth_px()
    if given is not None:
        return Setting(given, COMMAND_LINE)
    noise = noise_level(photo.values / max(1.0, float(photo.values.max())), valid)
    return Setting(smoothing_for(noise), f"automatic, noise {noise:.2%} of full scale")


def _mask(
    options: ReconstructOptions, photo: files.Photo, response: str
) -> tuple[Bool[np.ndarray, "height width"], Setting]:
    if options.mask is None:
        field = find_field(_as_seen(photo.values) if response == "linear" else photo.values)
        return field.mask, Setting(field.description, "automatic")
    mask = files.read_mask(options.mask)
    check_mask_size(options.mask, mask.shape, (photo.valid.shape[1], photo.valid.shape[0]))
    return mask, Setting(f"{options.mask}, {mask.mean():.0%} of the image", COMMAND_LINE)


def _as_seen(linear: Float[np.ndarray, "height width *channels"]) -> Float[np.ndarray, "height width *channels"]:
    """Linear light of any scale as a display would show it: what is dark to the eye is what a border is told by."""
    white = max(float(np.percentile(linear, 99.9)), float(np.finfo(np.float32).tiny))
    return np.clip(linear / white, 0, 1).astype(np.float32) ** np.float32(1 / 2.2)


def _solved(options: ReconstructOptions, given: _Input) -> tuple[Reconstruction, Preparation]:
    settings, camera = given.settings, given.file.camera
    prepared = prepare(
        given.photo.values,
        camera,
        valid=given.valid,
        specular=options.specular,
        response=settings.parsed("response"),
        falloff=settings.parsed("falloff"),
        weights=settings.parsed("channel"),
        smooth_px=given.smooth.value,
        clip_limit=clipping_limit(given.photo.dtype),
    )
    result = solve(
        prepared.irradiance,
        camera,
        albedo=prepared.photo.largest if settings.albedo.value is None else settings.albedo.value,
        reflectance=settings.parsed("reflectance"),
        light=options.light,
        solver=options.solver,
        order=options.order,
        initial=given.initial,
        concave=options.concave,
    )
    if given.known_range is not None:
        result = scaled_to(result, *given.known_range)
    return result, prepared


def _initial(options: ReconstructOptions) -> Setting:
    if options.heights is not None:
        return Setting(f"heights:{options.heights}", COMMAND_LINE)
    if options.initial is not None:
        return Setting(options.initial, COMMAND_LINE)
    return Setting("deadline" if options.light == "camera" else "singular-point", DEFAULT)


def _record(
    options: ReconstructOptions, given: _Input, result: Reconstruction, prepared: Preparation
) -> dict[str, Any]:
    """result.json."""
    settings = given.settings
    albedo = dataclasses.replace(settings.albedo, value=float(result.albedo))
    settings_used = {
        "response": settings.response,
        "falloff": settings.falloff,
        "reflectance": settings.reflectance,
        "channel": settings.channel,
        "albedo": albedo,
        "mask": given.mask,
        "smooth": given.smooth,
        "initial": _initial(options),
    }
    return {
        "image": str(options.image),
        "size": {"width": given.size[0], "height": given.size[1]},
        "status": {
            "name": result.status.name.lower().replace("_", "-"),
            "message": result.status.value,
            "trustworthy": result.status.trustworthy,
        },
        "unit": settings.unit,
        "figures": {
            "range": _lengths(result),
            "photograph": prepared.photo.as_dict(),
            "preparation": prepared.figures(),
            "solution": result.statistics.as_dict(),
        },
        "options": {name: setting.as_dict() for name, setting in settings_used.items()}
        | {
            name: _given_or_default(options, name)
            for name in ("preset", "specular", "light", "solver", "order", "precision", "known_range", "concave")
        },
        "camera": camera_to_dict(given.file),
        "versions": versions(),
        "command": command_line.get(),
    }


def _lengths(result: Reconstruction) -> dict[str, float | None]:
    values = np.asarray(result.surface.range)[np.asarray(result.surface.valid)].astype(float)
    names = ("nearest", "median", "farthest")
    found = np.percentile(values, [0, 50, 100]).tolist() if values.size else [None] * len(names)
    return dict(zip(names, found, strict=True))


def _given_or_default(options: ReconstructOptions, name: str) -> dict[str, Any]:
    value = getattr(options, name)
    default = next(field.default for field in dataclasses.fields(options) if field.name == name)
    return Setting(value, DEFAULT if value == default else COMMAND_LINE).as_dict()
