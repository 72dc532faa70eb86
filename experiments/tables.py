"""What every experiment leaves: a table as CSV and Markdown with the command that made it, and figures as PNG."""

import argparse
import csv
import io
import shlex
import sys
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

Row = Mapping[str, str | int | float]


def markdown(rows: Sequence[Row]) -> str:
    """Rows as a Markdown table; every row has the keys of the first."""
    head = list(rows[0])
    lines = ["| " + " | ".join(head) + " |", "|" + "---|" * len(head)]
    return "\n".join(lines + ["| " + " | ".join(str(row[key]) for key in head) + " |" for row in rows]) + "\n"


def write_tables(out: Path, stem: str, tables: Mapping[str, Sequence[Row]], words: str = "") -> str:
    """Writes `stem`.md (all tables with their titles) and one CSV per table; returns the Markdown text."""
    out.mkdir(parents=True, exist_ok=True)
    command = shlex.join(["python", f"experiments/{Path(sys.argv[0]).name}", *sys.argv[1:]])
    parts = [f"Made by `{command}`.\n"]
    for title, rows in tables.items():
        if not rows:
            continue
        parts.append(f"## {title}\n\n{markdown(rows)}")
        text = io.StringIO()
        writer = csv.DictWriter(text, fieldnames=list(rows[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(rows)
        name = stem if len(tables) == 1 else f"{stem}_{title.split(':')[0].replace(' ', '_')}"
        (out / f"{name}.csv").write_text(text.getvalue(), encoding="utf-8")
    if words:
        parts.append(words + "\n")
    result = "\n".join(parts)
    (out / f"{stem}.md").write_text(result, encoding="utf-8")
    return result


def pyplot():
    """matplotlib.pyplot that draws into files."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    return pyplot


def save(figure, path: Path, dpi: int = 80) -> None:
    """Writes and closes a matplotlib figure."""
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=dpi)
    pyplot().close(figure)


def heat_map(values: dict[str, dict[str, float]], title: str, label: str, path: Path) -> None:
    """Rows × columns of positive numbers in colours of their logarithm, the number in each cell; NaN stays white."""
    import numpy as np

    plt = pyplot()
    columns = list(dict.fromkeys(key for row in values.values() for key in row))
    table = np.array([[row.get(key, np.nan) for key in columns] for row in values.values()], float)
    names = 0.09 * max(map(len, values))  # inches
    size = (1.8 + names + 0.75 * len(columns), 1.8 + 0.34 * len(values))
    figure, axes = plt.subplots(figsize=size, layout="constrained")
    image = axes.imshow(np.log10(np.maximum(table, 1e-6)), cmap="RdYlGn_r", aspect="auto")
    for (row, column), value in np.ndenumerate(table):
        if np.isfinite(value):
            axes.text(column, row, f"{value:.2g}", ha="center", va="center", fontsize=8)
    axes.set_xticks(range(len(columns)), columns, rotation=35, ha="right")
    axes.set_yticks(range(len(values)), list(values))
    axes.set_title(title, fontsize=10)
    figure.colorbar(image, label=f"log₁₀ {label}")
    save(figure, path)


def main(description: str, run: Callable[[Path, bool], object], folder: str) -> None:
    """The command line that the experiments share: --out and --quick."""
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("--out", type=Path, default=Path("out") / folder, help="folder for figures and tables")
    parser.add_argument("--quick", action="store_true", help="small pictures and few of them, seconds")
    options = parser.parse_args()
    run(options.out, options.quick)
