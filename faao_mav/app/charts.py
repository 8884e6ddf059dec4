"""The charts of a flight over time, as options for ECharts."""

from typing import Any

import numpy as np

from faao_mav.arrays import Real
from faao_mav.optimizer.rough import RoughFlight
from faao_mav.optimizer.shadowing import Shadowed
from faao_mav.optimizer.solution import Solution
from faao_mav.validate.demands import energy_use
from faao_mav.vector import lengths

_HEIGHT, _ABOVE, _WIDE = 70, 50, 560
"""Height of a plot and of what is above it, and from where on two are side by side, in pixels.
Chosen."""

_GREY = "#888"
_COLOURS = ("#3b7ddd", "#d9731a", "#2a9d5c", "#8a5cd0", "#c23b6a", "#c9a227", "#4a9aa8")
"""Of each curve, in the order of the plots, over and over."""

_MOST_DRAWN = 400
"""Points of a line on the map and of a chart; chosen: more cannot be told apart."""


def thinned(values: Real) -> Real:
    """Return at most `_MOST_DRAWN` of `values` (n, ...), the first and the last among them."""
    kept = np.linspace(0, len(values) - 1, min(len(values), _MOST_DRAWN)).round().astype(int)
    return np.asarray(values[kept])


def charts(flight: RoughFlight | Solution, under: Shadowed | None = None) -> dict[str, Any]:
    """Return the charts of `flight` over time, s, with what arrives `under` shadowing."""
    plots = _plots(flight, under)
    axis = {"type": "value", "splitNumber": 3, "axisLabel": {"color": _GREY},
            "splitLine": {"lineStyle": {"color": _GREY, "opacity": 0.2}}}  # fmt: skip
    xs: list[dict[str, Any]] = []
    ys: list[dict[str, Any]] = []
    curves: list[dict[str, Any]] = []
    for k, (values, unit) in enumerate(plots):
        colours = (2 * _COLOURS)[len(curves) :]
        title = ", ".join(f"{{c{n}|━}} {name}" for n, name in enumerate(values))
        marks = {f"c{n}": {"color": colours[n], "fontWeight": "bold"} for n in range(len(values))}
        xs.append({**axis, "gridIndex": k, "max": "dataMax"})
        ys.append({**axis, "gridIndex": k, "min": 0, "nameGap": 10, "name": f"{title}, {unit}",
                   "nameTextStyle": {"align": "left", "color": _GREY, "rich": marks}})  # fmt: skip
        for name, curve in values.items():
            points = thinned(np.stack([flight.t, curve], axis=1)).round(4).tolist()
            curves.append({"type": "line", "name": name, "xAxisIndex": k, "yAxisIndex": k,
                           "showSymbol": False, "data": points})  # fmt: skip
    return {
        "baseOption": {
            "animation": False,
            "color": _COLOURS,
            "tooltip": {"trigger": "axis", "confine": True},
            "axisPointer": {"link": [{"xAxisIndex": "all"}]},
            "xAxis": xs,
            "yAxis": ys,
            "series": curves,
        },
        "media": [
            {"query": {"maxWidth": _WIDE}, "option": {"grid": _grids(len(plots), 1)}},
            {"option": {"grid": _grids(len(plots), 2)}},
        ],
    }


def heights(charts: dict[str, Any]) -> str:
    """Return the height of all `charts` as CSS: in one column, and in two."""
    plots, row = len(charts["baseOption"]["xAxis"]), _HEIGHT + _ABOVE
    return f"--narrow: {plots * row}px; --wide: {-(-plots // 2) * row}px"


def _plots(
    flight: RoughFlight | Solution, under: Shadowed | None
) -> list[tuple[dict[str, Real], str]]:
    """Return the curves of each plot by name, and their unit."""
    plan, relayed = flight.plan, flight.relayed
    bandwidth, held, unit = plan.radio.bandwidth_mhz, plan.flight.time_step, "bit/Hz"
    if bandwidth is not None:
        held, unit = held * bandwidth / 8, "MB"
    arrived = {"delivered": held * np.cumsum(relayed.forwarded)}
    if under is not None and plan.radio.causal:
        parts = {"more in 9 of 10": 0.1, "more in 1 of 10": 0.9}
        arrived |= {name: held * under.arrived[part] for name, part in parts.items()}
    plots = [
        ({"base station to UAV": flight.I_U, "UAV to user": flight.I_G}, "bit/s/Hz"),
        ({"queue": held * relayed.queue}, unit),
        (arrived, unit),
        ({"speed": lengths(flight.v)}, "m/s"),
    ]
    velocity = np.pad(flight.v, ((0, 0), (0, 1)))
    if (use := energy_use(plan, flight.t, velocity, plan.wind)) is not None:
        plots += [({"power": use.power}, "W"), ({"energy": use.used}, "Wh")]
    return plots


def _grids(count: int, columns: int) -> list[dict[str, object]]:
    share = 100 // columns
    return [
        {"left": f"{k % columns * share + 6}%", "width": f"{share - 9}%", "height": _HEIGHT,
         "top": k // columns * (_HEIGHT + _ABOVE) + _ABOVE - 22}
        for k in range(count)
    ]  # fmt: skip
