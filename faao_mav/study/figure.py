"""What a study shows: rates or data along what is varied, or routes on a map."""

import itertools
import json
import re
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from faao_mav.errors import InputError, quote
from faao_mav.plan import Plan
from faao_mav.plan.keys import POWER
from faao_mav.report.style import MARKERS, SERIES, drawing, label, mark_stations
from faao_mav.study.rows import StudyRow, averaged, unit_of_data
from faao_mav.study.sweep import ENERGY, Value

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

_KEYS = {
    POWER: ("power W of both stations, dBm", "W", " dBm"),
    "flight.duration": ("duration T, s", "T", " s"),
    ENERGY: ("energy, Wh", "E", " Wh"),
    "flight.altitude": ("height H, m", "H", " m"),
    "radio.rician_factor": ("Rician factor K", "K", ""),
    "radio.modulation": ("", "", ""),
    "radio.duplex": ("", "", " duplex"),
}
"""The label of the axis along which a key is varied, its symbol and its unit in legends; other keys
are their own labels, and an empty symbol leaves the value alone."""

_CAUSAL = "radio.causal"
"""The key whose values are lines of one plot: what causality costs, and what planning wins back."""

_OF_CAUSALITY = (
    ("R_avg, planned for it", False, "R_avg"),
    ("delivered, planned for it", True, "delivered"),
    ("delivered, planned for R_avg", False, "delivered"),
)
"""Name of each of these lines, the value of the key, and the field of a row that is drawn."""

_DRAWN = {
    "rate": ("R_avg", "rate R_avg, bit/s/Hz"),
    "delivered": ("delivered", "delivered rate R_del, bit/s/Hz"),
    "data": ("data", "delivered, {}"),
}
"""What of a row a kind of figure draws, and the label of its axis, with the unit of data."""

_SCHEMES = {
    "faao": "FAAO",
    "gaussian": "designed for Gaussian inputs",
    "mrt": "MRT",
    "mmse": "MMSE",
    "zf": "ZF",
    "algorithm1": "FAAO, Algorithm 1",
    "waterfilling": "water-filling",
}
"""The names of the schemes in legends, in the order of their looks in `SERIES` and `MARKERS`."""


def study_figure(rows: Sequence[StudyRow], plan: Plan, kind: str) -> "Figure":
    """Return the figure `kind` of `rows`: `delivered`, `rate` (R_avg), `data` or `trajectories`.

    Raises `InputError` where there is nothing to draw: no result, or for rates no axis of numbers.

    >>> from faao_mav import make_cases, read_plan, run_study
    >>> plan = read_plan("missions/copter_relay.yaml").changed({"radio.fading": "none"})
    >>> rows = run_study(make_cases(plan.text, vary={"flight.altitude": [60, 120]}), jobs=1)
    >>> study_figure(rows, plan, "delivered").axes[0].get_xlabel()
    'height H, m'
    """
    if kind not in (*_DRAWN, "trajectories"):
        raise InputError(f"figure {quote(kind)}: give delivered, rate, data or trajectories")
    counts = {"": 1}  # of the numbers of each key
    for key in rows[0].values if rows else ():
        values = [row.values[key] for row in rows]
        if all(isinstance(v, int | float) and not isinstance(v, bool) for v in values):
            counts[key] = len(set(values))
    axis = max(counts, key=lambda key: counts[key])
    if all(row.R_avg is None for row in rows) or not (axis or kind == "trajectories"):
        raise InputError("nothing to draw: no result, or no key varied over two numbers or more")
    return _routes(rows, plan) if kind == "trajectories" else _rates(rows, plan, kind, axis)


