"""Watch the flight of a mission that a vehicle holds: compare it with the file, then follow it."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Unpack

from faao_mav.errors import LinkError
from faao_mav.fly.preflight import Clearance, Flight
from faao_mav.fly.stream import Stream
from faao_mav.fly.telemetry import POSITION_RATE, Ending, read_held
from faao_mav.fly.watch import Watch
from faao_mav.validate.flown import FlightRecord
from faao_mav.validate.rule import Finding
from faao_mav.wire.client import LinkOptions, Session
from faao_mav.wire.discover import FoundVehicle
from faao_mav.wire.protocol import MissionType
from faao_mav.wire.verify import Difference
from faao_mav.wire.wire_items import wire_items


@dataclass(frozen=True, slots=True)
class FlightReport:
    """How a flight was watched: `ending` is None where the vehicle does not hold the mission.

    `differences` are what it holds instead; `record` is where it was. `relay_start` is when the
    clock of a streamed plan read 0, s on the vehicle's. `findings` is what the gate before the
    flight found last.
    """

    vehicle: FoundVehicle
    differences: tuple[Difference, ...]
    ending: Ending | None
    record: FlightRecord
    relay_start: float | None = None
    findings: tuple[Finding, ...] = ()


def fly_mission(
    flight: Flight,
    connection: str,
    *,
    arm: bool = False,
    lands: bool = True,
    elsewhere: bool = False,
    untimed: bool = False,
    rate: float = POSITION_RATE,
    watching: Callable[[Watch], object] = lambda _: None,
    **options: Unpack[LinkOptions],
) -> FlightReport:
    """Watch the vehicle at `connection` fly the mission of `flight`, which it has to hold already.

    It is armed and started only with `arm`, and only where `preflight` finds no error; for
    `elsewhere` and `untimed` see there. `lands` tells whether the flight ends on the ground. A
    flight that is `streamed` is armed and flown by setpoints instead of its mission: see `Stream`,
    and what that raises. `rate` is how many positions it is asked for a second. `watching` is
    called after every step. Raises `LinkError` if there is no such vehicle, none that is known
    here, or its mission cannot be read.

    >>> from faao_mav import Flight, read_mission
    >>> flight = Flight(read_mission("tests/data/missions/plain.waypoints"))
    >>> fly_mission(flight, "udpout:127.0.0.1:9", wait=0.1)  # doctest: +ELLIPSIS
    Traceback (most recent call last):
        ...
    faao_mav.errors.LinkError: udpout:127.0.0.1:9: no heartbeat of an autopilot ...
    """
    with Session(connection, **options) as session:
        vehicle, peer = session.found, session.peer
        if peer.vehicle is None:
            raise LinkError(f"{connection}: {vehicle}: flights of it are not watched")
        lists = {part: wire_items(flight.mission, part, peer.vehicle) for part in MissionType}
        # A vehicle that flies already is not judged, and not kept busy.
        judged = arm or flight.streamed or not vehicle.armed
        asked = tuple(part for part in MissionType if judged or lists[part])
        held = session.run(read_held(peer, asked, parameters=judged))
        wrong = list[Difference]()
        for part, sent in lists.items():
            if sent and part in held.missing:
                raise LinkError(f"{connection}: {session.not_read(held.missing[part])}")
            wrong += held.other_than(sent, part, peer.vehicle) if sent else ()
        if wrong:
            return FlightReport(vehicle, tuple(wrong), None, FlightRecord.of(()))
        allowed = {"elsewhere": elsewhere, "untimed": untimed}
        gate = Clearance(flight, peer, held, judged=judged, **allowed)
        if flight.streamed and flight.solution is not None:
            watch: Watch = Stream(gate, rate=rate)
        else:
            watch = Watch(gate, arm=arm, lands=lands, rate=rate)
        watch.seen.strangers = session.strangers
        try:
            beats = arm or watch.streams
            ending = session.watch(watch, lambda: watching(watch), beats=beats)
        except LinkError as error:
            ending = Ending("lost", str(error))
    found = gate.findings or ()
    return FlightReport(vehicle, (), ending, watch.seen.record(), watch.relay_start, found)
