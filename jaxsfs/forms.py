"""Small pieces that the parametric curves share: parameters from text, checks, and a power that is safe at 0."""

import math
from collections.abc import Callable, Mapping
from typing import Any

from jaxtyping import Array, Float

from jaxsfs._arrays import AnyArray, module_of

# A parameter of a camera or a curve: a plain number, or an array when it is differentiated or traced.
Scalar = float | int | Float[Array, ""]


def parse_form(what: str, text: str, forms: Mapping[str, tuple[Callable[..., Any], tuple[str, ...]]]) -> Any:
    """An object from `name` or `name:number,…`; `forms` maps names to (class, names of the numbers).

    Raises ValueError that lists every accepted form.
    """
    name, _, rest = text.strip().lower().partition(":")
    usage = ", ".join(n + (":" + ",".join(args) if args else "") for n, (_, args) in forms.items())
    if name not in forms:
        raise ValueError(f"{what} {text!r} is unknown; write one of: {usage}")
    make, names = forms[name]
    try:
        numbers = [float(part) for part in rest.split(",")] if rest else []
    except ValueError:
        raise ValueError(f"{what} {text!r}: {rest!r} is not a number; write one of: {usage}") from None
    if len(numbers) != len(names) or not all(math.isfinite(x) for x in numbers):
        raise ValueError(f"{what} {text!r} needs {len(names)} finite number(s); write one of: {usage}")
    return make(*numbers)


def require(value: Scalar, condition: Callable[[Any], bool], message: str) -> None:
    """Checks a concrete parameter; a traced one passes (its value is not known yet)."""
    if isinstance(value, int | float) and not condition(value):
        raise ValueError(f"{message}, got {value}")


def power(base: Float[AnyArray, "*shape"], exponent: Scalar) -> Float[AnyArray, "*shape"]:
    """base^exponent, 0 for base ≤ 0, with derivative 0, not NaN, there; in numpy for numpy arrays."""
    xp, positive = module_of(base, exponent), base > 0
    return xp.where(positive, xp.where(positive, base, 1) ** exponent, 0)
