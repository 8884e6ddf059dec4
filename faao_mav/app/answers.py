"""What the page shows of a plan, computed in another process: a rough answer and the finished one.

Everything here takes and returns what can be sent between processes.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from faao_mav.arrays import Real
from faao_mav.errors import FaaoError, PlanError
from faao_mav.mission.fence_area import Area
from faao_mav.optimizer.shadowing import Shadowed
from faao_mav.optimizer.solution import Solution
from faao_mav.plan import Plan, parse_plan
from faao_mav.plan.sections import PolygonZone
from faao_mav.report.figures import of_a_slot
from faao_mav.report.maps import WAYPOINTS, placed_items, thinned
from faao_mav.report.page import write_part
from faao_mav.report.style import SPEEDS
from faao_mav.validate.demands import energy_use
from faao_mav.vector import lengths
from faao_mav.workflow import Result

FILES = {
    "mission.waypoints": ("Mission, QGC WPL 110 (.waypoints)", ""),
    "mission.plan": ("Mission, QGroundControl (.plan)", ""),
    "mission.kml": ("Mission to look at (.kml)", ""),
    ".param": ("Parameters", ""),
    ".fence": ("Fence", ""),
    "report.html": ("Report page (.html)", "report"),
    "precoders.csv": ("Precoders (.csv)", "precoders"),
    "result.npz": ("Result (.npz)", "save"),
}
"""What can be had of a finished answer: by its name, or for what lies beside a mission what is in
its name, what it is called, and which part of `write_part` it is."""


@dataclass(frozen=True, slots=True)
class Answer:
    """What a plan leads to, or why it leads to nothing.

    `refused` is the error of a plan that cannot be used, `failed` that of one without a flight.
    `delivered` is in bit/s/Hz, `megabytes` None without a bandwidth. `drawing` has the lines of
    the map in [latitude, longitude], and times, s, and speeds, m/s, at its places, with the colours
    of speeds from 0 to `top`; `charts` are options of ECharts. `result` is there in the finished
    answer only.
    """

    refused: str = ""
    failed: str = ""
    delivered: float = 0.0
    megabytes: float | None = None
    drawing: dict[str, Any] = field(default_factory=dict)
    charts: list[dict[str, Any]] = field(default_factory=list)
    velocities: Real | None = None
    result: Result | None = None


def answer(text: str, source: str, solve: Callable[[Plan], Solution | Result]) -> Answer:
    """Return what `solve` finds for the plan `text`, or why it finds nothing."""
    try:
        found = solve(parse_plan(text, source))
    except PlanError as error:
        return Answer(refused=str(error))
    except FaaoError as error:
        return Answer(failed=str(error))
    result = found if isinstance(found, Result) else None
    flight = found.solution if isinstance(found, Result) else found
    return Answer(
        delivered=flight.delivered_rate,
        megabytes=flight.plan.megabytes(flight.delivered_rate),
        drawing=_drawing(flight, result),
        charts=charts(flight, result.shadowed if result else None),
        velocities=flight.v,
        result=result,
    )


def _drawing(flight: Solution, result: Result | None) -> dict[str, Any]:
    plan = flight.plan
    frame = plan.origin.frame

    def degrees(places: Real) -> list[list[float]]:
        pairs: list[list[float]] = np.stack(frame.to_geodetic(places), axis=1).round(8).tolist()
        return pairs

    speeds = lengths(flight.v)
    drawn: dict[str, Any] = {
        "places": degrees(thinned(flight.w)),
        "times": thinned(flight.t).round(3).tolist(),
        "speeds": thinned(speeds).round(3).tolist(),
        "top": max(float(speeds.max()), 0.01),
        "shades": SPEEDS,
        **{name: [] for name in ("track", "waypoints", "margin", "zones")},
        "moving": [
            [kind, degrees(thinned(station.at(flight.t)))]
            for kind, station in zip(("base", "user"), plan.radio.stations, strict=True)
            if station.moves
        ],
    }
    if plan.fence is not None and (area := plan.keep_in) is not None:
        drawn["margin"] = [degrees(edge) for edge in area.inside(plan.fence.margin).edges()]
        drawn["zones"] = [
            [zone.inclusion, degrees(edge)]
            for zone in _zones_of_file(plan)
            for edge in zone.rings()
        ]
    if result is not None and result.conversion is not None:
        drawn["track"] = degrees(thinned(result.conversion.schedule.track()["predicted_w"]))
        drawn["waypoints"] = placed_items(result.conversion.mission, WAYPOINTS)
    return drawn


def _zones_of_file(plan: Plan) -> list[Area]:
    """Return the zones of the fence that are of its file: of each shape they come last."""
    assert plan.fence is not None
    own = (*plan.fence.inclusion, *plan.fence.exclusion)
    drawn = sum(isinstance(zone, PolygonZone) for zone in own)
    polygons = len(plan.geofence.polygons)
    return [*plan.zones[drawn:polygons], *plan.zones[polygons + len(own) - drawn :]]


def charts(flight: Solution, under: Shadowed | None = None) -> list[dict[str, Any]]:
    """Return the charts of `flight` over time, s, with what arrives `under` shadowing."""
    plan, relayed = flight.plan, flight.relayed
    held, unit = of_a_slot(plan)
    arrived = {"delivered": held * np.cumsum(relayed.forwarded)}
    if under is not None and plan.radio.causal:
        parts = {"more in 9 of 10": 0.1, "more in 1 of 10": 0.9}
        arrived |= {name: held * under.arrived[part] for name, part in parts.items()}
    plots: list[tuple[str, dict[str, Real]]] = [
        ("bit/s/Hz", {"base station to UAV": flight.I_U, "UAV to user": flight.I_G}),
        (unit, {"queue": held * relayed.queue}),
        (unit, arrived),
        ("m/s", {"speed": lengths(flight.v)}),
    ]
    velocity = np.pad(flight.v, ((0, 0), (0, 1)))
    if (use := energy_use(plan, flight.t, velocity, plan.wind)) is not None:
        plots += [("W", {"power": use.power}), ("Wh", {"energy": use.used})]
    return [_chart(flight.t, *each) for each in plots]


def _chart(t: Real, unit: str, curves: dict[str, Real]) -> dict[str, Any]:
    points = {name: thinned(np.stack([t, curve], axis=1)) for name, curve in curves.items()}
    return {
        "animation": False,
        "tooltip": {},
        "legend": {"top": 0, "right": 10},
        "grid": {},
        "xAxis": {"type": "value", "max": "dataMax"},
        "yAxis": {"type": "value", "name": unit, "min": 0},
        "series": [
            {"type": "line", "name": name, "data": curve.round(4).tolist()}
            for name, curve in points.items()
        ],
    }


def made(result: Result, wanted: str) -> tuple[str, bytes]:
    """Return name and content of one of `FILES`: what the command line writes.

    Raises `FaaoError` where there is no such file: no mission, no fence, precoders without table.
    """
    _, part = FILES[wanted]
    with TemporaryDirectory() as folder:
        path = Path(folder) / ("mission.waypoints" if wanted.startswith(".") else wanted)
        if part:
            write_part(result, part, path)
        written = (path,) if part else result.write(path)
        for each in written:
            if wanted in each.name:
                return each.name, each.read_bytes()
    raise PlanError(f"the mission has no {wanted.removeprefix('.')} file")
