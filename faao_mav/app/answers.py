"""What the page shows of a plan, computed in another process: a rough answer and the finished one.

Everything here takes and returns what can be sent between processes.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from faao_mav.app.charts import charts, thinned
from faao_mav.arrays import Real
from faao_mav.errors import FaaoError, PlanError
from faao_mav.geodesy import LocalFrame
from faao_mav.mission.command import Command
from faao_mav.mission.fence_area import Area
from faao_mav.optimizer.rough import RoughFlight, rough_flight
from faao_mav.optimizer.solution import Solution
from faao_mav.plan import Plan, parse_plan
from faao_mav.plan.zones import PolygonZone
from faao_mav.report import write_part
from faao_mav.report.style import SPEEDS
from faao_mav.vector import lengths
from faao_mav.workflow import Result, plan_mission

_WAYPOINTS = (Command.NAV_WAYPOINT, Command.NAV_SPLINE_WAYPOINT)
"""The commands of a relay route, whose items are numbered on the map."""

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
    the map in [latitude, longitude], and times, s, and speeds, m/s, at its places, with
    the colours of speeds from 0 to `top`; `charts` are
    options of ECharts. `result` is there in the finished answer only.
    """

    refused: str = ""
    failed: str = ""
    delivered: float = 0.0
    megabytes: float | None = None
    drawing: dict[str, Any] = field(default_factory=dict)
    charts: dict[str, Any] = field(default_factory=dict)
    velocities: Real | None = None
    result: Result | None = None


def rough(text: str, source: str, near: Real | None) -> Answer:
    """Return the rough answer to the plan `text`, from a flight `near` it where there is one."""
    return _answered(text, source, partial(rough_flight, near=near))


def finished(text: str, source: str) -> Answer:
    """Return the answer of the command line to the plan `text`."""
    return _answered(text, source, plan_mission)


def _answered(text: str, source: str, solve: Callable[[Plan], RoughFlight | Result]) -> Answer:
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


def _drawing(flight: RoughFlight | Solution, result: Result | None) -> dict[str, Any]:
    plan = flight.plan
    frame = LocalFrame(plan.origin.latitude, plan.origin.longitude)

    def degrees(places: Real) -> list[list[float]]:
        pairs: list[list[float]] = np.stack(frame.to_geodetic(places), axis=1).round(8).tolist()
        return pairs

    speeds = lengths(flight.v)
    drawn = {
        "places": degrees(thinned(flight.w)),
        "times": thinned(flight.t).round(3).tolist(),
        "speeds": thinned(speeds).round(3).tolist(),
        "top": max(float(speeds.max()), 0.01),
        "shades": SPEEDS,
        "track": [],
        "waypoints": [],
        "margin": [],
        "zones": [],
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
        drawn["waypoints"] = [
            [number, [item.x, item.y]]
            for number, item in enumerate(result.conversion.mission.items, 1)
            if item.command in _WAYPOINTS and (item.x or item.y)
        ]
    return drawn


def _zones_of_file(plan: Plan) -> list[Area]:
    """Return the zones of the fence that are of its file: of each shape they come last."""
    assert plan.fence is not None
    own = (*plan.fence.inclusion, *plan.fence.exclusion)
    drawn = sum(isinstance(zone, PolygonZone) for zone in own)
    polygons = len(plan.geofence.polygons)
    return [*plan.zones[drawn:polygons], *plan.zones[polygons + len(own) - drawn :]]


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
