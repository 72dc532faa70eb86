"""`jaxsfs measure`: lengths and areas on a reconstructed surface."""

import dataclasses
import json
import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from tyro.conf import Positional

from jaxsfs.cli._options import FLAT, value
from jaxsfs.cli._settings import numbers
from jaxsfs.cli._terminal import CannotRun, jax_session, warn

if TYPE_CHECKING:
    from jaxsfs.files import StoredResult

_NOT_TRUSTWORTHY = 3


@dataclasses.dataclass(frozen=True)
class MeasureOptions:
    # Folder that reconstruct wrote (range.tiff and result.json), or its surface.npz.
    result: Annotated[Positional[Path], value("RESULT")]
    # Two pixels of the photograph, which need not be whole: the straight distance between what they show, and the
    # shortest way along the surface.
    between: Annotated[tuple[str, str] | None, value("U,V U,V", default="none")] = None
    # Image of the photograph's size, non-zero where the surface's area is wanted.
    area: Annotated[Path | None, value("MASK", default="none")] = None
    # Print JSON instead of a table.
    json: bool = False

    def __post_init__(self):
        if self.between is None and self.area is None:
            raise CannotRun("nothing to measure: give --between U,V U,V or --area MASK.png")
        self.pixels()

    def pixels(self) -> list[tuple[float, float]]:
        """The two points of --between as (u, v)."""
        points = [numbers("--between", text, "U,V") for text in self.between or ()]
        if not all(math.isfinite(x) for point in points for x in point):
            raise CannotRun("--between needs finite pixels in the form U,V")
        return [(u, v) for u, v in points]


def measure(options: Annotated[MeasureOptions, FLAT]) -> int:
    """Distances between two points of a surface, straight and along it, and the area of a region.

    For example:
      jaxsfs render wavy-wall --out view
      jaxsfs reconstruct view/image.png --camera view/camera.json --out result
      jaxsfs measure result --between 40,40 60.5,52

    In millimetres when the result's scale is known, with 1 sigma when the result has the uncertainty of its range. Exit
    code 3: measured on a result that is not to be trusted.
    """
    with jax_session(32):
        from jaxsfs import files

        stored = files.read_result(options.result)
        record = {"result": str(options.result), "unit": stored.unit} | _measured(options, stored)
    print(json.dumps(record, indent=2) if options.json else _table(record))
    if stored.trustworthy:
        return 0
    warn(f"the result is not to be trusted: {stored.message}")
    return _NOT_TRUSTWORTHY


def _measured(options: MeasureOptions, stored: "StoredResult") -> dict[str, Any]:
    from jaxsfs import files
    from jaxsfs.measuring import measure_area, measure_length

    record: dict[str, Any] = {}
    if options.between is not None:
        start, end = options.pixels()
        length = measure_length(stored.surface, start, end, stored.sigma)
        record["between"] = {
            "from": {"pixel": list(start), "point": length.start.tolist()},
            "to": {"pixel": list(end), "point": length.end.tolist()},
            "straight": length.straight,
            "straight_sd": _known(length.straight_sd),
            "along_surface": _known(length.along),
            "along_surface_sd": _known(length.along_sd),
        }
    if options.area is not None:
        area = measure_area(stored.surface, files.read_mask(options.area), stored.sigma)
        record["area"] = vars(area) | {"mask": str(options.area), "sd": _known(area.sd)}
    return record


def _known(number: float) -> float | None:
    return number if math.isfinite(number) else None


def _table(record: dict[str, Any]) -> str:
    unit, rows = record["unit"], []
    if "between" in record:
        found = record["between"]
        rows.append(("straight", f"{_with_sd(found['straight'], found['straight_sd'])} {unit}"))
        apart = "none: the surface is cut between the two"
        along = found["along_surface"]
        text = apart if along is None else f"{_with_sd(along, found['along_surface_sd'])} {unit}"
        rows.append(("along the surface", text))
    if "area" in record:
        found = record["area"]
        square = "mm²" if unit == "mm" else f"({unit})²"
        where = "" if found["pixels"] == found["marked"] else f" on {found['pixels']} of {found['marked']} pixels"
        rows.append(("area", f"{_with_sd(found['area'], found['sd'])} {square}{where}"))
    width = max(len(name) for name, _ in rows)
    return "\n".join(f"{name:<{width}}  {text}" for name, text in rows)


def _with_sd(number: float, sd: float | None) -> str:
    return f"{number:.5g}" if sd is None else f"{number:.5g} ± {sd:.2g}"
