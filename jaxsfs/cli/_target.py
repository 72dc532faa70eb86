"""`jaxsfs target …`: printable calibration targets. Nothing here needs JAX, so the commands start at once."""

import dataclasses
import json
from pathlib import Path
from typing import Annotated

from jaxsfs import files, target
from jaxsfs.cli._options import FLAT, value
from jaxsfs.cli._terminal import say


@dataclasses.dataclass(frozen=True)
class PageOptions:
    # The page to write.
    out: Annotated[Path, value("PDF")]
    # A4, A5 or Letter.
    paper: Annotated[str, value("NAME")] = "A4"
    # Replace the page.
    force: bool = False
    # Print JSON instead of a summary.
    json: bool = False


@dataclasses.dataclass(frozen=True)
class CirclesOptions:
    page: Annotated[PageOptions, FLAT]
    # Radii of the lines' middles in mm, increasing; unequal steps tell the rings apart when some are not seen.
    radii: Annotated[tuple[float, ...], value("MM …")] = target.UNEQUAL_RADII
    # Width of the lines in mm.
    width: Annotated[float | None, value("MM", default="a fifth of the smallest gap, at most 1")] = None
    # No dot in the centre.
    no_dot: bool = False


@dataclasses.dataclass(frozen=True)
class GridOptions:
    page: Annotated[PageOptions, FLAT]
    # Distance of the lines in mm, 1 to 40.
    pitch: Annotated[float, value("MM")] = 5.0
    # Width of the lines in mm.
    width: Annotated[float | None, value("MM", default="a tenth of the pitch")] = None


@dataclasses.dataclass(frozen=True)
class CheckerboardOptions:
    page: Annotated[PageOptions, FLAT]
    # Inner corners in a row: one less than squares.
    columns: Annotated[int, value("N")]
    # Inner corners in a column: one less than squares.
    rows: Annotated[int, value("N")]
    # Side of a square in mm.
    pitch: Annotated[float, value("MM")]


@dataclasses.dataclass(frozen=True)
class DotsOptions:
    page: Annotated[PageOptions, FLAT]
    # Dots in a row.
    columns: Annotated[int, value("N")]
    # Dots in a column.
    rows: Annotated[int, value("N")]
    # Distance of neighbouring dots in mm; with --asymmetric that of the rows, half of that in a row.
    pitch: Annotated[float, value("MM")]
    # Shift every second row by half the distance of the dots in a row.
    asymmetric: bool = False


def circles(options: Annotated[CirclesOptions, FLAT]) -> int:
    """Concentric circles with a centre dot on one page in true millimetres, with a scale bar.

    For example:
      jaxsfs target circles --radii 5 10 15 20 25 30 --out target.pdf
    """
    page = target.circles_page(options.radii, options.width, not options.no_dot, options.page.paper)
    return _write(options.page, page, _EQUAL_STEPS if target.equally_spaced(options.radii) else "")


def grid(options: Annotated[GridOptions, FLAT]) -> int:
    """A grid of lines over the whole page in true millimetres, with a scale bar.

    For example:
      jaxsfs target grid --pitch 5 --out target.pdf
    """
    return _write(options.page, target.grid_page(options.pitch, options.width, options.page.paper))


def checkerboard(options: Annotated[CheckerboardOptions, FLAT]) -> int:
    """A checkerboard on one page in true millimetres, with a scale bar.

    For example:
      jaxsfs target checkerboard --columns 7 --rows 6 --pitch 2 --out target.pdf
    """
    page = target.checkerboard_page(options.columns, options.rows, options.pitch, options.page.paper)
    return _write(options.page, page)


def dots(options: Annotated[DotsOptions, FLAT]) -> int:
    """A grid of dots on one page in true millimetres, with a scale bar.

    For example:
      jaxsfs target dots --columns 4 --rows 11 --pitch 2 --asymmetric --out target.pdf
    """
    page = target.dots_page(options.columns, options.rows, options.pitch, options.asymmetric, options.page.paper)
    return _write(options.page, page)


_EQUAL_STEPS = (
    "\nits circles are equally spaced: where inner ones are hidden, nothing but the centre dot tells which the others "
    "are (without --radii the steps are unequal)"
)


def _write(options: PageOptions, page: bytes, note: str = "") -> int:
    files.write_bytes(options.out, page, force=options.force)
    if options.json:
        print(json.dumps({"out": str(options.out), "paper": options.paper}, indent=2))
    else:
        say(f"{options.out}: print it at 100 %, then measure the bar of 100 mm{note}")
    return 0
