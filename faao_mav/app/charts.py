"""The charts of a flight over time, as options for ECharts."""

from typing import Any

_PLOTS = (
    (("base station to UAV", "UAV to user"), "bit/s/Hz"),
    (("queue",), "{unit}"),
    (("delivered",), "{unit}"),
    (("speed",), "m/s"),
    (("power",), "W"),
    (("energy",), "Wh"),
)
"""The curves of each plot, with their unit; those without values are left out."""

_HEIGHT, _ABOVE, _WIDE = 70, 50, 560
"""Height of a plot and of what is above it, and from where on two are side by side, in pixels.
Chosen."""

_GREY = "#888"
_COLOURS = ("#3b7ddd", "#d9731a", "#2a9d5c", "#8a5cd0", "#c23b6a", "#c9a227", "#4a9aa8")
"""Of each curve, in the order of `_PLOTS`."""


def options(series: dict[str, list[float]], unit: str) -> dict[str, Any]:
    """Return the charts of `series` over its `t`, s; amounts of data are in `unit`."""
    plots = [plot for plot in _PLOTS if plot[0][0] in series]
    axis = {"type": "value", "splitNumber": 3, "axisLabel": {"color": _GREY},
            "splitLine": {"lineStyle": {"color": _GREY, "opacity": 0.2}}}  # fmt: skip
    xs: list[dict[str, Any]] = []
    ys: list[dict[str, Any]] = []
    curves: list[dict[str, Any]] = []
    for k, (names, of) in enumerate(plots):
        colours = _COLOURS[len(curves) :]
        title = ", ".join(f"{{c{n}|━}} {name}" for n, name in enumerate(names))
        marks = {f"c{n}": {"color": colours[n], "fontWeight": "bold"} for n in range(len(names))}
        xs.append({**axis, "gridIndex": k, "max": "dataMax"})
        ys.append({**axis, "gridIndex": k, "min": 0, "nameGap": 10,
                   "name": f"{title}, {of.format(unit=unit)}",
                   "nameTextStyle": {"align": "left", "color": _GREY, "rich": marks}})  # fmt: skip
        for name in names:
            curve = [list(pair) for pair in zip(series["t"], series[name], strict=True)]
            curves.append({"type": "line", "name": name, "xAxisIndex": k, "yAxisIndex": k,
                           "showSymbol": False, "data": curve})  # fmt: skip
    grids = {columns: _grids(len(plots), columns) for columns in (1, 2)}
    return {
        "baseOption": {
            "animation": False,
            "color": _COLOURS,
            "tooltip": {"trigger": "axis", "confine": True},
            "axisPointer": {"link": [{"xAxisIndex": "all"}]},
            "grid": grids[2],
            "xAxis": xs,
            "yAxis": ys,
            "series": curves,
        },
        "media": [
            {"query": {"maxWidth": _WIDE}, "option": {"grid": grids[1]}},
            {"option": {"grid": grids[2]}},
        ],
    }


def heights(series: dict[str, list[float]]) -> str:
    """Return the height of all charts of `series` as CSS: in one column, and in two."""
    plots = sum(names[0] in series for names, _ in _PLOTS)
    row = _HEIGHT + _ABOVE
    return f"--narrow: {plots * row}px; --wide: {-(-plots // 2) * row}px"


def _grids(count: int, columns: int) -> list[dict[str, object]]:
    share = 100 // columns
    return [
        {"left": f"{k % columns * share + 6}%", "width": f"{share - 9}%", "height": _HEIGHT,
         "top": k // columns * (_HEIGHT + _ABOVE) + _ABOVE - 22}
        for k in range(count)
    ]  # fmt: skip
