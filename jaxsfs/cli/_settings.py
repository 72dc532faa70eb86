"""Where each value of a reconstruction comes from: command line, then camera file, then preset, then default."""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any

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
