"""Building blocks of a self-contained HTML page."""

import json
from collections.abc import Mapping, Sequence
from html import escape
from typing import Any

import numpy as np

_STYLE = """
:root { color-scheme: light dark; --ink: #1c2430; --paper: #ffffff; --line: #d5dae2; --soft: #f2f4f8; --warn: #fff3d6;
  --faint: #5b6675; --stage: linear-gradient(#e9edf3, #c9d0da); }
@media (prefers-color-scheme: dark) {
  :root { --ink: #e4e8ee; --paper: #14181f; --line: #39414d; --soft: #1d232c; --warn: #463a17;
    --faint: #9aa5b4; --stage: linear-gradient(#2a313c, #171b22); }
}
body { font: 16px/1.5 system-ui, sans-serif; color: var(--ink); background: var(--paper); margin: 0 auto;
  max-width: 72rem; padding: 1rem; }
h1 { font-size: 1.5rem; } h2 { font-size: 1.15rem; margin-top: 2rem; }
.verdict { font-size: 1.1rem; background: var(--soft); padding: .75rem 1rem; border-radius: .4rem; }
.warning { background: var(--warn); padding: .6rem 1rem; border-radius: .4rem; margin: .4rem 0; }
.wide { overflow-x: auto; }
table { border-collapse: collapse; font-variant-numeric: tabular-nums; }
th, td { border-bottom: 1px solid var(--line); padding: .25rem .75rem .25rem 0; text-align: left; vertical-align: top; }
img { max-width: 100%; height: auto; background: #fff; border-radius: .3rem; }
figure { margin: 1rem 0; } figcaption { font-size: .9rem; }
h3 { font-size: 1rem; margin: 0 0 .4rem; font-weight: 600; }
.panels { display: grid; grid-template-columns: repeat(auto-fill, minmax(min(20rem, 100%), 1fr)); gap: 1.5rem;
  margin: 1.5rem 0; }
.panels figure { margin: 0; min-width: 0; } .panels img, .fronts { display: block; width: 100%; height: auto;
  background: var(--soft); border-radius: .3rem; }
.panels p { margin: .4rem 0 0; color: var(--faint); }
.bar { margin: .5rem .2rem 0; font-size: .8rem; font-variant-numeric: tabular-nums; }
.ramp { height: .6rem; border-radius: .2rem; }
.ticks { position: relative; height: 1.2rem; } .ticks span { position: absolute; transform: translateX(-50%); }
.unit { text-align: center; }
.legend { list-style: none; padding: 0; margin: .5rem 0 0; font-size: .85rem; }
.legend i { display: inline-block; width: .8rem; height: .8rem; border-radius: .2rem; margin-right: .4rem; }
.fronts path { fill: none; stroke-width: 2px; vector-effect: non-scaling-stroke; }
.fronts .under { stroke: #0009; stroke-width: 3.5px; }
.fronts text { fill: #fff; stroke: #000b; stroke-width: .25em; paint-order: stroke; text-anchor: middle;
  font-family: system-ui, sans-serif; }
.chart { display: block; width: 100%; max-width: 55rem; height: auto; }
.chart text { fill: currentColor; font: 13px system-ui, sans-serif; }
.chart path { fill: none; } .chart .grid { stroke: var(--line); } .chart .rule { stroke: var(--faint); }
.chart .curve { stroke-width: 2px; }
.chart .marks { stroke-width: 8px; stroke-linecap: round; }
.chart .cloud { stroke-width: 4px; stroke-linecap: round; opacity: .4; }
.over { display: block; width: 100%; height: auto; border-radius: .3rem; }
.over path { fill: none; vector-effect: non-scaling-stroke; }
.over .dots { stroke-width: 3px; stroke-linecap: round; } .over .crosses { stroke-width: 1.5px; }
.over .arrows { stroke: none; fill: #ffd21f; } .over .middle { stroke-width: 2px; }
.panels .coarse img { image-rendering: pixelated; }
.viewer { border: 1px solid var(--line); border-radius: .4rem; overflow: hidden; }
.stage { position: relative; background: var(--stage); }
.stage canvas { display: block; width: 100%; height: min(34rem, 70vh); touch-action: none; cursor: grab; }
.stage canvas:focus-visible { outline: 2px solid #2f7de1; outline-offset: -2px; }
.stage svg { position: absolute; inset: 0; width: 100%; height: 100%; pointer-events: none; }
.stage polyline { fill: none; stroke: #ffffff; stroke-width: 1.5; stroke-dasharray: 5 4; }
.stage polyline.surface { stroke: #ff3df0; stroke-width: 2.5; stroke-dasharray: none; }
.stage circle { fill: #ff3df0; stroke: #fff; stroke-width: 1.5; }
.stage text { fill: #fff; stroke: #000b; stroke-width: 3px; paint-order: stroke; font: 600 15px system-ui, sans-serif; }
.tools { display: flex; gap: 1rem; align-items: center; padding: .5rem .75rem; border-top: 1px solid var(--line); }
.tools select, .tools button { font: inherit; padding: .15rem .5rem; }
.reading { margin: 0; padding: 0 .75rem .6rem; font-size: .9rem; overflow-wrap: anywhere; }
pre { background: var(--soft); padding: .75rem; overflow-x: auto; white-space: pre-wrap; overflow-wrap: anywhere; }
"""


def page(title: str, parts: Sequence[str]) -> str:
    """The whole document; `parts` are HTML."""
    head = f'<meta charset="utf-8"><meta name="viewport" content="width=device-width, initial-scale=1"><title>{title}'
    return (
        f'<!doctype html>\n<html lang="en"><head>{head}</title><style>{_STYLE}</style></head>\n<body>\n'
        + "\n".join([f"<h1>{escape(title)}</h1>", *parts])
        + "\n</body></html>\n"
    )


def heading(text: str) -> str:
    return f"<h2>{escape(text)}</h2>"


def paragraph(text: str, kind: str = "") -> str:
    return f'<p class="{kind}">{escape(text)}</p>' if kind else f"<p>{escape(text)}</p>"


def record(values: Mapping[str, Any]) -> str:
    """A dictionary as JSON that people can read."""
    return code(json.dumps(values, indent=2, default=str, ensure_ascii=False))


def code(text: str) -> str:
    return f"<pre>{escape(text)}</pre>"


def table(rows: Sequence[Sequence[Any]], header: Sequence[str] = ()) -> str:
    """Rows of a table; numbers with five significant digits."""
    top = f"<tr>{''.join(f'<th>{escape(name)}</th>' for name in header)}</tr>" if header else ""
    body = "".join(f"<tr>{''.join(f'<td>{escape(_cell(cell))}</td>' for cell in row)}</tr>" for row in rows)
    return f'<div class="wide"><table>{top}{body}</table></div>'


def _cell(cell: Any) -> str:
    if cell is None:
        return "–"
    return f"{cell:.5g}" if isinstance(cell, float | np.floating) else str(cell)
