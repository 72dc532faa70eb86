"""What a calibration writes: camera file, report, summary."""

from pathlib import Path
from typing import TYPE_CHECKING, Any

from jaxsfs import files
from jaxsfs.calibration import Calibration
from jaxsfs.cli._calibration_input import Photographs
from jaxsfs.cli._terminal import command_line, progress, say, versions, warn

if TYPE_CHECKING:
    from jaxsfs.cli._calibrate import CalibrateOptions


def check_target(out: Path, force: bool) -> None:
    """Raises InputError before any work where the outputs must not or cannot be written."""
    if out.suffix.lower() != ".json":
        raise files.InputError(f"a camera file is JSON: expected a name such as camera.json after --out, got {out}")
    for path in (out, report_path(out)):
        if path.exists() and not force:
            raise files.InputError(f"{path} exists already; choose another name or overwrite it (--force)")


def report_path(out: Path) -> Path:
    """The page beside the camera file."""
    return out.with_suffix(".report.html")


def write(options: "CalibrateOptions", given: Photographs, found: Calibration) -> int:
    """Writes the camera file and the report, prints the summary or the JSON; the exit code."""
    from jaxsfs.report import calibration_page

    made_by = provenance(given)
    record = found.description()
    for row in record["calibration"]["photographs"]:
        row |= given.sources[row["photograph"] - 1]
    record["calibration"] |= made_by
    progress(f"writing {options.out}")
    page = calibration_page(found, given.pictures, given.names, made_by)
    files.write_bytes(report_path(options.out), page.encode(), force=options.force)
    files.write_json(options.out, record, force=options.force)
    if options.json:
        print(options.out.read_text(encoding="utf-8"), end="")
    else:
        say(_summary(found, given, options.out))
    for text in found.warnings:
        warn(text)
    return 0


def provenance(given: Photographs) -> dict[str, Any]:
    """What made a calibration, so that it can be made again."""
    return {
        "command": command_line.get(),
        "inputs": given.sources,
        "response": given.response_text,
        "versions": versions(),
    }


def _summary(found: Calibration, given: Photographs, out: Path) -> str:
    figures = found.figures()
    lines = [
        found.verdict,
        f"{figures['model']}: f {figures['f']:.2f} ± {figures['f_sd']:.2f} px, principal point "
        f"({figures['cx']:.2f} ± {figures['centre_sd'][0]:.2f}, {figures['cy']:.2f} ± {figures['centre_sd'][1]:.2f}) "
        f"px, rms {figures['rms_px']:.3f} px over {figures['observations']} observations to "
        f"{figures['alpha_max_deg']:.0f}° from the axis",
    ]
    if figures["shape"]:
        terms = zip(figures["shape"], figures["shape_sd"], strict=True)
        lines.append("shape: " + ", ".join(f"{value:.5f} ± {sd:.5f}" for value, sd in terms))
    lines += [_photograph_line(view, given) for view in found.views]
    lines += [f"  {given.names[index]}: left out: {reason}" for index, reason in found.rejected]
    best = ", ".join(f"{score.name} {score.rms:.3f}" for score in found.comparison[:4])
    lines.append(f"models by BIC, rms in px: {best}, …")
    lines += [*found.notes, f"wrote {out} and {report_path(out)}"]
    return "\n".join(lines)


def _photograph_line(view, given: Photographs) -> str:
    figures = view.figures
    share = f"{view.matched} of {view.expected} ({view.matched / view.expected:.0%})" if view.expected else view.matched
    line = f"  {given.names[view.photograph]}: {share} matched, rms {view.rms:.3f} px"
    if "height_mm" in figures:
        line += f", height {figures['height_mm']:.2f} ± {figures['height_sd_mm']:.2f} mm"
        line += f", tilt {figures['tilt_deg']:.1f}°"
    if "paper" in figures:
        paper = figures["paper"]
        line += f", eq. 20 {paper['eq20_f']:.1f} px, closed form {paper['closed_form_f']:.1f} px"
    return line
