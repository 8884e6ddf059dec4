"""What became of a plan in a flight, watched or from a log, in lines for people."""

import math
from collections.abc import Iterator, Sequence

from faao_mav.errors import FaaoError
from faao_mav.fly.fly import FlightReport
from faao_mav.fly.record import FlightRecord, predicted_line
from faao_mav.report.flights import debriefing_lines
from faao_mav.report.lines import Line
from faao_mav.validate.flown import Debriefing
from faao_mav.workflow import Result

_SAME = 1e-5
"""Relative difference of two parameters that single precision does not tell apart."""


def flight_lines(report: FlightReport, found: Debriefing | None) -> Iterator[Line]:
    """Yield the lines of a flight that was watched: differences, what was `found`, its ending."""
    yield from (("different", str(each)) for each in report.differences)
    if found is not None:
        yield from debriefing_lines(found)
    if report.ending is not None:
        yield report.ending.kind, report.ending.text


def debriefed(
    records: Sequence[FlightRecord], result: Result, source: str
) -> tuple[FlightRecord, Debriefing]:
    """Return the flight in the log `source` that is the plan's of `result`, and what became of it.

    Of several `records` it is the nearest to the plan. Raises `FaaoError` where none is.
    """
    track = None if result.check is None else result.check.track
    line = predicted_line(result.solution, track)
    debriefings = ((record, record.debriefing(result.solution, line)) for record in records)
    found = [(record, each) for record, each in debriefings if each is not None]
    if not found:
        longest = max(record.t[-1] - record.t[0] for record in records)
        raise FaaoError(
            f"{source}: the plan's flight is not in it: no departure from flight.start like the "
            f"predicted one in {longest:.0f} s of flight"
        )
    return min(found, key=lambda pair: pair[1].flown.rms_position_error)


def remarks_on(
    records: Sequence[FlightRecord], record: FlightRecord, found: Debriefing, result: Result
) -> Iterator[Line]:
    """Yield what the log says of vehicles, wind and parameters."""
    if len(records) > 1:
        others = ", ".join(str(each.system) for each in records if each is not record)
        yield "vehicle", f"system {record.system}, by its flight; also in the log: {others}"
    wind = record.mean_wind(found.start, found.solution.plan.flight.duration)
    if wind is None:
        yield "wind", "not estimated by the autopilot"
    else:
        east, north = map(float, wind)
        source = math.degrees(math.atan2(-east, -north)) % 360
        yield "wind", f"{math.hypot(east, north):.1f} m/s from {source:.0f} degrees, as estimated"
    timed = result.conversion.parameters if result.conversion is not None else {}
    differing = other_parameters(record, result)
    known = sum(name in record.parameters for name in timed)
    if differing:
        text = ", ".join(f"{name} {was:g} (not {due:g})" for name, (was, due) in differing.items())
        yield "parameters", f"other than the mission is timed for: {text}"
    elif timed and known:
        yield "parameters", f"{known} in the log, as the mission is timed for"
    elif timed:
        yield "parameters", "not in the log"


def other_parameters(record: FlightRecord, result: Result) -> dict[str, tuple[float, float]]:
    """Return by name the value in the log and the one that the mission is timed for, if another."""
    timed = result.conversion.parameters if result.conversion is not None else {}
    return {
        name: (record.parameters[name], value)
        for name, value in timed.items()
        if name in record.parameters
        and not math.isclose(record.parameters[name], value, rel_tol=_SAME)
    }
