"""Programs side by side: run in turn in one process, medians, ratios to the first, errors; as CSV and Markdown."""

import csv
import importlib
import importlib.util
import os
import platform
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import Any

from jaxsfs.native import preferred

FIELDS = ("comparison", "size", "program", "ms", "ns_per_px", "cpu_ns_per_px", "ratio", "cpu_ratio", "error", "note")


@dataclass(frozen=True)
class Program:
    """`run` is timed; `error` judges what it returned. The time of `setup`, a shorter run, is taken off, and the rest
    divided by `parts` (steps, rounds)."""

    name: str
    run: Callable[[], Any]
    error: Callable[[Any], float] | None = None
    parts: int = 1
    note: str = ""
    setup: Callable[[], Any] | None = None


@dataclass(frozen=True)
class Missing:
    """A peer that this machine does not have, and why."""

    name: str
    note: str


def peer(module: str, name: str | None = None):
    """(module, None) of an installed peer, (None, Missing) otherwise."""
    label = name or module
    if importlib.util.find_spec(module) is None:
        return None, Missing(label, f"skipped: no module {module}; pip install -e '.[bench]'")
    try:
        return importlib.import_module(module), None
    except Exception as error:  # a peer may fail in any way to load; the table says how
        return None, Missing(label, f"skipped: {module} does not load ({error})")


def compare(comparison: str, size: int, programs: list[Program | Missing], repetitions: int) -> list[dict]:
    """One row a program. The first one is ours: ratio = its peer's time/its own, by the clock and in CPU time."""
    present = [p for p in programs if isinstance(p, Program)]
    results = {p.name: p.run() for p in present}  # compiles, warms up
    for p in present:
        _seconds(p.setup)
    errors = {p.name: p.error(results[p.name]) for p in present if p.error}
    del results
    wall, cpu = ({p.name: [] for p in present} for _ in range(2))
    for _ in range(repetitions):
        for p in present:
            (short, short_busy), (long, busy) = _seconds(p.setup), _seconds(p.run)
            wall[p.name].append((long - short) / p.parts)
            cpu[p.name].append((busy - short_busy) / p.parts)
    ours = present[0].name
    rows = []
    for p in programs:
        row = dict.fromkeys(FIELDS, "") | {"comparison": comparison, "size": size, "program": p.name, "note": p.note}
        if isinstance(p, Program):
            seconds, busy = median(wall[p.name]), median(cpu[p.name])
            row |= {"ms": f"{1e3 * seconds:.3g}", "ns_per_px": f"{1e9 * seconds / size**2:.3g}"}
            row |= {"cpu_ns_per_px": f"{1e9 * busy / size**2:.3g}", "ratio": f"{seconds / median(wall[ours]):.2f}"}
            row |= {"cpu_ratio": f"{busy / max(median(cpu[ours]), 1e-9):.2f}"}
            row |= {"error": f"{errors[p.name]:.2e}"} if p.error else {}
        rows.append(row)
    return rows


def _seconds(run) -> tuple[float, float]:
    """By the clock, and of the processor."""
    begin = time.perf_counter(), time.process_time()
    if run:
        run()
    return time.perf_counter() - begin[0], time.process_time() - begin[1]


def by(more: str = "") -> str:
    """A note on who computes our sweeps in single precision."""
    return "float32, " + {"numba": "Numba", "rows": "XLA"}[preferred()] + (more and f", {more}")


def machine() -> str:
    """What the times were measured on."""
    versions = [
        f"{name} {importlib.metadata.version(name)}"
        for name in ("jax", "numpy", "numba")
        if importlib.util.find_spec(name)
    ]
    return (
        f"{platform.machine()}, {len(os.sched_getaffinity(0))} cores, load {os.getloadavg()[0]:.1f}, "
        f"Python {platform.python_version()}, {', '.join(versions)}"
    )


def markdown(rows: list[dict]) -> str:
    """The rows as a table, preceded by command and machine."""
    lines = [f"`python {' '.join(sys.argv)}`", "", machine(), ""]
    lines += ["| " + " | ".join(FIELDS) + " |", "|" + "---|" * len(FIELDS)]
    return "\n".join(lines + ["| " + " | ".join(str(row[field]) for field in FIELDS) + " |" for row in rows]) + "\n"


def write(rows: list[dict], folder: Path) -> None:
    """benchmarks.csv and benchmarks.md in `folder`."""
    folder.mkdir(parents=True, exist_ok=True)
    with (folder / "benchmarks.csv").open("w", newline="") as file:
        writer = csv.DictWriter(file, FIELDS)
        writer.writeheader()
        writer.writerows(rows)
    (folder / "benchmarks.md").write_text(markdown(rows))
