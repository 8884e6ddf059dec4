"""What became of a plan in a flight, watched or from a log, in lines for people."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from faao_mav.errors import FaaoError, counted
from faao_mav.fly.logs import read_log
from faao_mav.optimizer.solution import Solution
from faao_mav.plan.radio import STATIONS
from faao_mav.radio.gain import PER_DB
from faao_mav.radio.measured import SIK_STEP
from faao_mav.report.summary import Line, beside
from faao_mav.validate.comparison import predicted_line
from faao_mav.validate.flown import Debriefing, FlightRecord, debriefing
from faao_mav.workflow import Result, debriefing_as_dict, with_mission

if TYPE_CHECKING:
    from faao_mav.fly.fly import FlightReport

_SAME = 1e-5  # relative difference of parameters that single precision does not tell apart


def flight_lines(report: "FlightReport", found: Debriefing | None) -> Iterator[Line]:
    """Yield the lines of a flight that was watched: differences, what was `found`, its ending."""
    yield from (("different", str(each)) for each in report.differences)
    if found is not None:
        yield from _debriefing_lines(found)
    if report.ending is not None:
        yield report.ending.kind, report.ending.text


def _debriefing_lines(found: Debriefing) -> Iterator[Line]:
    """Yield what became of a plan, hop by hop: planned, predicted and flown."""
    if found.missing > 0:
        told = f"of the plan's last {found.missing:.1f} s there is no flight; until then "
        told += f"{100 * found.seen:.2f} % of what is planned had arrived. Below the aircraft "
        yield "incomplete", f"{told}counts as staying where it was seen last"
    if found.broken_off:
        told = f"the flight came no nearer to flight.end than {found.from_end:.0f} m: below counts "
        yield "broken off", f"{told}what it did instead until the plan's end"
    for name, flight in (("predicted", found.predicted), ("flown", found.flown)):
        yield from zip((name, "", "", ""), beside(found.solution, flight), strict=True)
    yield "height", f"at most {found.altitude_error:.1f} m from the planned one"


def debrief(log: str | Path, solution: Solution, system: int | None = None) -> "FromLog":
    """Return what became of the plan of `solution` in the flight of the file `log`.

    Of several vehicles in a `.tlog` it is the one whose flight is the plan's, or that of `system`.
    Raises `FaaoError` where the plan's flight is not in it, `InputError` for no log.

    >>> from faao_mav import optimize, read_plan
    >>> solution = optimize(read_plan("tests/data/logs/plan.yaml"))
    >>> told = debrief("tests/data/logs/arducopter.tlog", solution).as_dict()
    >>> told["flown"]["delivered_rate"] > 0.9 * told["planned"]["delivered_rate"]
    True
    """
    return FromLog.of(read_log(Path(log), system), with_mission(Result(solution)), str(log))


@dataclass(frozen=True, slots=True)
class FromLog:
    """The flight in a log that is the plan's of `result`, and what became of that plan.

    `records` are all flights in the log, `record` is the plan's; `found` compares it with the plan.
    """

    result: Result
    records: Sequence[FlightRecord]
    record: FlightRecord
    found: Debriefing

    @classmethod
    def of(cls, records: Sequence[FlightRecord], result: Result, source: str) -> "FromLog":
        """Return the flight in the log `source` that is the nearest to the plan of `result`.

        Raises `FaaoError` where none is.
        """
        line = predicted_line(result.solution, result.check.track if result.check else None)
        debriefings = ((record, debriefing(result.solution, line, record)) for record in records)
        found = [(record, each) for record, each in debriefings if each is not None]
        if not found:
            longest = max(record.t[-1] - record.t[0] for record in records)
            raise FaaoError(
                f"{source}: the plan's flight is not in it: no departure from flight.start like "
                f"the predicted one in {longest:.0f} s of flight"
            )
        nearest = min(found, key=lambda pair: pair[1].flown.rms_position_error)
        return cls(result, records, *nearest)

    def as_dict(self) -> dict[str, Any]:
        """Return the JSON object of `--json`.

        Beside what became of the plan it has the `wind`, m/s east and north, as the autopilot
        estimated it; `parameters` that are other than the mission is timed for, with the value in
        the log and that; and the `radio`.
        """
        known, duration = self.record.parameters, self.result.solution.plan.flight.duration
        wind = self.record.mean_wind(self.found.start, duration)
        return debriefing_as_dict(self.found) | {
            "wind": None if wind is None else wind.tolist(),
            "parameters": {
                name: (known[name], due)
                for name, due in self._timed.items()
                if name in known and not math.isclose(known[name], due, rel_tol=_SAME)
            },
            "system": self.record.system,
            "radio": self._radio(),
        }

    def lines(self) -> Iterator[Line]:
        """Yield what became of the plan, and what else the log says."""
        yield from _debriefing_lines(self.found)
        told = self.as_dict()
        if radio := told["radio"]:
            text = f"{counted(radio['levels'], 'level')} of a telemetry radio: their shape is "
            text += f"{radio['base_station_db']:.1f} dB rms from the planned gain of the base "
            text += f"station, {radio['ground_user_db']:.1f} of the ground user"
            yield "radio", f"{text}; faao-mission link fits a law to them"
        if len(self.records) > 1:
            others = ", ".join(str(r.system) for r in self.records if r is not self.record)
            yield "vehicle", f"system {told['system']}, by its flight; also in the log: {others}"
        if told["wind"] is None:
            yield "wind", "not estimated by the autopilot"
        else:
            east, north = told["wind"]
            start = math.degrees(math.atan2(-east, -north)) % 360
            speed = math.hypot(east, north)
            yield "wind", f"{speed:.1f} m/s from {start:.0f} degrees, as estimated"
        held = self._timed.keys() & self.record.parameters.keys()
        if other := told["parameters"]:
            text = ", ".join(f"{name} {was:g} (not {due:g})" for name, (was, due) in other.items())
            yield "parameters", f"other than the mission is timed for: {text}"
        elif held:
            yield "parameters", f"{len(held)} in the log, as the mission is timed for"
        elif self._timed:
            yield "parameters", "not in the log"

    @property
    def _timed(self) -> Mapping[str, float]:
        """The parameters that the mission is timed for."""
        return self.result.conversion.parameters if self.result.conversion is not None else {}

    def _radio(self) -> dict[str, Any] | None:
        """Return how many levels its radio told, and how far they are from the planned gains.

        That is the rms difference, dB, within a constant and by the steps of SiK radios, of both
        hops. None where it told none on the way.
        """
        solution, plan = self.result.solution, self.result.solution.plan
        flight = self.record.line(solution, self.found.start)
        told = np.isfinite(self.record.rssi) & (flight.t >= 0) & (flight.t < plan.flight.duration)
        if not told.any():
            return None
        t, w, level = flight.t[told], flight.w[told], self.record.rssi[told] * SIK_STEP
        found: dict[str, Any] = {"levels": len(level)}
        links = zip(STATIONS, solution.problem.links, plan.radio.stations, strict=True)
        for name, link, station in links:
            gains = replace(link.gains, station=station.at(t))
            found[f"{name}_db"] = float(np.std(level - gains.log(w.T) / PER_DB))
        return found
