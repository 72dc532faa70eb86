"""How far calibrations are off, over random synthetic photographs: the table of figures, with its targets.

    python experiments/calibration_figures.py --draws 200 --out out/calibration

Writes a Markdown table to the terminal and figures.md, every draw to draws.csv and, as soon as it is made, to
draws.jsonl, from which a later run goes on: draws of an unchanged source are not made again (--no-new makes the table
of those that are there). Every row has its own random numbers. A row's figures are the median and the
95th percentile of the absolute error; coverage is the share of draws whose truth lies within 1 and 1.96 quoted σ.
A draw fails if there is no result, or f is more than 1 % off without a warning.
"""

import argparse
import csv
import sys
import time
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple

import jax
import numpy as np
from calibration_draws import ROWS, Draw
from calibration_store import Store
from tqdm import tqdm

WRONG = 0.01
_BANDS = ((1.0, 0.58, 0.78), (1.96, 0.90, 0.99))


class Figure(NamedTuple):
    """A quantity of a row: key of the draws' errors, what it is called, factor to the unit shown, unit, and the
    targets of median and 95th percentile (None: shown without a target)."""

    key: str
    name: str
    factor: float
    unit: str
    median: float | None = None
    p95: float | None = None


_F, _K = "f_error", Figure("k_error", "k", 1.0, "")
_EQ20 = Figure("eq20_error", "f̄ of eq. (20)", 100, "%")
FIGURES: dict[str, tuple[str, tuple[Figure, ...]]] = {
    "circles-known": ("circles, one view, tilt ≤ 1°, height ± 1 %", (Figure(_F, "f", 100, "%", 0.05, 0.2), _EQ20)),
    "circles-square": ("circles, one view, tilt ≤ 1°, height unknown", (Figure(_F, "f", 100, "%", 0.1, 0.3), _EQ20)),
    "circles-one": (
        "circles, one view, tilt ≤ 8°, height unknown",
        (
            Figure(_F, "f", 100, "%", 0.1, 0.3),
            Figure("centre_error_wide", "principal point, α_max ≥ 45°", 1, "px", 0.3),
            _EQ20,
        ),
    ),
    "circles-three": (
        "circles, three views, tilt ≤ 20°",
        (Figure(_F, "f", 100, "%", 0.05, 0.2), Figure("centre_error", "principal point", 1, "px", 0.2, 1.0)),
    ),
    "circles-three-k": (
        "the same, k = 0.035, fitted",
        (Figure(_F, "f", 100, "%", 0.2), _K, Figure("centre_error", "principal point", 1, "px", 0.2, 1.0)),
    ),
    "grid": (
        "line grid, one view, tilt ≤ 20°",
        (Figure(_F, "f", 100, "%", 0.1, 0.5), Figure("centre_error", "principal point", 1, "px", 0.5, 2.0)),
    ),
    "equisolid": ("equisolid lens, one view of circles to 50–62°", (Figure(_F, "f", 100, "%"),)),
    "white-two": (
        "white paper, two views, one tilted ≥ 10°",
        (
            Figure("gamma_error", "γ", 100, "%", None, 2.0),
            Figure("falloff_error", "fall-off to 60°", 100, "%", None, 2),
        ),
    ),
    "white-one": (
        "white paper, one square view",
        (Figure("product_error", "stored values over α", 100, "%", None, 2.0),),
    ),
}


def one_draw(row: str, seed: int) -> Draw:
    """The errors of one draw; with `failed` the reason if there is no result."""
    began = time.perf_counter()
    draw: Draw = {"row": row, "seed": seed, "failed": ""}
    try:
        draw |= ROWS[row](np.random.default_rng([seed, zlib.crc32(row.encode())]))
    except ValueError as error:
        draw["failed"] = str(error)
    if "cx_error" in draw:
        draw["centre_error"] = float(np.hypot(draw["cx_error"], draw["cy_error"]))
        if draw["alpha_max_deg"] >= 45:
            draw["centre_error_wide"] = draw["centre_error"]
    return draw | {"seconds": round(time.perf_counter() - began, 2)}


def is_failure(draw: Draw) -> bool:
    """No result, or f further off than 1 % without a warning."""
    return bool(draw["failed"]) or (abs(draw.get("f_error", 0.0)) > WRONG and not draw["warnings"])


def summary(row: str, draws: list[Draw]) -> list[dict[str, str]]:
    """The lines of the table for one row."""
    title, figures = FIGURES[row][0] + f" ({len(draws)} draws)", FIGURES[row][1]
    lines = [_figure_line(title, figure, draws) for figure in figures]
    lines += coverage(title, draws)
    if row == "equisolid":
        share = np.mean([draw.get("named") == "equisolid" for draw in draws])
        lines.append(_line(title, "called equisolid", f"{100 * share:.1f} %", "≥ 95 %", bool(share >= 0.95)))
    if row == "white-one":
        silent = [draw for draw in draws if draw.get("separated", False)]
        lines.append(
            _line(title, "says what is not determined", f"{len(draws) - len(silent)}/{len(draws)}", "all", not silent)
        )
    share = np.mean([is_failure(draw) for draw in draws])
    return [*lines, _line(title, "failures", f"{100 * share:.1f} %", "≤ 1 %", bool(share <= 0.01))]


