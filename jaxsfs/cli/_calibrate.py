"""`jaxsfs calibrate circles|grid|checkerboard|dots`: a camera file from photographs of a printed target."""

import dataclasses
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from tyro.conf import Positional

from jaxsfs.cli._options import FLAT, value
from jaxsfs.cli._terminal import CannotRun, jax_session

if TYPE_CHECKING:
    from jaxsfs.calibration import Calibration


@dataclasses.dataclass(frozen=True)
class CalibrateOptions:
    # Photographs of the target, all from one camera mode.
    images: Annotated[Positional[list[Path]], value("IMAGE")]
    # Camera file to write; the report goes beside it, as NAME.report.html.
    out: Annotated[Path, value("FILE")]
    # Lens model: spherical, spherical-k, equisolid, equidistant, stereographic, perspective, kannala-brandt-2,
    # kannala-brandt, scaramuzza; auto takes the one that the comparison prefers.
    model: Annotated[str, value("NAME|auto")] = "spherical"
    # Fit the aspect of the pixels as well.
    aspect: bool = False
    # The photographs' tone curve; edges keep their place in linear light only.
    response: Annotated[str, value("auto|srgb|linear|gamma:G")] = "auto"
    # Replace an earlier camera file and report.
    force: bool = False
    # Print the camera file (with all figures) instead of a summary.
    json: bool = False


@dataclasses.dataclass(frozen=True)
class CirclesOptions(CalibrateOptions):
    # Radii in mm of all printed circles, from the inside out.
    radii: Annotated[tuple[float, ...], value("MM")] = ()
    # Distance in mm of the lens from the sheet, if it was measured: a hint, never taken as exact.
    height: Annotated[float | None, value("MM", default="unknown")] = None
    # How well the height is known, as a fraction of it.
    height_tolerance: Annotated[float, value("FRACTION")] = 0.02


@dataclasses.dataclass(frozen=True)
class BoardOptions(CalibrateOptions):
    # Columns of inner corners (checkerboard) or dots.
    columns: Annotated[int | None, value("N", default="required")] = None
    # Rows of inner corners or dots.
    rows: Annotated[int | None, value("N", default="required")] = None
    # Distance in mm between neighbours.
    pitch: Annotated[float | None, value("MM", default="required")] = None
    # Let the two scales of the sheet differ (printers often stretch one by some per mille).
    two_scales: bool = False


@dataclasses.dataclass(frozen=True)
class DotsOptions(BoardOptions):
    # Every second row is shifted by half; pitch is then the distance between rows.
    asymmetric: bool = False
    # Spacing of columns over what --pitch says, for grids whose two spacings differ.
    stretch: Annotated[float, value("RATIO")] = 1.0


def circles(options: Annotated[CirclesOptions, FLAT]) -> int:
    """The camera from photographs of concentric circles of known radii (the paper's eqs. 19 and 20 start the fit).

    For example:
      jaxsfs photograph circles --tilt 4 --out A.png
      jaxsfs photograph circles --tilt 16 --tilt-axis 120 --seed 1 --out B.png
      jaxsfs calibrate circles A.png B.png --radii 5 10 15 20 25 30 --out camera.json
    """
    if not options.radii:
        raise CannotRun("--radii is missing: list the radius in mm of every printed circle, such as --radii 5 10 15")
    with jax_session(64):
        from jaxsfs.calibration import calibrate_circles

        more = {"radii": options.radii, "height": options.height, "height_tolerance": options.height_tolerance}
        return _run(options, calibrate_circles, more)


def grid(options: Annotated[CalibrateOptions, FLAT]) -> int:
    """The camera from photographs of a printed grid (lines, dots or checkerboard) of unknown size: lines are straight.

    For example:
      jaxsfs photograph grid --tilt 15 --tilt-axis 70 --out A.png
      jaxsfs calibrate grid A.png --out camera.json
    """
    with jax_session(64):
        from jaxsfs.calibration import calibrate_grid

        return _run(options, calibrate_grid, {})


def checkerboard(options: Annotated[BoardOptions, FLAT]) -> int:
    """The camera from photographs of a checkerboard; columns and rows count inner corners, not squares.

    For example:
      jaxsfs photograph checkerboard --columns 7 --rows 6 --pitch 3.5 --tilt 15 --out A.png
      jaxsfs calibrate checkerboard A.png --columns 7 --rows 6 --pitch 3.5 --out camera.json
    """
    sizes = _sizes(options)
    with jax_session(64):
        from jaxsfs.calibration import calibrate_checkerboard

        return _run(options, calibrate_checkerboard, sizes)


def dots(options: Annotated[DotsOptions, FLAT]) -> int:
    """The camera from photographs of a grid of dots.

    For example:
      jaxsfs photograph dots --columns 9 --rows 7 --pitch 4 --tilt 15 --out A.png
      jaxsfs calibrate dots A.png --columns 9 --rows 7 --pitch 4 --out camera.json
    """
    sizes = _sizes(options)
    with jax_session(64):
        from jaxsfs.calibration import calibrate_dots

        return _run(options, calibrate_dots, sizes | {"asymmetric": options.asymmetric, "stretch": options.stretch})


def _sizes(options: BoardOptions) -> dict[str, Any]:
    if options.columns is None or options.rows is None or options.pitch is None:
        raise CannotRun("--columns, --rows and --pitch (mm) are all needed: they say what was printed")
    return {
        "columns": options.columns,
        "rows": options.rows,
        "pitch": options.pitch,
        "two_scales": options.two_scales,
    }


def _run(options: CalibrateOptions, calibrate: Callable[..., "Calibration"], more: dict[str, Any]) -> int:
    """Reads the photographs, calibrates with the common options and `more`, writes."""
    from jaxsfs.cli import _calibration_input, _calibration_output

    _calibration_output.check_target(options.out, options.force)
    given = _calibration_input.read_photographs(options.images, options.response)
    found = calibrate(given.images, model=options.model, aspect=options.aspect, response=given.response, **more)
    return _calibration_output.write(options, given, found)
