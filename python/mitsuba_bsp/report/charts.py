"""Charts that react to the pointer, as what Plotly's script is given: traces and a layout."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from typing import Any

from ..figures import COLOURS
from ..records import Record
from ..speeds import BASELINES
from .measures import Measure

Chart = dict[str, Any]

_HEIGHT, _BAR, _LEGEND_LINE = 130, 26, 20

_SYMBOLS = (
    "circle", "square", "diamond", "triangle-up", "cross", "x", "star", "triangle-down", "pentagon", "hexagram",
    "bowtie", "hourglass",
)  # fmt: skip

#: Of more accelerators than that the quickest are drawn; the others are in the tables.
_MOST = 20


def colour_of(spec: str) -> str:
    """Of the kind of accelerator."""
    return COLOURS.get(spec.partition(":")[0], "#999999")


def order_of(spec: str) -> tuple[int, list[str | float]]:
    """Where a spec is among others: kinds as everywhere, those of one kind together, by their numbers."""
    kinds = list(COLOURS)
    kind = spec.partition(":")[0]
    parts = re.split(r"(\d+\.?\d*)", spec)
    own = [float(part) if place % 2 else part for place, part in enumerate(parts)]
    return kinds.index(kind) if kind in kinds else len(kinds), own


def times_chart(measure: Measure) -> Chart:
    """Bars of medians, the quickest on top, with the range of the repetitions."""
    specs = sorted(measure.times, key=measure.median)[:_MOST][::-1]
    middle = [measure.median(spec) for spec in specs]
    ranges = [measure.spread(spec) for spec in specs]
    hints = [_speeds(measure, spec) for spec in specs]
    trace = {
        "type": "bar",
        "orientation": "h",
        "y": specs,
        "x": middle,
        "marker": {"color": [colour_of(spec) for spec in specs], "line": {"color": "#888", "width": 1.5}},
        "error_x": {
            "type": "data",
            "symmetric": False,
            "array": [high - mid for (_, high), mid in zip(ranges, middle, strict=True)],
            "arrayminus": [mid - low for (low, _), mid in zip(ranges, middle, strict=True)],
            "color": "#888",
        },
        "customdata": hints,
        "hovertemplate": f"<b>%{{y}}</b><br>%{{x:.4g}} {measure.unit}<br>%{{customdata}}<extra></extra>",
    }
    fewer = f"; the {_MOST} quickest of {len(measure.times)}" if len(measure.times) > _MOST else ""
    title = f"{measure.what}, {measure.unit} ({measure.run}); less is better{fewer}"
    return _chart([trace], title, height=_HEIGHT + _BAR * len(specs))


def trade_chart(trace_time: Measure, build_time: Measure) -> Chart | None:
    """Time to build against time to trace, a point an accelerator; None if they have none in common."""
    common = sorted((spec for spec in trace_time.times if spec in build_time.times), key=trace_time.median)
    if not common:
        return None
    specs = sorted(common[:_MOST], key=order_of)
    traces = [
        {
            "type": "scatter",
            "mode": "markers",
            "x": [build_time.median(spec)],
            "y": [trace_time.median(spec)],
            "name": spec,
            "marker": {
                "size": 12,
                "color": colour_of(spec),
                "symbol": symbol,
                "line": {"color": "#888", "width": 1.5},
            },
            "hovertemplate": f"<b>{spec}</b><br>build %{{x:.3g}} s<br>{trace_time.what} %{{y:.4g}} {trace_time.unit}"
            "<extra></extra>",
        }
        for spec, symbol in zip(specs, _symbols(specs), strict=True)
    ]
    fewer = f"; the {_MOST} quickest of {len(common)}" if len(common) > _MOST else ""
    title = f"what building buys: {trace_time.what} ({trace_time.run}) against building{fewer}"
    chart = _chart(traces, title, height=340 + _LEGEND_LINE * len(specs))
    chart["layout"] |= {"showlegend": True, "legend": {"orientation": "h", "y": 1.02, "yanchor": "bottom"}}
    chart["layout"]["xaxis"] |= {"type": "log", "title": {"text": "building, s"}}
    chart["layout"]["yaxis"] |= {"rangemode": "tozero", "title": {"text": f"{trace_time.what}, {trace_time.unit}"}}
    return chart


def _symbols(specs: Sequence[str]) -> list[str]:
    """Those of one kind, and so of one colour, have different ones."""
    kinds = [spec.partition(":")[0] for spec in specs]
    return [_SYMBOLS[kinds[:place].count(kind) % len(_SYMBOLS)] for place, kind in enumerate(kinds)]


def levels_chart(spec: str, levels: Sequence[Record]) -> Chart:
    """Nodes per depth: axis-aligned, oblique, leaves."""
    depths = list(range(len(levels)))
    kinds: Mapping[str, tuple[str, str]] = {
        "axis_nodes": ("axis-aligned nodes", "#56B4E9"),
        "oblique_nodes": ("oblique nodes", "#D55E00"),
        "leaves": ("leaves", "#009E73"),
    }
    traces = [
        {
            "type": "bar",
            "x": depths,
            "y": [level[key] for level in levels],
            "name": name,
            "marker": {"color": colour},
            "hovertemplate": f"depth %{{x}}: %{{y:,}} {name}<extra></extra>",
        }
        for key, (name, colour) in kinds.items()
    ]
    chart = _chart(traces, f"{spec}: nodes at each depth", height=280)
    chart["layout"] |= {"barmode": "stack", "showlegend": True, "legend": {"orientation": "h", "y": -0.25}}
    return chart


def _speeds(measure: Measure, spec: str) -> str:
    found = {name: measure.speed(spec, name) for name in BASELINES}
    return "<br>".join(f"{speed:.2f} times as fast as {name}" for name, speed in found.items() if speed)


def _chart(traces: list[Chart], title: str, height: int) -> Chart:
    layout = {
        "height": height,
        "margin": {"l": 10, "r": 10, "t": 10, "b": 40},
        "showlegend": False,
        "xaxis": {"automargin": True},
        "yaxis": {"automargin": True},
        "paper_bgcolor": "rgba(0,0,0,0)",
        "plot_bgcolor": "rgba(0,0,0,0)",
    }
    return {"data": traces, "layout": layout, "title": title}
