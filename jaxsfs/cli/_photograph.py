"""`jaxsfs photograph`: synthetic photographs of calibration targets, to try a calibration before printing anything."""

import dataclasses
import json
from pathlib import Path
from typing import Annotated, Literal

from tyro.conf import Positional

from jaxsfs.cli._options import FLAT, value
from jaxsfs.cli._terminal import CannotRun, jax_session, say


@dataclasses.dataclass(frozen=True)
class PhotographOptions:
    # circles, grid, checkerboard, dots or blank.
    target: Annotated[Positional[Literal["circles", "grid", "checkerboard", "dots", "blank"]], value("TARGET")]
    # The 8-bit PNG to write.
    out: Annotated[Path, value("PNG")]
    # Radii in mm of the circles.
    radii: Annotated[tuple[float, ...], value("MM")] = (5.0, 10.0, 15.0, 20.0, 25.0, 30.0)
    # Columns of inner corners or dots.
    columns: int = 9
    # Rows of inner corners or dots.
    rows: int = 7
    # Distance in mm between lines, corners or dots.
    pitch: Annotated[float, value("MM")] = 4.0
    # Distance in mm of the lens from the sheet.
    height: Annotated[float, value("MM")] = 22.0
    # Tilt of the sheet.
    tilt: Annotated[float, value("DEG")] = 0.0
    # Direction in the image of the axis of the tilt (0: to the right).
    tilt_axis: Annotated[float, value("DEG")] = 0.0
    # Camera file; without one a spherical camera of 640 x 480 px with f = 320 px.
    camera: Annotated[Path | None, value("FILE", default="none")] = None
    # Blur by a Gaussian of this width.
    blur: Annotated[float, value("PX")] = 1.0
    # Standard deviation of the noise in stored values, full scale 1.
    noise: Annotated[float, value("SD")] = 0.01
    # Gain times albedo in mm²; without it, the exposure makes the brightest paper 0.85 of full scale.
    gain: Annotated[float | None, value("MM2", default="automatic exposure")] = None
    # Seed of the noise.
    seed: int = 0
    # Replace an earlier picture.
    force: bool = False
    # Print the camera as JSON instead of a summary.
    json: bool = False


def photograph(options: Annotated[PhotographOptions, FLAT]) -> int:
    """What a scope with its light at the lens would see of a printed target, to try a calibration without a printer.

    For example:
      jaxsfs photograph circles --tilt 12 --out A.png
      jaxsfs photograph grid --tilt 15 --tilt-axis 70 --out G.png
    """
    _check(options)
    with jax_session(64):
        return _write(options)


def _check(options: PhotographOptions) -> None:
    for name in ("pitch", "height"):
        if not 0 < getattr(options, name) < float("inf"):
            raise CannotRun(f"--{name} must be a positive distance in mm, got {getattr(options, name):g}")
    if not 0 <= options.tilt < 80:
        raise CannotRun(f"--tilt must lie between 0 and 80 degrees, got {options.tilt:g}")
    if not (0 <= options.blur < 100 and 0 <= options.noise < 1):
        raise CannotRun("--blur must lie between 0 and 100 px, and --noise between 0 and 1")
    if options.columns < 2 or options.rows < 2:
        raise CannotRun(f"--columns and --rows must be at least 2, got {options.columns} and {options.rows}")


def _write(options: PhotographOptions) -> int:
    from data_synth.targets import Studio, photograph as take
    from jaxsfs import files
    from jaxsfs.calibration import tilted
    from jaxsfs.camera import Spherical, camera_to_dict

    camera = (
        Spherical(f=320.0, cx=322.0, cy=237.0, width=640, height=480)
        if options.camera is None
        else files.read_camera(options.camera).camera
    )
    pose = tilted(options.tilt, options.tilt_axis, options.height)
    studio = Studio(blur=options.blur, noise=options.noise)
    picture = take(camera, _pattern(options), pose, studio, options.seed, options.gain)
    files.write_png(options.out, picture, force=options.force)
    if options.json:
        print(json.dumps({"out": str(options.out), "camera": camera_to_dict(camera)}, indent=2))
    else:
        say(f"{options.out}: {camera.width} x {camera.height} px, {options.target} at {options.height:g} mm")
    return 0


def _pattern(options: PhotographOptions):
    from data_synth import target_patterns as patterns

    if options.target == "circles":
        gaps = [b - a for a, b in zip((0.0, *options.radii), options.radii, strict=False)]
        if not gaps or min(gaps) <= 0:
            raise CannotRun("--radii must be positive and increasing, in mm from the centre")
        return patterns.Rings(options.radii, min(1.0, 0.2 * min(gaps)), min(1.0, 0.2 * gaps[0]))
    if options.target == "grid":
        return patterns.LineGrid(options.pitch, options.pitch / 8, 12)
    if options.target == "checkerboard":
        return patterns.Checkerboard(options.columns, options.rows, options.pitch)
    if options.target == "dots":
        return patterns.DotGrid(options.columns, options.rows, options.pitch, options.pitch / 5)
    return patterns.BlankSheet()
