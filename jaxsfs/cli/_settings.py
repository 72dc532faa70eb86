"""Where each value of a reconstruction comes from: command line, then camera file, then preset, then default."""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

from jaxsfs.cli._terminal import CannotRun

COMMAND_LINE = "command line"
CAMERA_FILE = "camera file"
DEFAULT = "default"


@dataclasses.dataclass(frozen=True)
class Setting:
    """A value and where it came from, in words."""

    value: Any
    origin: str

    def as_dict(self) -> dict[str, Any]:
        """For result.json."""
        return {"value": self.value, "origin": self.origin}


Source = tuple[str, Mapping[str, Any]]  # origin in words, values; None means not given


def choose(name: str, sources: Sequence[Source], default: Setting) -> Setting:
    """The first source's value for `name` that is given, or the default."""
    for origin, values in sources:
        if values.get(name) is not None:
            return Setting(values[name], origin)
    return default


def given_or_default(options: Any, name: str, used: Any = None) -> Setting:
    """The option `name` of a dataclass of options as a setting; `used`: the value that took its place, if one did."""
    given = getattr(options, name)
    default = next(field.default for field in dataclasses.fields(options) if field.name == name)
    return Setting(given if used is None else used, DEFAULT if given == default else COMMAND_LINE)


def check_albedo(albedo: float | None) -> None:
    """Raises CannotRun for an --albedo that is no albedo."""
    if albedo is not None and not 0 < albedo < float("inf"):
        raise CannotRun(f"--albedo must be positive and finite, got {albedo:g}")


def smooth_px(smooth: str) -> float | None:
    """The σ that --smooth gives in px, None for auto. Raises CannotRun for anything else."""
    if smooth == "auto":
        return None
    try:
        sigma = float(smooth)
    except ValueError:
        sigma = -1.0
    if not 0 <= sigma < float("inf"):
        raise CannotRun(f"--smooth must be auto or 0 or more pixels, got {smooth}")
    return sigma


def numbers(what: str, text: str, form: str) -> list[float]:
    """The numbers of `text` in the form such as "U,V,R". Raises ValueError that shows the form."""
    wanted = form.split(",")
    try:
        values = [float(part) for part in text.split(",")]
    except ValueError:
        raise ValueError(f"{what} needs numbers in the form {form}, got {text!r}") from None
    if len(values) != len(wanted):
        raise ValueError(f"{what} needs {len(wanted)} numbers in the form {form}, got {text!r}")
    return values


def check_clip_limit(text: str) -> float | None:
    """The share of full scale that --clip-limit gives, None for its words. Raises CannotRun for anything else."""
    if text in ("auto", "highest", "off"):
        return None
    try:
        limit = float(text)
    except ValueError:
        limit = 0.0
    if not 0 < limit < float("inf"):
        raise CannotRun(f"--clip-limit must be auto, highest, off or a share of full scale above 0, got {text}")
    return limit
