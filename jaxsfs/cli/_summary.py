"""A result in a few lines for the terminal."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from jaxsfs.cli._clipping import plateau_warning


def summary(record: Mapping[str, Any], folder: Path, seconds: float) -> str:
    """What was found, how far it can be trusted, and where each assumption came from."""
    options, photo, lengths = record["options"], record["figures"]["photograph"], record["figures"]["range"]
    size, unit = record["size"], record["unit"]
    left_out = [f"{photo[key]} {key.replace('_', ' ')}" for key in ("outside", "no_ray", "clipped", "black")]
    rows = [
        ("status", record["status"]["message"]),
        ("range", _range(lengths, unit)),
        *_uncertainty(record.get("uncertainty"), unit),
        ("pixels", f"{photo['used']} of {photo['pixels']} used ({', '.join(left_out)})"),
        *_plateau(photo["plateau"]),
        ("highlights", _preparation(record["figures"]["preparation"])),
        (
            "solution",
            ", ".join(f"{k.replace('_', ' ')} {_number(v)}" for k, v in record["figures"]["solution"].items()),
        ),
    ]
    for name in (
        "mask",
        "response",
        "falloff",
        "reflectance",
        "channel",
        "albedo",
        "smooth",
        "initial",
        "solver",
        "order",
    ):
        value, origin = options[name]["value"], options[name]["origin"]
        rows.append((name, f"{_number(value)} ({origin})"))
    rows.append(("time", _seconds(record["seconds"])))
    head = f"{folder}: {size['width']} x {size['height']} px in {seconds:.1f} s"
    return "\n".join([head, *(f"  {name:<12} {text}" for name, text in rows)])


def _uncertainty(found: Mapping[str, Any] | None, unit: str) -> list[tuple[str, str]]:
    if found is None or found["median"] is None:
        return []
    text = f"median {_number(found['median'])} {unit} ({found['relative_median']:.2%}); {found['statement']}"
    return [("uncertainty", text)]


def _plateau(found: Mapping[str, Any] | None) -> list[tuple[str, str]]:
    if found is None:
        return []
    return [("warning", plateau_warning(found))]


def _seconds(found: Mapping[str, float]) -> str:
    before = sum(found[stage] for stage in ("start", "read", "irradiance"))
    parts = ", ".join(f"{stage} {seconds:.1f}" for stage, seconds in found.items())
    return f"{before:.1f} s before the solver ({parts})"


def _preparation(figures: Mapping[str, Any]) -> str:
    found = figures["highlights"]
    parts = [f"{found['highlights']} pixels ({found['method']})"]
    parts += [
        f"{figures[key]} clipped pixels {words}"
        for key, words in (
            ("restored_from_other_channels", "restored from other channels"),
            ("filled_from_surroundings", "filled from their surroundings"),
        )
        if figures[key]
    ]
    return ", ".join(parts)


def _number(value: Any) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def _range(lengths: Mapping[str, Any], unit: str) -> str:
    if lengths["median"] is None:
        return "no surface"
    nearest, median, farthest = (_number(lengths[name]) for name in ("nearest", "median", "farthest"))
    return f"{nearest} to {farthest} {unit}, median {median}"
