"""`jaxsfs calibrate white`: response, fall-off and gain from photographs of white paper."""

import dataclasses
import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from tyro.conf import Positional

from jaxsfs.cli._options import FLAT, value
from jaxsfs.cli._terminal import CannotRun, jax_session, say

if TYPE_CHECKING:
    from jaxsfs.calibration import PlanePose
    from jaxsfs.camera import CameraFile
    from jaxsfs.cli._calibration_input import Photographs


@dataclasses.dataclass(frozen=True)
class WhiteOptions:
    # Photographs of white paper; printed marks on it are left out.
    images: Annotated[Positional[list[Path]], value("IMAGE")]
    # Camera file. If `calibrate circles|checkerboard|dots` made it from these photographs, it knows their poses.
    camera: Annotated[Path, value("FILE")]
    # Camera file to write: the camera with its photometry, for `reconstruct --camera`. A report goes beside it.
    out: Annotated[Path, value("FILE")]
    # Distance in mm of the lens from the sheet, one for all photographs or one each, where the pose is not known.
    height: Annotated[tuple[float, ...], value("MM")] = ()
    # Tilt in degrees of each sheet, with --height; square-on without it.
    tilt: Annotated[tuple[float, ...], value("DEG")] = ()
    # Direction in degrees of the axis of each tilt in the image (0: to the right), with --tilt.
    tilt_axis: Annotated[tuple[float, ...], value("DEG")] = ()
    # Exponent of the response, stored = light^(1/gamma), if it is known; otherwise it is found where that can be.
    gamma: Annotated[float | None, value("GAMMA", default="found")] = None
    # Exposures of the photographs relative to each other, if they differ.
    exposure: Annotated[tuple[float, ...], value("FACTOR")] = ()
    # luminance, red, green, blue or three weights R,G,B.
    channel: Annotated[str, value("NAME|R,G,B")] = "luminance"
    # Replace earlier files.
    force: bool = False
    # Print all figures instead of a summary.
    json: bool = False


def white(options: Annotated[WhiteOptions, FLAT]) -> int:
    """The photometry of a scope: white paper at a known pose is a standard that everyone has.

    One square photograph does not tell the response from the fall-off: add one tilted by 10° or more, or one from
    another distance. For example:
      jaxsfs photograph circles --tilt 4 --gain 320 --out A.png
      jaxsfs photograph circles --tilt 16 --tilt-axis 120 --gain 320 --seed 1 --out B.png
      jaxsfs calibrate circles A.png B.png --radii 5 10 15 20 25 30 --out camera.json
      jaxsfs calibrate white A.png B.png --camera camera.json --out photometric.json
    """
    with jax_session(64):
        return _run(options)


def _run(options: WhiteOptions) -> int:
    import json

    from jaxsfs import files
    from jaxsfs.calibration import calibrate_white
    from jaxsfs.camera import AbstractCentralCamera, CameraFile, camera_to_dict
    from jaxsfs.cli._calibration_input import read_photographs
    from jaxsfs.cli._calibration_output import check_target, provenance, report_path
    from jaxsfs.report import white_page, white_summary

    check_target(options.out, options.force)
    file = files.read_camera(options.camera)
    camera = file.camera
    if not isinstance(camera, AbstractCentralCamera):
        raise CannotRun(f"{options.camera}: white paper needs a central camera, not {type(camera).__name__}")
    given = read_photographs(options.images, "auto")
    poses = _poses(options, file, given)
    found = calibrate_white(given.images, camera, poses, options.gamma, options.exposure or None, options.channel)
    made_by = provenance(given) | {"camera": str(options.camera)}
    record = camera_to_dict(CameraFile(camera, found.photometry(), file.other))
    record["white_target"] = found.figures() | made_by
    page = white_page(found, given.pictures, given.names, made_by)
    files.write_bytes(report_path(options.out), page.encode(), force=options.force)
    files.write_json(options.out, record, force=options.force)
    if options.json:
        print(json.dumps(record["white_target"], indent=2))
    else:
        say("\n".join([*white_summary(found), f"wrote {options.out} and {report_path(options.out)}"]))
    return 0


def _poses(options: WhiteOptions, file: "CameraFile", given: "Photographs") -> list["PlanePose"]:
    if options.height:
        return _given_poses(options)
    if options.tilt or options.tilt_axis:
        raise CannotRun("--tilt and --tilt-axis say how the sheet stood together with --height (mm); give it as well")
    return [_recorded_pose(file, source, options.camera) for source in given.sources]


def _given_poses(options: WhiteOptions) -> list["PlanePose"]:
    from jaxsfs.calibration import tilted

    count = len(options.images)
    heights = _one_each("--height", options.height, count)
    tilts = _one_each("--tilt", options.tilt or (0.0,), count)
    axes = _one_each("--tilt-axis", options.tilt_axis or (0.0,), count)
    if any(not (math.isfinite(height) and height > 0) for height in heights):
        raise CannotRun(f"--height must be a positive distance in mm, got {' '.join(f'{h:g}' for h in options.height)}")
    if any(not 0 <= tilt < 80 for tilt in tilts):
        raise CannotRun("--tilt must lie between 0 and 80 degrees")
    return [tilted(tilt, axis, height) for tilt, axis, height in zip(tilts, axes, heights, strict=True)]


def _one_each(name: str, values: tuple[float, ...], count: int) -> tuple[float, ...]:
    if len(values) == 1:
        return values * count
    if len(values) != count:
        raise CannotRun(f"{name} needs one number, or one for each of {count} photographs, got {len(values)}")
    return values


def _recorded_pose(file: "CameraFile", source: dict[str, Any], camera: Path) -> "PlanePose":
    """The pose that the camera's own calibration found for the very same photograph."""
    import jax.numpy as jnp

    from jaxsfs.calibration import PlanePose

    rows = file.other.get("calibration", {}).get("photographs", [])
    for row in rows:
        if row.get("sha256") == source["sha256"] and "rotation" in row:
            offset = jnp.asarray([row["offset_x_mm"], row["offset_y_mm"]], float)
            return PlanePose(jnp.asarray(row["rotation"], float), offset, float(row["height_mm"]))
    raise CannotRun(
        f"how the sheet of {source['file']} stood is not known: {camera} was not calibrated from this photograph with "
        "circles, a checkerboard or dots. Calibrate from these photographs first, or give --height (mm) and --tilt"
    )
