"""The charts of a flight over time, as options for ECharts."""

from typing import Any

_PLOTS = (
    (("base station to UAV", "UAV to user"), "rate, bit/s/Hz"),
    (("queue",), "queue, {unit}"),
    (("delivered",), "delivered, {unit}"),
    (("speed",), "speed, m/s"),
)
"""The curves of each plot from the top, and its title."""

_HEIGHT, _GAP, _TOP = 105, 42, 46
"""Height of a plot and of what is between two, and the legend's, in pixels. Chosen."""

HEIGHT = _TOP + len(_PLOTS) * (_HEIGHT + _GAP)
"""The height of all charts, pixels."""

_COLOURS = ("#3b7ddd", "#d9731a", "#2a9d5c", "#8a5cd0", "#c23b6a")


def options(series: dict[str, list[float]], unit: str) -> dict[str, Any]:
    """Return the charts of `series` over its `t`, s; amounts of data are in `unit`."""
    t, faint = series.get("t", []), {"lineStyle": {"opacity": 0.25}}
    grids, xs, ys, curves = [], [], [], []
    for k, (names, title) in enumerate(_PLOTS):
        grids.append(
            {"left": 52, "right": 16, "top": _TOP + k * (_HEIGHT + _GAP), "height": _HEIGHT}
        )
        last = k + 1 == len(_PLOTS)
        xs.append({"type": "value", "gridIndex": k, "max": "dataMax", "name": "s" if last else "",
                   "splitLine": faint, "axisLabel": {"show": last, "color": "#888"}})  # fmt: skip
        ys.append({"type": "value", "gridIndex": k, "name": title.format(unit=unit),
                   "nameTextStyle": {"align": "left", "color": "#888"}, "splitNumber": 3,
                   "axisLabel": {"color": "#888"}, "splitLine": faint,
                   "min": 0})  # fmt: skip
        for name in names:
            curve = [list(pair) for pair in zip(t, series.get(name, []), strict=False)]
            curves.append({"type": "line", "name": name, "xAxisIndex": k, "yAxisIndex": k,
                           "showSymbol": False, "data": curve})  # fmt: skip
    return {
        "animation": False,
        "color": _COLOURS,
        "legend": {"data": list(_PLOTS[0][0]), "top": 0, "textStyle": {"color": "#888"}},
        "tooltip": {"trigger": "axis", "confine": True},
        "axisPointer": {"link": [{"xAxisIndex": "all"}]},
        "grid": grids,
        "xAxis": xs,
        "yAxis": ys,
        "series": curves,
    }
