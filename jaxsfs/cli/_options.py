"""How options are declared. Each is a dataclass field; the comment above it is its help (tyro reads the source)."""

from typing import Any

from tyro.conf import arg

# the options of a command stand beside each other, not under a common name
FLAT = arg(prefix_name=False, name="")


def value(name: str, *, default: str | None = None, option: str | None = None) -> Any:
    """An option's annotation: `name` of its value in the usage; `default` in words, where the field's is None;
    `option`: another name on the command line than the field's."""
    given: dict[str, Any] = {"name": option, "help_behavior_hint": default and f"(default: {default})"}
    # tyro takes an explicit None for a value
    return arg(metavar=name, **{key: text for key, text in given.items() if text is not None})