def _rates(rows: Sequence[StudyRow], plan: Plan, kind: str, axis: str) -> "Figure":
    """Draw what came out over the axis: a line a scheme, a panel for each of the other values."""
    panels: dict[str, list[StudyRow]] = {}
    for row in rows:
        others = {key: row.values[key] for key in row.values if key not in (axis, _CAUSAL)}
        panels.setdefault(_named(others), []).append(row)
    across = min(len(panels), 3)
    down = -(-len(panels) // across)
    width, height = (5.4, 3.4) if across == 1 else (3.3 * across, 2.9)
    measure, unit = _DRAWN[kind]
    unit = "rate, bit/s/Hz" if _CAUSAL in rows[0].values else unit.format(unit_of_data(rows))
    with drawing(width, 0.5 + height * down) as figure:
        plots = figure.subplots(down, across, squeeze=False, sharex=True).ravel().tolist()
        for plot, (name, inside) in zip(plots, panels.items(), strict=False):
            _lines(plot, inside, axis, measure)
            label(plot, name or plan.name or "study", _KEYS.get(axis, (axis,))[0], unit)
            plot.tick_params(labelbottom=True)  # the plot beneath may be none
        for plot in plots[len(panels) :]:
            plot.remove()
        handles, labels = plots[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside lower center", ncols=min(len(labels), 4))
    return figure


def _lines(plot: "Axes", rows: Sequence[StudyRow], axis: str, measure: str) -> None:
    """Draw a line, with its spread over seeds, for each scheme, or for what causality costs."""
    schemes = dict.fromkeys(row.scheme for row in rows)
    kinds = _OF_CAUSALITY if _CAUSAL in rows[0].values else [("", None, measure)]
    for scheme, (of, (name, causal, field)) in itertools.product(schemes, enumerate(kinds)):
        found: dict[float, list[float]] = {}
        for row in rows:
            rate = getattr(row, field)
            if row.scheme == scheme and row.values.get(_CAUSAL) is causal and rate is not None:
                found.setdefault(float(row.values[axis]), []).append(rate)
        if not found:
            continue
        x = sorted(found)
        mean, deviation = np.array([averaged(found[at]) for at in x]).T
        whose = _SCHEMES[scheme] if len(schemes) > 1 or not name else ""
        k = (list(_SCHEMES).index(scheme) + of) % len(SERIES)
        shown = ": ".join(filter(None, (whose, name)))
        plot.plot(x, mean, marker=MARKERS[k], markersize=4, color=SERIES[k], label=shown)
        plot.fill_between(x, mean - deviation, mean + deviation, color=SERIES[k], alpha=0.2, lw=0)
    plot.set_ylim(bottom=0)


def _routes(rows: Sequence[StudyRow], plan: Plan) -> "Figure":
    """Draw the routes on a map, a colour for each combination of values and scheme.

    Each is thinner than those before it, which can so be seen where they run together.
    """
    with drawing(5.4, 4.9) as figure:
        plot = figure.subplots()
        several = len({row.scheme for row in rows}) > 1
        colours: dict[str, str] = {}
        for row in rows:
            if not row.route:
                continue
            name = _named(row.values)
            if several or not name:
                name = ", ".join(filter(None, (name, _SCHEMES[row.scheme])))
            new = name not in colours
            colour = colours.setdefault(name, SERIES[len(colours) % len(SERIES)])
            width = max(1.2, 4.0 - 1.4 * list(colours).index(name))
            way = np.transpose(row.route)
            plot.plot(*way, color=colour, linewidth=width, label=name if new else None)
        figure.legend(loc="outside lower center", ncols=min(len(colours), 4))
        flight, t = plan.flight, plan.flight.time_step * np.arange(float(plan.flight.slots))
        ways: list[Any] = [each.at(t) for each in plan.radio.stations]
        ways += [[flight.start], [flight.end]]
        places = list(zip(("base station", "user", "start", "end"), ways, "s^oo", strict=True))
        plot.plot(*np.concatenate(ways).T, linestyle="none")
        plot.set_aspect("equal", adjustable="datalim")
        plot.margins(0.1)
        label(plot, plan.name or "routes", "east, m", "north, m")
        mark_stations(plot, places)
    return figure


def _named(values: Mapping[str, Value]) -> str:
    """Return values as a legend has them: `T = 10 s`."""
    parts = []
    for key, value in values.items():
        text = value if isinstance(value, str) else json.dumps(value)
        if key == "radio.modulation":  # as in 16-QAM
            text = re.sub(r"^\d+", r"\g<0>-", text.upper())
        name, unit = _KEYS.get(key, ("", key.rsplit(".", 1)[-1], ""))[1:]
        parts.append(f"{name} = {text}{unit}" if name else text + unit)
    return ", ".join(parts)
