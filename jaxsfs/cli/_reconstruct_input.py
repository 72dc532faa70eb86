"""What `jaxsfs reconstruct` reads and decides before solving."""

import dataclasses
from pathlib import Path
from typing import Literal

import numpy as np
from jaxtyping import Bool, Float

from jaxsfs import files
from jaxsfs.camera import CameraFile
from jaxsfs.cli._clipping import clip_limit
from jaxsfs.cli._initial import check_mask_size, parse_initial, parse_known_range, read_heights, read_known_ranges
from jaxsfs.cli._photometric import Photometric, photometric, preset_texts
from jaxsfs.cli._reconstruct_options import ReconstructOptions
from jaxsfs.cli._settings import CAMERA_FILE, COMMAND_LINE, DEFAULT, Setting
from jaxsfs.cli._terminal import progress
from jaxsfs.estimation import WEAK, PhotometryEstimate, Prior, estimate_photometry, prior_about
from jaxsfs.field import find_field
from jaxsfs.initial import AbstractInitial
from jaxsfs.lights import Lights
from jaxsfs.noise import noise_level, smoothing_for
from jaxsfs.photo import size_message
from jaxsfs.photometry import NoFalloff, parse_falloff, parse_response
from jaxsfs.preparation import prepare
from jaxsfs.reflectance import parse_reflectance


@dataclasses.dataclass(frozen=True)
class Input:
    """What was read and decided before solving."""

    file: CameraFile
    photo: files.Photo
    valid: Bool[np.ndarray, "height width"]
    mask: Setting
    settings: Photometric
    smooth: Setting
    clip: Setting
    initial: AbstractInitial
    occlusions: Bool[np.ndarray, "height width"] | Literal["auto", "off"]
    known_range: tuple[tuple[int, int], float] | None
    lights: Lights | None = None
    estimate: PhotometryEstimate | None = None

    @property
    def size(self) -> tuple[int, int]:
        """(width, height) in px."""
        return self.photo.valid.shape[1], self.photo.valid.shape[0]


def read(options: ReconstructOptions) -> Input:
    """All that the options name. Raises InputError for what cannot be used."""
    file = files.read_camera(options.camera)
    photo = files.read_image(options.image)
    height, width = photo.valid.shape
    if (file.camera.width, file.camera.height) != (width, height):
        raise files.InputError(size_message(str(options.image), (width, height), file.camera))
    settings = photometric(options, file, photo)
    known = None if options.known_range is None else parse_known_range(options.known_range, (width, height))
    initial = (
        parse_initial(initial_form(options).value, (width, height))
        if options.heights is None
        else read_heights(options.heights, (width, height))
    )
    mask, origin = _mask(options, photo, settings.response.value)
    valid = photo.valid & mask
    smooth, contours = _smooth(options, photo, valid), _occlusions(options.occlusions, photo)
    given = Input(file, photo, valid, origin, settings, smooth, _clip(options, photo), initial, contours, known)
    if options.lights is not None:
        _check_scale(options, settings)
        given = dataclasses.replace(given, lights=files.read_lights(options.lights))
    if options.estimate_photometry is None:
        return given
    return _estimated(options.estimate_photometry, given, WEAK if options.preset is None else _prior(options.preset))


def _check_scale(options: ReconstructOptions, settings: Photometric) -> None:
    if settings.albedo.origin == CAMERA_FILE or options.albedo is not None or options.known_range is not None:
        return
    if options.estimate_photometry is None:
        raise files.InputError(
            "--lights has positions in mm, so the scale must be known: give --known-range, --albedo in mm², or a "
            "camera file with a calibrated gain_albedo (jaxsfs calibrate white)"
        )


def _prior(preset: str) -> Prior:
    texts = preset_texts(preset)
    return prior_about(
        parse_response(texts["response"]), parse_falloff(texts["falloff"]), parse_reflectance(texts["reflectance"])
    )


def _estimated(path: Path, given: Input, prior: Prior) -> Input:
    """With response, fall-off, reflectance and scale from known ranges."""
    known = read_known_ranges(path, given.size)
    progress(f"estimating the photometry from {len(known)} known ranges")
    start = given.settings
    prepared = prepare(
        given.photo.values,
        given.file.camera,
        valid=given.valid,
        response=start.parsed("response"),
        falloff=NoFalloff(),
        weights=start.parsed("channel"),
        clip_limit=given.clip.value,
    )
    grey = np.asarray(start.parsed("response").encode(prepared.irradiance.values))
    found = estimate_photometry(grey, given.file.camera, known, np.asarray(prepared.irradiance.valid), prior)
    origin = f"estimated from {found.known} known ranges in {path}"
    texts = {name: Setting(text, origin) for name, text in found.texts().items()}
    settings = dataclasses.replace(start, **texts, albedo=Setting(found.gain_albedo, origin), unit="mm")
    return dataclasses.replace(given, settings=settings, estimate=found)


def _smooth(options: ReconstructOptions, photo: files.Photo, valid: Bool[np.ndarray, "height width"]) -> Setting:
    given = options.smooth_px()
    if given is not None:
        return Setting(given, COMMAND_LINE)
    noise = noise_level(photo.values / max(1.0, float(photo.values.max())), valid)
    return Setting(smoothing_for(noise), f"automatic, noise {noise:.2%} of full scale")


def _clip(options: ReconstructOptions, photo: files.Photo) -> Setting:
    """Stored value from which a pixel is clipped; None: nothing is."""
    return clip_limit(options.clip_limit, photo.dtype, float(photo.values[photo.valid].max(initial=0)))


def _mask(
    options: ReconstructOptions, photo: files.Photo, response: str
) -> tuple[Bool[np.ndarray, "height width"], Setting]:
    if options.mask is None:
        field = find_field(_as_seen(photo.values) if response == "linear" else photo.values)
        return field.mask, Setting(field.description, "automatic")
    mask = files.read_mask(options.mask)
    check_mask_size(options.mask, mask.shape, (photo.valid.shape[1], photo.valid.shape[0]))
    return mask, Setting(f"{options.mask}, {mask.mean():.0%} of the image", COMMAND_LINE)


def _occlusions(given: str, photo: files.Photo) -> Bool[np.ndarray, "height width"] | Literal["auto", "off"]:
    if given == "auto" or given == "off":
        return given
    contours = files.read_mask(Path(given))
    check_mask_size(Path(given), contours.shape, (photo.valid.shape[1], photo.valid.shape[0]))
    return contours


def _as_seen(linear: Float[np.ndarray, "height width *channels"]) -> Float[np.ndarray, "height width *channels"]:
    """Linear light of any scale as a display would show it: what is dark to the eye is what a border is told by."""
    white = max(float(np.percentile(linear, 99.9)), float(np.finfo(np.float32).tiny))
    return np.clip(linear / white, 0, 1).astype(np.float32) ** np.float32(1 / 2.2)


def initial_form(options: ReconstructOptions) -> Setting:
    """What is known to begin with, in words."""
    if options.heights is not None:
        return Setting(f"heights:{options.heights}", COMMAND_LINE)
    if options.initial is not None:
        return Setting(options.initial, COMMAND_LINE)
    return Setting("deadline" if options.light == "camera" else "singular-point", DEFAULT)
