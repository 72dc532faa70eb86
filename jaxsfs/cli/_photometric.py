"""How brightness is read: the settings that turn a photograph into irradiance, and where each came from."""

import dataclasses
from pathlib import Path
from typing import Any

from jaxsfs.camera import CameraFile
from jaxsfs.cli._reconstruct_options import ReconstructOptions
from jaxsfs.cli._settings import CAMERA_FILE, COMMAND_LINE, DEFAULT, Setting, Source, choose
from jaxsfs.files import InputError, Photo
from jaxsfs.files._formats import Unit
from jaxsfs.photo import automatic_response, parse_channel
from jaxsfs.photometry import parse_falloff, parse_response
from jaxsfs.reflectance import parse_reflectance

_DEFAULTS = {"falloff": "none", "reflectance": "lambertian", "channel": "luminance"}
# What was measured on a colonoscope frame of known geometry: ln I ≈ 0.30 ln cos θ − 0.92 ln r + 0.75 ln cos α, which a
# response of gamma 2.2 turns into these.
PRESETS = {"colonoscope": {"response": "gamma:2.2", "falloff": "cos:1.6", "reflectance": "power:0.65"}}
_PARSERS = {
    "response": parse_response,
    "falloff": parse_falloff,
    "reflectance": parse_reflectance,
    "channel": parse_channel,
}


@dataclasses.dataclass(frozen=True)
class Photometric:
    """Settings as text or numbers; `albedo.value` None: the brightest pixel's irradiance is to be taken."""

    response: Setting
    falloff: Setting
    reflectance: Setting
    channel: Setting
    albedo: Setting
    unit: Unit

    def parsed(self, name: str) -> Any:
        """The object that the text of a setting stands for."""
        return _PARSERS[name](getattr(self, name).value)


def photometric(options: ReconstructOptions, file: CameraFile, photo: Photo) -> Photometric:
    """What is given on the command line beats the camera file, that beats the preset, that beats the default.

    Raises InputError that names the source and the key of a value that cannot be used.
    """
    given = {name: getattr(options, name) for name in _PARSERS}
    sources: list[Source] = [
        (COMMAND_LINE, given),
        (CAMERA_FILE, photometry_texts(file, options.camera)),
        (f"preset {options.preset}", preset_texts(options.preset)),
    ]
    settings = {name: choose(name, sources, Setting(text, DEFAULT)) for name, text in _DEFAULTS.items()}
    settings["response"] = _response(sources, photo)
    for name, setting in settings.items():
        try:
            _PARSERS[name](setting.value)
        except ValueError as error:
            where = f"{options.camera}: 'photometry': " if setting.origin == CAMERA_FILE else f"--{name}: "
            raise InputError(f"{where}{error}") from None
    albedo, unit = _scale(options, file, settings["channel"])
    return Photometric(**settings, albedo=albedo, unit=unit)


def preset_texts(name: str | None) -> dict[str, str]:
    """The settings of a preset, as text. Raises InputError for a name that is none."""
    if name is None:
        return {}
    if name not in PRESETS:
        raise InputError(f"--preset: {name!r} is unknown; write one of: {', '.join(PRESETS)}")
    return PRESETS[name]


def photometry_texts(file: CameraFile, path: Path) -> dict[str, str]:
    """The texts of the camera file's photometry that are given. Raises InputError for one that is no text."""
    texts = {name: file.photometry.get(name) for name in _PARSERS}
    for name, text in texts.items():
        if text is not None and not isinstance(text, str):
            raise InputError(f"{path}: 'photometry': {name!r} must be a text such as {_example(name)!r}, got {text!r}")
    return {name: text for name, text in texts.items() if text is not None}


def _example(name: str) -> str:
    return _DEFAULTS.get(name, "srgb")


def _response(sources: list[Source], photo: Photo) -> Setting:
    setting = choose("response", sources, Setting("auto", DEFAULT))
    if setting.value != "auto":
        return setting
    return Setting(automatic_response(photo.dtype), f"automatic ({photo.dtype} image)")


def _scale(options: ReconstructOptions, file: CameraFile, channel: Setting) -> tuple[Setting, Unit]:
    """Gain times albedo, and the unit of length that follows from it."""
    if options.known_range is not None:
        return Setting(1.0, f"free: --known-range {options.known_range} sets the scale"), "mm"
    if options.albedo is not None:
        return Setting(options.albedo, COMMAND_LINE), "scene units"
    calibrated = file.photometry.get("gain_albedo")
    if calibrated is not None:
        if isinstance(calibrated, bool) or not isinstance(calibrated, int | float) or not 0 < calibrated < float("inf"):
            raise InputError(
                f"{options.camera}: 'photometry': 'gain_albedo' must be a positive number, got {calibrated!r}"
            )
        # The product was measured in one channel and says nothing about another.
        if parse_channel(channel.value) == parse_channel(str(file.photometry.get("channel", "luminance"))):
            return Setting(float(calibrated), CAMERA_FILE), _unit(file, options.camera)
    if options.light == "distant":
        return Setting(None, "brightest pixel, which faces the light"), "scene units"
    return Setting(1.0, "default: the surface is known up to one scale factor"), "scene units"


def _unit(file: CameraFile, path: Path) -> Unit:
    """The unit of length in which gain_albedo is the irradiance at distance 1; a file that does not say has none."""
    stated = file.photometry.get("unit", "scene units")
    if stated == "mm":
        return "mm"
    if stated == "scene units":
        return "scene units"
    raise InputError(f"{path}: 'photometry': 'unit' must be mm or scene units, got {stated!r}")
