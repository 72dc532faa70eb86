"""All benchmarks: this package against its peers, in turn in one process; a table, also as CSV and Markdown.

    python experiments/benchmarks/run.py --sizes 256 512 1024 --out out/benchmarks
    python experiments/benchmarks/run.py --only level-set --sizes 512
    python experiments/benchmarks/run.py --quick

Peers come with `pip install -e '.[bench]'`; those that are not installed are named in the table with the reason. Times
are medians; `ratio` is a program's time over ours in the same run, by the clock and in CPU time (on a machine with
other work the second says more). Errors are mean absolute differences from the analytic truth.
"""

import argparse
import sys
from pathlib import Path

import arrival
import first_call
import level_set
import measure
import near_light
import orders
import round_in_c
import sphere

COMPARISONS = {
    "arrival": arrival.rows,
    "sphere": sphere.rows,
    "near-light": near_light.rows,
    "orders": orders.rows,
    "level-set": level_set.rows,
    "round-in-c": round_in_c.rows,
    "first-call": first_call.rows,
}


def main() -> None:
    """Reads the options, runs the comparisons, prints and writes the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--only", choices=sorted(COMPARISONS), nargs="+", default=list(COMPARISONS))
    parser.add_argument("--sizes", type=int, nargs="+", default=[256, 512, 1024], help="image widths in px")
    parser.add_argument("--repetitions", type=int, default=7)
    parser.add_argument("--quick", action="store_true", help="tiny sizes: shows that it works, times mean nothing")
    parser.add_argument("--out", type=Path, default=Path("out/benchmarks"))
    options = parser.parse_args()
    sizes, repetitions = ([32], 1) if options.quick else (options.sizes, options.repetitions)
    rows = []
    for name in options.only:
        for size in sizes:
            print(f"{name} {size}² …", file=sys.stderr)
            rows += COMPARISONS[name](size, repetitions)
            measure.write(rows, options.out)
    print(measure.markdown(rows))


if __name__ == "__main__":
    main()
