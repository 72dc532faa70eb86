"""Names that a package imports when they are first used."""

import importlib
from collections.abc import Callable, Mapping


def importer(package: str, module_of: Mapping[str, str]) -> Callable[[str], object]:
    """A `__getattr__` for `package`: each name from its module. Raises AttributeError for any other name."""

    def attribute(name: str) -> object:
        if name not in module_of:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        return getattr(importlib.import_module(module_of[name]), name)

    return attribute
