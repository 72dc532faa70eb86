"""Every method the paper names, the paper itself and jaxsfs side by side, each on the pictures its model allows.

    python experiments/methods.py --out out/methods
    python experiments/methods.py --quick

`distant`: parallel rays and a distant light (survey vase, sphere, peaks, ripples; lights (0,0,1) and (1,0,1)). Error:
mean |ΔZ| after the best shift, as a share of the scene's depth, and the mean angle between normals. What a method is
given beside picture and light stands in the table (`summits`: their places and heights; `rim`: true slopes on the
rim). `near`: one light at the lens, spherical camera; AbsRel of range after median alignment, over the pixels that
all methods answer. `photograph`: the same from a stored 8-bit colour picture with highlights, where the paper takes
R − G. `merging`: what each way of joining several singular points adds. `curve`: where the chain of points of
eqs. (1)–(2) crosses itself. Seconds are CPU time of one warm call on this machine; `faster and better`: how many rows
are both faster and more accurate.
"""

import sys
import time
from collections.abc import Callable
from pathlib import Path

import jax
import numpy as np
from methods_distant import curve_figure, distant_table, merging_table
from methods_near import near_table, photograph_table
from tables import heat_map, main, pyplot, save, write_tables
from tqdm import tqdm


def timed(call: Callable[[], object], warm: bool) -> tuple[object, float]:
    """Result and CPU seconds; `warm`: called once before, so that compilation does not count."""
    if warm:
        jax.block_until_ready(call())
    clock = time.process_time()
    result = jax.block_until_ready(call())
    return result, time.process_time() - clock


def scatter(rows: list[dict], path: Path) -> None:
    """Accuracy against time, one colour per method, one point per scene."""
    plt = pyplot()
    figure, axes = plt.subplots(figsize=(8, 5), layout="constrained")
    for method in dict.fromkeys(row["method"] for row in rows):
        mine = [row for row in rows if row["method"] == method]
        marker = "o" if method.startswith("jaxsfs") else "x"
        axes.plot([max(r["cpu s"], 1e-3) for r in mine], [r["AbsRel"] for r in mine], marker, label=method)
    axes.set(xscale="log", yscale="log", xlabel="CPU time in s", ylabel="AbsRel of range", title="one point per scene")
    axes.legend(fontsize=7, loc="center left", bbox_to_anchor=(1, 0.5))
    axes.grid(True, alpha=0.3)
    save(figure, path)


def grid_of(rows: list[dict], column: str, error: str) -> dict[str, dict[str, float]]:
    """Method → scene → error."""
    result: dict[str, dict[str, float]] = {}
    for row in rows:
        value = row[error]
        result.setdefault(str(row["method"]), {})[str(row[column])] = np.nan if value == "–" else float(value)
    return result


def run(out: Path, quick: bool) -> dict[str, list[dict]]:
    """Writes tables and figures to `out` and returns the tables' rows."""
    steps = tqdm(total=4, file=sys.stderr, disable=None)
    tables = {}
    for name, make in (
        ("distant", distant_table),
        ("merging", merging_table),
        ("near", near_table),
        ("photograph", photograph_table),
    ):
        tables[name] = make(quick, timed)
        steps.update()
    steps.close()
    tables["curve"] = curve_figure(quick, out / "methods_curve.png")
    for row in tables["distant"]:
        row["picture"] = f"{row['scene']} {row['light']}"
    heat_map(grid_of(tables["distant"], "picture", "height"), "distant light: error of height, share of the depth",
             "error", out / "methods_distant.png")  # fmt: skip
    heat_map(grid_of(tables["near"], "scene", "AbsRel"), "light at the lens: AbsRel of range", "AbsRel",
             out / "methods_near.png")  # fmt: skip
    scatter(tables["near"], out / "methods_time.png")
    for row in tables["distant"]:
        del row["picture"]
    text = write_tables(out, "methods", tables)
    print(text)
    return tables


if __name__ == "__main__":
    main("Every method the paper names beside the paper's and ours.", run, "methods")