def coverage(title: str, draws: list[Draw]) -> list[dict[str, str]]:
    """How often the quoted 1σ of f and of the principal point hold."""
    return [
        _coverage_line(title, name, error, sd, draws)
        for name, error, sd in (("f", "f_error", "f_sd"), ("cx", "cx_error", "cx_sd"), ("cy", "cy_error", "cy_sd"))
        if any(error in draw for draw in draws)
    ]


def _figure_line(title: str, figure: Figure, draws: list[Draw]) -> dict[str, str]:
    values = figure.factor * np.abs([draw[figure.key] for draw in draws if figure.key in draw])
    if not values.size or np.isnan(values).any():
        return _line(title, figure.name, "no value", "", figure.median is None and figure.p95 is None)
    median, p95 = float(np.median(values)), float(np.percentile(values, 95))
    limits = [(limit, value) for limit, value in ((figure.median, median), (figure.p95, p95)) if limit is not None]
    target = " / ".join("–" if limit is None else f"{limit:g}" for limit in (figure.median, figure.p95))
    met = all(value <= limit for limit, value in limits) if limits else None
    shown = f"{target} {figure.unit}" if limits else ""
    return _line(title, figure.name, f"{median:.3f} / {p95:.3f} {figure.unit}", shown, met)


def _coverage_line(title: str, name: str, error: str, sd: str, draws: list[Draw]) -> dict[str, str]:
    ratio = np.array([abs(draw[error]) / draw[sd] for draw in draws if error in draw])
    shares = [float(np.mean(ratio < reach)) for reach, _, _ in _BANDS]
    met = all(low <= share <= high for share, (_, low, high) in zip(shares, _BANDS, strict=True))
    shown = " / ".join(f"{100 * share:.0f} %" for share in shares)
    return _line(title, f"1σ of {name}: truth within 1 / 1.96 σ", shown, "58–78 / 90–99 %", met)


def _line(title: str, what: str, value: str, target: str, met: bool | None) -> dict[str, str]:
    verdict = "" if met is None else "met" if met else "missed"
    return {"row": title, "figure": what, "median / 95 %": value, "target": target, "": verdict}


def markdown(lines: list[dict[str, str]]) -> str:
    """The lines as a Markdown table."""
    names = list(lines[0])
    rows = [names, ["---"] * len(names), *([line[name] for name in names] for line in lines)]
    return "\n".join("| " + " | ".join(row) + " |" for row in rows)


def write_csv(path: Path, draws: list[dict[str, Any]]) -> None:
    names = list(dict.fromkeys(name for draw in draws for name in draw))
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, names)
        writer.writeheader()
        writer.writerows(draws)


def run(
    rows: list[str], seeds: range, budget: float, report: Callable[[str], None], store: Store | None = None
) -> list[Draw]:
    """Draws in turn over the rows, so that a budget (seconds) that ends early leaves all rows equally filled; those in
    the `store` are taken from there."""
    draws, began = [], time.perf_counter()
    for seed in tqdm(seeds, desc="draws", file=sys.stderr):
        known = {row: draw for row in rows if store and (draw := store.get(row, seed))}
        draws += known.values()
        if budget >= 0 and seed > seeds[0] and time.perf_counter() - began > budget:
            report(f"no new draws after {seed - seeds[0]} a row: {budget:.0f} s are spent")
            budget = -1.0
        if budget < 0:
            continue
        for row in (row for row in rows if row not in known):
            draws.append(one_draw(row, seed))
            if store:
                store.add(draws[-1])
    return draws


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--draws", type=int, default=200, help="draws of each row")
    parser.add_argument("--first-seed", type=int, default=0)
    parser.add_argument("--rows", nargs="+", choices=list(ROWS), default=list(ROWS))
    parser.add_argument("--budget", type=float, default=float("inf"), help="seconds after which no draw begins")
    parser.add_argument("--no-new", action="store_true", help="the table of the draws that are there")
    parser.add_argument("--quick", action="store_true", help="two draws a row: does it run?")
    parser.add_argument("--out", type=Path, default=Path("out/calibration"))
    arguments = parser.parse_args()
    jax.config.update("jax_enable_x64", True)
    count = 2 if arguments.quick else arguments.draws
    seeds = range(arguments.first_seed, arguments.first_seed + count)
    budget, store = -1.0 if arguments.no_new else arguments.budget, Store(arguments.out / "draws.jsonl")
    draws = run(arguments.rows, seeds, budget, lambda text: print(text, file=sys.stderr), store)
    by_row = {row: [draw for draw in draws if draw["row"] == row] for row in arguments.rows}
    lines = [line for row, mine in by_row.items() if mine for line in summary(row, mine)]
    if sum(bool(mine) for mine in by_row.values()) > 1:
        lines += coverage(f"all rows together ({len(draws)} draws)", draws)
    if not lines:
        parser.error("there are no draws yet of the present source")
    table = markdown(lines)
    arguments.out.mkdir(parents=True, exist_ok=True)
    write_csv(arguments.out / "draws.csv", draws)
    (arguments.out / "figures.md").write_text(table + "\n", encoding="utf-8")
    print(table)


if __name__ == "__main__":
    main()
