"""What the page shows of a plan, computed in another process: a rough answer and the finished one.

Everything here takes and returns what can be sent between processes.
"""

from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np

from faao_mav.arrays import Real
from faao_mav.errors import FaaoError, PlanError
from faao_mav.geodesy import LocalFrame
from faao_mav.optimizer.rough import RoughFlight, rough_flight
from faao_mav.optimizer.solution import Solution
from faao_mav.plan import Plan, parse_plan
from faao_mav.vector import lengths
from faao_mav.workflow import Result, plan_mission

_MOST_DRAWN = 400
"""Points of a line on the map and of a chart; chosen: more cannot be told apart."""

FILES = {
    "mission.waypoints": "Mission, QGC WPL 110 (.waypoints)",
    "mission.plan": "Mission, QGroundControl (.plan)",
    "mission.kml": "Mission to look at (.kml)",
    "parameters": "Parameters",
    "fence": "Fence",
    "report.html": "Report page (.html)",
    "precoders.csv": "Precoders (.csv)",
    "result.npz": "Result (.npz)",
}
"""What can be had of a finished answer, by its name or its part."""


@dataclass(frozen=True, slots=True)
class Answer:
    """What a plan leads to, or why it leads to nothing.

    `refused` is the error of a plan that cannot be used, `failed` that of one without a flight.
    `drawing` has the lines of the map in [latitude, longitude], `series` the charts' values by
    name over `t`, s. `result` is there in the finished answer only.
    """

    refused: str = ""
    failed: str = ""
    delivered: float = 0.0
    megabytes: float | None = None
    drawing: dict[str, Any] = field(default_factory=dict)
    series: dict[str, list[float]] = field(default_factory=dict)
    velocities: Real | None = None
    result: Result | None = None


def rough(text: str, source: str, near: Real | None) -> Answer:
    """Return the rough answer to the plan `text`, from a flight `near` it where there is one."""
    return _answered(text, source, partial(rough_flight, near=near))


def finished(text: str, source: str) -> Answer:
    """Return the answer of the command line to the plan `text`."""
    return _answered(text, source, plan_mission)


def warmed() -> None:
    """Load what the first answer needs, so that it is quick."""
    LocalFrame(0.0, 0.0).to_geodetic((0.0, 0.0))


def _answered(text: str, source: str, solve: Any) -> Answer:
    try:
        plan = parse_plan(text, source)
    except PlanError as error:
        return Answer(refused=str(error))
    try:
        found: RoughFlight | Result = solve(plan)
    except PlanError as error:
        return Answer(refused=str(error))
    except FaaoError as error:
        return Answer(failed=str(error))
    result = found if isinstance(found, Result) else None
    flight = found.solution if isinstance(found, Result) else found
    return Answer(
        delivered=flight.delivered_rate,
        megabytes=plan.megabytes(flight.delivered_rate),
        drawing=_drawing(flight, result),
        series=_series(flight),
        velocities=flight.v,
        result=result,
    )


def _series(flight: RoughFlight | Solution) -> dict[str, list[float]]:
    """Return the charts' values: bit/s/Hz, m/s; bit/Hz, or megabytes where there is a bandwidth."""
    plan, relayed = flight.plan, flight.relayed
    bandwidth, step = plan.radio.bandwidth_mhz, plan.flight.time_step
    held = step * (1.0 if bandwidth is None else bandwidth / 8)
    every = _thinned(len(flight.t))
    values = {
        "t": flight.t,
        "base station to UAV": flight.I_U,
        "UAV to user": flight.I_G,
        "queue": held * relayed.queue,
        "delivered": held * np.cumsum(relayed.forwarded),
        "speed": lengths(flight.v),
        "east": flight.w[:, 0],
        "north": flight.w[:, 1],
    }
    return {name: np.asarray(each)[every].round(4).tolist() for name, each in values.items()}


def _drawing(flight: RoughFlight | Solution, result: Result | None) -> dict[str, Any]:
    plan = flight.plan
    frame = LocalFrame(plan.origin.latitude, plan.origin.longitude)
    every = _thinned(len(flight.t))
    track, waypoints = np.empty((0, 2)), []
    if result is not None and result.conversion is not None:
        schedule, mission = result.conversion.schedule, result.conversion.mission
        track = schedule.track()["predicted_w"]
        waypoints = [
            [number, [item.x, item.y]]
            for number, item in enumerate(mission.items, 1)
            if item.command in (16, 82) and (item.x or item.y)
        ]
    margin, from_file = _fence(plan)
    return {
        "places": _degrees(frame, flight.w[every]),
        "speeds": lengths(flight.v)[every].round(3).tolist(),
        "top": max(float(lengths(flight.v).max()), 0.01),
        "track": _degrees(frame, track[_thinned(len(track))]),
        "waypoints": waypoints,
        "margin": [_degrees(frame, ring) for ring in margin],
        "fixed": [_degrees(frame, ring) for ring in from_file],
    }


def _fence(plan: Plan) -> tuple[list[Real], list[Real]]:
    """Return the edge that the plan keeps from the fence, and the outlines from `fence.file`."""
    area, fence = plan.keep_in, plan.fence
    if area is None or fence is None:
        return [], []
    import shapely

    def rings(shape: Any, outer: bool = True) -> list[Real]:
        every = (shapely.get_rings(part)[0 if outer else 1 :] for part in shapely.get_parts(shape))
        return [shapely.get_coordinates(ring) for part in every for ring in part]

    bounded = any(zone.inclusion for zone in plan.zones)
    from_file = plan.zones if fence.file is not None else ()
    return (
        rings(area.inside(fence.margin).shape, bounded),
        [ring for zone in from_file for ring in rings(zone.shape)],
    )


def _thinned(length: int) -> Real:
    return np.unique(np.linspace(0, length - 1, min(length, _MOST_DRAWN)).round().astype(int))


def _degrees(frame: LocalFrame, places: Real) -> list[list[float]]:
    if not len(places):
        return []
    return np.stack(frame.to_geodetic(places), axis=1).round(8).tolist()  # type: ignore[no-any-return]


def made(result: Result, wanted: str) -> tuple[str, bytes]:
    """Return name and content of one of `FILES`: what the command line writes.

    Raises `FaaoError` where there is no such file: no mission, no fence, precoders without table.
    """
    with TemporaryDirectory() as folder:
        path = Path(folder) / (wanted if "." in wanted else "mission.waypoints")
        if wanted == "report.html":
            from faao_mav.report import render_report

            return wanted, render_report(result).encode()
        if wanted == "precoders.csv":
            from faao_mav.schedule.precoder_table import precoder_table

            return wanted, precoder_table(result.solution).encode()
        if wanted == "result.npz":
            from faao_mav.optimizer.solution import save_solution

            track = result.conversion.schedule.track() if result.conversion else None
            save_solution(result.solution, path, track)
            return wanted, path.read_bytes()
        mission, *beside = result.write(path)
        if "." not in wanted:
            is_fence = wanted == "fence"
            found = [each for each in beside if (".param" not in each.name) == is_fence]
            if not found:
                raise PlanError(f"the mission has no {wanted} file")
            mission = found[0]
        return mission.name, mission.read_bytes()
