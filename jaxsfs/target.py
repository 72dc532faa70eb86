"""Printable calibration targets: one PDF page in true millimetres.

Every page carries a scale bar to check the printer with, and the command that calibrates from its photographs.
"""

import io
import itertools
import math
from collections.abc import Sequence

from reportlab.lib.units import mm
from reportlab.pdfgen.canvas import Canvas

Length = float | int  # in mm; not `forms.Scalar`, which would wait for JAX
PAPERS = {"A4": (210.0, 297.0), "A5": (148.0, 210.0), "Letter": (215.9, 279.4)}  # width and height in mm
# Not equally spaced: taking one ring for the next one then misfits the seen radii by 6 % at least, where equal steps
# of 5 mm leave 1.6 % (closed form of the ring labels, any four neighbours or more, seen from 20 mm).
UNEQUAL_RADII = (5.0, 8.0, 14.0, 17.0, 24.0, 30.0)
_MARGIN, _FOOT = 8.0, 24.0  # mm: around the page, and for scale bar and text below the target
_POINT = 1 / mm  # in mm


def circles_page(
    radii: Sequence[Length] = UNEQUAL_RADII, width: Length | None = None, dot: bool = True, paper: str = "A4"
) -> bytes:
    """Concentric circles and a centre dot as PDF: lines `width` mm wide with their middles on `radii` (mm).

    `width` None: a fifth of the smallest gap, at most 1 mm. Raises ValueError for radii that do not increase, lines
    that leave no white between them, and a target that does not fit the paper.
    """
    values = [float(radius) for radius in radii]
    edges = [0.0, *values]
    if len(values) < 2 or not all(a < b < math.inf for a, b in itertools.pairwise(edges)):
        raise ValueError(f"expected two or more increasing radii in mm, got {_listed(values) or 'none'}")
    gap = min(b - a for a, b in itertools.pairwise(edges))
    line = _line_width(width, min(0.2 * gap, 1.0), 0.6 * gap)
    page = _Page(paper, 2 * values[-1] + line)
    page.canvas.setLineWidth(line)
    for radius in values:
        page.canvas.circle(page.x, page.y, radius)
    if dot:
        page.disc(page.x, page.y, min(0.2 * values[0], 1.5))
    command = f"jaxsfs calibrate circles PHOTO.png --radii {_listed(values)} --out camera.json"
    return page.pdf(f"circles, radii {_listed(values)} mm, lines {line:g} mm", command)


def equally_spaced(radii: Sequence[Length]) -> bool:
    """Whether three circles or more have equal steps between them, so that a shift by one looks nearly alike."""
    steps = [b - a for a, b in itertools.pairwise(radii)]
    return len(steps) > 1 and max(steps) - min(steps) < 0.01 * max(steps)


