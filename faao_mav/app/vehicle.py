"""What the page does with a vehicle and its logs: upload, watch, debrief, as the command line does.

Everything here takes and returns what can be sent between processes.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from faao_mav.app.answers import thinned
from faao_mav.errors import FaaoError, PlanError
from faao_mav.report.flights import debriefing_lines
from faao_mav.report.lines import joined
from faao_mav.schedule.conversion import Conversion, beyond_vehicle
from faao_mav.workflow import Result


class Interrupt(Protocol):
    """What the page sets to interrupt a job, as Ctrl-C does a command: an `Event`."""

    def is_set(self) -> bool:
        """Whether it is set."""

    def clear(self) -> None:
        """Take note of it."""


def _to_fly(result: Result) -> Conversion:
    """Return the mission of `result`, to be put on a vehicle or started.

    What the command line would not upload is not returned: `PlanError` for a mission with errors,
    and for that of a plan beyond its vehicle.
    """
    if beyond := beyond_vehicle(result.solution.plan):
        raise PlanError("\n".join(beyond))
    if result.conversion is None or not result.flyable:
        raise PlanError("the mission does not pass validation; do not fly it")
    return result.conversion


def uploaded(result: Result, connection: str) -> str:
    """Upload the mission of `result` to `connection`, read it back, compare; return what to tell.

    Nothing is armed or started.
    """
    from faao_mav.mavlink.client import upload
    from faao_mav.mavlink.flying.seen import Flight
    from faao_mav.mavlink.upload_text import upload_text

    try:
        flight = Flight.planned(_to_fly(result), result.solution)
        report = upload(flight.mission, connection, made_for=flight.made_for, note=lambda _: None)
    except FaaoError as error:
        return f"failed       {error}"
    told = upload_text(report)
    return told if report.verified else f"{told}\nthe mission is not verified; do not fly it"


def watched(
    tell: Callable[[dict[str, Any]], object],
    interrupt: Interrupt,
    result: Result,
    connection: str,
    arm: bool,
) -> str:
    """Watch the vehicle at `connection` fly the mission of `result`; return what became of it.

    It is `faao-mission fly`, with `arm` its --arm: see `faao_mav.mavlink.flying.fly`. `tell` is
    given what a `Telling` says; `interrupt`, once set, is Ctrl-C. Raises what `fly` raises.
    """
    from faao_mav.mavlink.flying.fly import fly
    from faao_mav.mavlink.flying.seen import Flight
    from faao_mav.mavlink.flying.telling import Telling
    from faao_mav.mavlink.flying.watch import Watch
    from faao_mav.report.debrief import flight_lines

    def look(*_: object) -> None:
        if interrupt.is_set():
            interrupt.clear()
            raise KeyboardInterrupt

    def watching(watch: Watch) -> None:
        telling(watch)
        look()

    conversion = _to_fly(result)
    track = result.check.track if result.check is not None else None
    telling = Telling(result.solution, track, None, tell)
    report = fly(
        Flight.planned(conversion, result.solution),
        connection,
        arm=arm,
        lands=track is None or track.lands,
        watching=watching,
        observe=look,
        note=lambda text: tell({"note": text}),
    )
    told = joined(flight_lines(report, telling.debriefing(report)))
    if report.ending is None:
        return f"{told}\nthe vehicle holds another mission: upload this one first"
    return told


def debriefed(result: Result, log: Path, name: str) -> tuple[str, list[list[float]]]:
    """Return what `faao-mission debrief` says of a `log` of the `name`, and the flight's line.

    The line is in [latitude, longitude]. Raises `FaaoError` where the plan's flight is not in the
    log, and `InputError` for a file that is none.
    """
    from faao_mav.mavlink.flying.logs import read_log
    from faao_mav.report import debrief

    try:
        records = read_log(log)
    except FaaoError as error:
        raise type(error)(str(error).replace(str(log), name)) from None
    record, found = debrief.debriefed(records, result, name)
    remarks = debrief.remarks_on(records, record, found, result)
    said = joined([*debriefing_lines(found), *remarks])
    relay = (record.t >= found.start) & (record.t <= found.start + found.flown.duration)
    places = np.stack([record.latitude, record.longitude], axis=1)[relay]
    return said, thinned(places).round(8).tolist()
