"""What the page does with a vehicle and its logs: upload, watch, debrief, as the command line does.

It arms and starts nothing: a page that is closed takes its processes along, which must not be those
that fly. Everything here takes and returns what can be sent between processes.
"""

import shlex
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from faao_mav.errors import FaaoError, PlanError
from faao_mav.report.maps import thinned
from faao_mav.report.summary import joined
from faao_mav.schedule.conversion import beyond_vehicle
from faao_mav.workflow import Result

if TYPE_CHECKING:
    from faao_mav.fly.preflight import Flight

MISSION = "mission.plan"
"""The downloaded file that `fly_command` names: the fence and the kind of vehicle are in it."""

Tell = Callable[[dict[str, Any]], object]
"""What a talk tells the page: a `note`, what it is `doing`, or how a flight stands."""


def fly_command(connection: str, plan: Path | None) -> str:
    """Return the line of a shell that arms the vehicle at `connection` and starts `MISSION`.

    `plan` is the file of the plan, where it has one. Returns nothing for a connection that is none.

    >>> fly_command("udpout:127.0.0.1:14550", None)
    'faao-mission fly mission.plan --to udpout:127.0.0.1:14550 --arm'
    """
    if not connection.strip() or not connection.isprintable():
        return ""
    words = ["faao-mission", "fly", MISSION, "--to", connection]
    if plan is not None and str(plan).isprintable():
        words += ["--plan", str(plan.resolve())]
    return shlex.join([*words, "--arm"])


def _to_fly(result: Result) -> "Flight":
    """Return the flight of the mission of `result`; `PlanError` where there is none to upload."""
    from faao_mav.fly.preflight import Flight

    if beyond := beyond_vehicle(result.solution.plan):
        raise PlanError("\n".join(beyond))
    if result.conversion is None or not result.flyable:
        raise PlanError("the mission does not pass validation; do not fly it")
    return Flight.planned(result.conversion, result.solution)


def uploaded(tell: Tell, look: Callable[[], None], result: Result, connection: str) -> str:
    """Upload the mission of `result` to `connection`, read it back, compare; return what to tell.

    Nothing is armed or started. `look` raises KeyboardInterrupt to cancel the upload. Raises what
    `upload` raises.
    """
    from faao_mav.wire.client import upload

    def observe(what: str, done: int, total: int) -> None:
        look()
        tell({"doing": f"{what}, {done} of {total}" if total else what})

    flight = _to_fly(result)
    report = upload(
        flight.mission,
        connection,
        made_for=flight.made_for,
        observe=observe,
        note=lambda text: tell({"note": text}),
    )
    tell({"doing": ""})
    told = str(report)
    return told if report.verified else f"{told}\nthe mission is not verified; do not fly it"


def watched(tell: Tell, look: Callable[[], None], result: Result, connection: str) -> str:
    """Watch the vehicle at `connection` fly the mission of `result`; return what became of it.

    It is `faao-mission fly` without --arm: see `faao_mav.fly.fly`, and what that raises. `tell` is
    given what a `Telling` says; `look` raises KeyboardInterrupt to leave the flight.
    """
    from faao_mav.fly.fly import Telling, fly_mission
    from faao_mav.fly.watch import Watch
    from faao_mav.report.debrief import flight_lines

    def watching(watch: Watch) -> None:
        telling(watch)
        look()

    flight = _to_fly(result)
    track = result.check.track if result.check is not None else None
    telling = Telling(result.solution, track, None, tell)
    report = fly_mission(
        flight,
        connection,
        lands=track is None or track.lands,
        watching=watching,
        observe=lambda *_: look(),
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
    from faao_mav.fly.logs import read_log
    from faao_mav.report.debrief import FromLog

    try:
        records = read_log(log)
    except FaaoError as error:
        raise type(error)(str(error).replace(str(log), name)) from None
    told = FromLog.of(records, result, name)
    record, found = told.record, told.found
    relay = (record.t >= found.start) & (record.t <= found.start + found.flown.duration)
    places = np.stack([record.latitude, record.longitude], axis=1)[relay]
    return joined(told.lines()), thinned(places).round(8).tolist()