def grid_page(pitch: Length = 5.0, width: Length | None = None, paper: str = "A4") -> bytes:
    """A square grid of lines over the page as PDF, `pitch` mm apart, `width` mm wide (None: a tenth of the pitch).

    Raises ValueError for a pitch outside 1 … 40 mm and for lines that leave no white between them.
    """
    if not 1 <= pitch <= 40:
        raise ValueError(f"pitch must lie between 1 and 40 mm, got {pitch:g}")
    line = _line_width(width, 0.1 * pitch, 0.5 * pitch)
    room_x, room_y = _room(paper)
    across, down = int((room_x - line) // pitch), int((room_y - line) // pitch)
    page = _Page(paper, across * pitch + line, down * pitch + line)
    page.canvas.setLineWidth(line)
    page.canvas.setLineCap(2)  # square ends close the corners of the frame
    left, bottom = page.x - across * pitch / 2, page.y - down * pitch / 2
    page.canvas.grid([left + i * pitch for i in range(across + 1)], [bottom + i * pitch for i in range(down + 1)])
    return page.pdf(
        f"line grid, pitch {pitch:g} mm, lines {line:g} mm", "jaxsfs calibrate grid PHOTO.png --out camera.json"
    )


def checkerboard_page(columns: int, rows: int, pitch: Length, paper: str = "A4") -> bytes:
    """A checkerboard with `columns` × `rows` inner corners and squares of `pitch` mm as PDF.

    Raises ValueError for fewer than 2 × 2 corners and for a board that does not fit the paper.
    """
    _check_counts(columns, rows, pitch)
    across, down = columns + 1, rows + 1
    page = _Page(paper, across * pitch, down * pitch)
    left, bottom = page.x - across * pitch / 2, page.y - down * pitch / 2
    for row, column in itertools.product(range(down), range(across)):
        if (row + column) % 2 == 0:
            page.canvas.rect(left + column * pitch, bottom + row * pitch, pitch, pitch, stroke=0, fill=1)
    sizes = f"--columns {columns} --rows {rows} --pitch {pitch:g}"
    return page.pdf(
        f"checkerboard, {columns} x {rows} inner corners, squares {pitch:g} mm",
        f"jaxsfs calibrate checkerboard PHOTO.png {sizes} --out camera.json",
    )


def dots_page(columns: int, rows: int, pitch: Length, asymmetric: bool = False, paper: str = "A4") -> bytes:
    """`columns` × `rows` dots `pitch` mm apart as PDF; their radius is a quarter of the distance of neighbours.

    `asymmetric`: rows `pitch` apart, dots of a row 2 `pitch` apart, every second row shifted by `pitch`. Raises
    ValueError for fewer than 2 × 2 dots and for a grid that does not fit the paper.
    """
    _check_counts(columns, rows, pitch)
    step, shift = (2 * pitch, pitch) if asymmetric else (pitch, 0.0)
    across, down = (columns - 1) * step + shift, (rows - 1) * pitch
    radius = (math.sqrt(2) if asymmetric else 1.0) * pitch / 4
    page = _Page(paper, across + 2 * radius, down + 2 * radius)
    left, top = page.x - across / 2, page.y + down / 2
    for row, column in itertools.product(range(rows), range(columns)):
        page.disc(left + column * step + shift * (row % 2), top - row * pitch, radius)
    sizes = f"--columns {columns} --rows {rows} --pitch {pitch:g}" + (" --asymmetric" if asymmetric else "")
    kind = "asymmetric dots" if asymmetric else "dots"
    return page.pdf(
        f"{kind}, {columns} x {rows}, pitch {pitch:g} mm",
        f"jaxsfs calibrate dots PHOTO.png {sizes} --out camera.json",
    )


class _Page:
    """One page, in mm from its lower left corner, with the target's middle (x, y)."""

    def __init__(self, paper: str, wide: Length, high: Length | None = None):
        room_x, room_y = _room(paper)
        high = wide if high is None else high
        if wide > room_x or high > room_y:
            raise ValueError(
                f"the target is {wide:g} x {high:g} mm, but {paper} has room for {room_x:g} x {room_y:g} mm: use a "
                "smaller pitch or radius, or larger paper"
            )
        width, height = PAPERS[paper]
        self.x, self.y = width / 2, _MARGIN + _FOOT + room_y / 2
        self._room = room_x
        self._file = io.BytesIO()
        # invariant: no date inside, so that the same target is the same file
        self.canvas = Canvas(self._file, pagesize=(width * mm, height * mm), invariant=1)
        self.canvas.setViewerPreference("PrintScaling", "None")
        self.canvas.scale(mm, mm)

    def disc(self, x: Length, y: Length, radius: Length) -> None:
        self.canvas.circle(x, y, radius, stroke=0, fill=1)

    def pdf(self, title: str, command: str) -> bytes:
        """The file, with scale bar and text below the target."""
        self.canvas.setTitle(f"jaxsfs target: {title}")
        self.canvas.setLineWidth(0.2)
        self.canvas.setLineCap(0)
        base = _MARGIN + 15
        self.canvas.rect(_MARGIN, base, 100, 1, stroke=0, fill=1)
        for inside in range(10, 100, 10):  # none at the ends, which would make the bar longer
            self.canvas.line(_MARGIN + inside, base, _MARGIN + inside, base + (4 if inside == 50 else 2.5))
        check = "This bar is 100 mm long: measure it. Print at 100 %, without fitting to the page."
        for drop, line in ((4.5, check), (9, f"jaxsfs target: {title}"), (13.5, command)):
            size = 9 * _POINT
            size *= min(1.0, self._room / self.canvas.stringWidth(line, "Helvetica", size))
            self.canvas.setFont("Helvetica", size)
            self.canvas.drawString(_MARGIN, base - drop, line)
        self.canvas.save()
        return self._file.getvalue()


def _room(paper: str) -> tuple[float, float]:
    """Width and height in mm that a target may have."""
    if paper not in PAPERS:
        raise ValueError(f"paper {paper!r} is unknown; write one of: {', '.join(PAPERS)}")
    width, height = PAPERS[paper]
    return width - 2 * _MARGIN, height - 2 * _MARGIN - _FOOT


def _line_width(width: Length | None, default: Length, limit: Length) -> float:
    line = float(default if width is None else width)
    if not 0 < line < limit:
        raise ValueError(f"lines must be thinner than {limit:g} mm to leave white between them, got {line:g} mm")
    return line


def _check_counts(columns: int, rows: int, pitch: Length) -> None:
    if columns < 2 or rows < 2:
        raise ValueError(f"columns and rows must be at least 2, got {columns} x {rows}")
    if not 0 < pitch < math.inf:
        raise ValueError(f"pitch must be a positive distance in mm, got {pitch:g}")


def _listed(values: Sequence[float]) -> str:
    return " ".join(f"{value:g}" for value in values)
