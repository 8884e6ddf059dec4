"""The trade-off of one plan: the most data for every duration, power or energy, with its route."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from faao_mav.arrays import Real
from faao_mav.errors import InputError, quote
from faao_mav.plan import Plan
from faao_mav.plan.checks import fewest_slots
from faao_mav.plan.fields import dbm
from faao_mav.plan.keys import ALIASES, POWER
from faao_mav.plan.reader import changed
from faao_mav.plan.yaml_text import dump_yaml, load_yaml
from faao_mav.power import JOULES_PER_WH
from faao_mav.report.style import drawing, label
from faao_mav.study.figure import as_map
from faao_mav.study.rows import StudyRow
from faao_mav.study.sweep import StudyCase

if TYPE_CHECKING:
    from matplotlib.figure import Figure

POINTS = 12
"""Points of a frontier, unless told otherwise. Chosen: a smooth curve by eye."""

_DECIBELS = 20.0
"""How far below the plan's powers a frontier begins, dB. Chosen: from there on little arrives."""

ENERGY = "goal.energy_wh"

_DECIMALS = 4
"""Decimals of the energies of a frontier, Wh, which are rounded up. Chosen."""

_AXES = {"duration": "flight.duration", "power": POWER, "energy": ENERGY}
"""The key of the plan that each trade-off varies."""

_TOLD = {"flight.duration": "duration, s", POWER: "power, dBm", ENERGY: "energy, Wh"}


def parse_frontier(text: str) -> str:
    """Return the key that `--frontier AXIS,data` varies. Raises `InputError`.

    >>> parse_frontier("power,data")
    'power_dbm'
    """
    axis, _, of = text.partition(",")
    if axis.strip() not in _AXES or of.strip() != "data":
        accepted = " or ".join(f"{name},data" for name in _AXES)
        raise InputError(f"--frontier {quote(text)}: expected {accepted}")
    return _AXES[axis.strip()]


def frontier_cases(plan: Plan, key: str, points: int = POINTS) -> tuple[StudyCase, ...]:
    """Return the cases of the most data at `points` values of `key`, the plan's own the last.

    Durations are whole time steps from the shortest on. Powers rise by the same dB at both
    stations, and the value is that of the base station, dBm. Energies, of flights of any duration
    up to the plan's, rise from the straight flight's to that of the plan without a limit, which is
    optimised for it. Raises `InputError` where the plan cannot be asked for energies.
    """
    data = load_yaml(plan.text, plan.source)
    for section in ("goal", "study"):
        data.pop(section, None)
    cases = []
    along = {"flight.duration": _durations, POWER: _powers, ENERGY: _energies}[key]
    for changes in along(plan, points):
        value = next(iter(changes.values()))
        more = {"goal.maximise": "data"} if key == ENERGY else {}
        text = dump_yaml(changed(data, changes | more))
        scheme = plan.optimizer.precoder
        cases.append(StudyCase(((key, value),), scheme, plan.radio.seed, text, plan.source))
    return tuple(cases)


def _durations(plan: Plan, points: int) -> list[dict[str, float]]:
    slots = np.unique(np.rint(np.linspace(fewest_slots(plan), plan.flight.slots, points)))
    return [{"flight.duration": round(n * plan.flight.time_step, 9)} for n in slots.tolist()]


def _energies(plan: Plan, points: int) -> list[dict[str, float]]:
    from faao_mav.optimizer.direct import direct
    from faao_mav.optimizer.goal import thriftiest_straight
    from faao_mav.optimizer.problem import build_problem

    if plan.vehicle.power is None or not plan.radio.causal:
        missing = "vehicle.power" if plan.vehicle.power is None else "radio.causal: true"
        raise InputError(f"{plan.source}: --frontier energy,data: give {missing} in the plan")
    most = direct(build_problem(plan)).energy_wh
    least = thriftiest_straight(plan)[1] / JOULES_PER_WH
    assert most is not None
    values = np.linspace(min(least, most), most, points).round(_DECIMALS) + 10.0**-_DECIMALS
    return [{ENERGY: value} for value in values.round(_DECIMALS).tolist()]


def _powers(plan: Plan, points: int) -> list[dict[str, float]]:
    given = dict(zip(ALIASES[POWER], map(dbm, plan.powers), strict=True))
    down = np.linspace(-_DECIBELS, 0, points).round(3).tolist()
    return [{key: round(own + less, 6) for key, own in given.items()} for less in down]


def pareto(rows: Sequence[StudyRow], key: str) -> tuple[StudyRow, ...]:
    """Return the rows than which none delivers as much for less, by rising values of `key`."""
    best: list[StudyRow] = []
    delivering = [row for row in rows if row.delivered is not None]
    for row in sorted(delivering, key=lambda row: (float(row.values[key]), -_data(row))):
        if not best or _data(row) > _data(best[-1]):
            best.append(row)
    return tuple(best)


def _data(row: StudyRow) -> float:
    """Return what a row delivers, megabytes, or without a bandwidth bit/Hz per slot."""
    if row.delivered_mbytes is not None:
        return row.delivered_mbytes
    return (row.delivered or 0.0) * len(row.route)


def _amounts(rows: Sequence[StudyRow], plan: Plan) -> tuple[Real, str]:
    """Return what `rows` deliver, and in which unit."""
    amounts = np.array([_data(row) for row in rows])
    if plan.radio.bandwidth_mhz is not None:
        return amounts, "megabytes"
    return amounts * plan.flight.time_step, "bit/Hz"


def frontier_table(rows: Sequence[StudyRow], plan: Plan, key: str) -> str:
    """Return the points of the frontier as lines of the terminal."""
    best = pareto(rows, key)
    amounts, unit = _amounts(best, plan)
    lines = [f"{_TOLD[key]:>12}  {f'delivered, {unit}':>20}  bit/s/Hz"]
    lines += [
        f"{row.values[key]:12g}  {amount:20.4g}  {row.delivered:8.4f}"
        for row, amount in zip(best, amounts.tolist(), strict=True)
    ]
    failed = [row for row in rows if row.error]
    if failed:
        lines.append(f"{len(failed)} of {len(rows)} points failed, first: {failed[0].error}")
    return "\n".join(lines)


def frontier_figure(rows: Sequence[StudyRow], plan: Plan, key: str) -> "Figure":
    """Return the figure of the frontier: the curve, and the route of each of its points."""
    from matplotlib import colormaps

    best = pareto(rows, key)
    amounts, unit = _amounts(best, plan)
    at = np.array([float(row.values[key]) for row in best])
    colours = colormaps["viridis"](np.linspace(0, 0.9, len(best)))
    with drawing(9.6, 4.4) as figure:
        curve, routes = figure.subplots(1, 2)
        curve.plot(at, amounts, color="0.6", linewidth=1.2)
        curve.scatter(at, amounts, color=colours, zorder=3)
        curve.set_ylim(bottom=0)
        label(curve, plan.name or "trade-off", _TOLD[key], f"delivered, {unit}")
        for row, colour in zip(best, colours, strict=True):
            routes.plot(*row.route.T, color=colour, linewidth=1.4)
        as_map(routes, plan, "routes, in the colours of the curve")
    return figure
