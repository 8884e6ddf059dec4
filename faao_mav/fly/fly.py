"""Flying: a vehicle is watched, and people, programs and radios are told of its flight."""

import json
import socket
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass
from typing import Any, Unpack

import numpy as np

from faao_mav.arrays import Real
from faao_mav.autopilot import Track
from faao_mav.errors import InputError, LinkError
from faao_mav.fly.preflight import Clearance, Flight
from faao_mav.fly.stream import Stream
from faao_mav.fly.telemetry import POSITION_RATE, Ending
from faao_mav.fly.watch import BEFORE, Watch
from faao_mav.optimizer.solution import Solution
from faao_mav.schedule.precoder_table import check_of_slots, taken_by
from faao_mav.validate import flown
from faao_mav.validate.comparison import predicted_line
from faao_mav.validate.flown import Debriefing, FlightRecord
from faao_mav.validate.rule import Finding, Level, by_rule, count_of, line_of
from faao_mav.vector import lengths
from faao_mav.wire.client import LinkOptions, Session
from faao_mav.wire.discover import FoundVehicle
from faao_mav.wire.jobs import read_held
from faao_mav.wire.protocol import MissionType
from faao_mav.wire.wire_items import Difference, wire_items

_NEAR = 20.0
"""Before the plan's clock is known slots are told within so many metres of flight.start; chosen."""

_PERIOD = 1.0
"""Seconds between two lines, by the world's clock and by the vehicle's (a simulator's is quick)."""

_NO_VOLTAGE = 65_535  # What SYS_STATUS says of a voltage that is not known.


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

    It is armed and started only with `arm`, and only where a `Clearance` finds no error; for
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
        lists = {part: sent for part, sent in lists.items() if sent}
        # A vehicle that flies already is not judged, and not kept busy.
        judged = arm or flight.streamed or not vehicle.armed
        asked = tuple(MissionType if judged else lists)
        held = session.run(read_held(peer, asked, parameters=judged, home=judged))
        wrong = list[Difference]()
        for part, sent in lists.items():
            if part in held.missing:
                raise LinkError(f"{connection}: {session.not_read(held.missing[part])}")
            wrong += held.other_than(sent, part, peer.vehicle)
        if wrong:
            return FlightReport(vehicle, tuple(wrong), None, FlightRecord.of(()))
        gate = Clearance(flight, peer, held, elsewhere, untimed, judged)
        if flight.streamed and flight.solution is not None:
            watch: Watch = Stream(gate, rate=rate)
        else:
            watch = Watch(gate, arm=arm, lands=lands, rate=rate)
        watch.seen.strangers = session.strangers
        try:
            ending = session.watch(watch, lambda: watching(watch), beats=arm or watch.streams)
        except LinkError as error:
            ending = Ending("lost", str(error))
    found = gate.findings or ()
    return FlightReport(vehicle, (), ending, watch.seen.record(), watch.relay_start, found)


class Radios:
    """Radios that take lines as datagrams at `to`, udp:HOST:PORT, in a flight of `solution`.

    They are told a slot whenever another is reached. By what slots are taken `taken_by` says: by
    time, or by place, of the slots planned there the one whose time is nearest. A radio that does
    not listen is no reason to stop a flight: what cannot be sent is dropped. Raises `InputError`
    for another `to`, and as `check_of_slots` does.
    """

    def __init__(self, solution: Solution, to: str) -> None:
        kind, _, where = to.partition(":")
        host, _, port = where.rpartition(":")
        if kind != "udp" or not host or not port.isdecimal() or not 0 < int(port) < 65_536:
            raise InputError(f"--radio {to}: expected udp:HOST:PORT, as in udp:127.0.0.1:5005")
        check_of_slots(solution)
        self._solution, self._to, self._last = solution, (host, int(port)), -1

    def line(self, t: float | None, w: Real) -> str | None:
        """Return the line of the slot of an aircraft at `w` (2,), m, if it is another than before.

        `t` is the time on the plan's clock, s; None while that is not known: then slots are taken
        by place while it is near flight.start. None, too, before and after the plan's time.

        It is a JSON object: `slot`; `t`, s; `east` and `north`, m, where the aircraft is; `P_B` and
        `P_U`, rows of [real, imaginary], sqrt(W); `receive_share`, null in full duplex; `step_B`
        and `step_U`, the numbers of the rates of both hops, null without `radio.rates`.
        """
        solution, plan = self._solution, self._solution.plan
        away = float(lengths(w - solution.w[0]))
        if not (away <= _NEAR if t is None else 0 <= t < plan.flight.duration):
            return None
        planned = now = 0.0 if t is None else t
        if t is None or taken_by(plan) == "place":
            planned -= flown.late(solution, now, w)
        step = float(solution.t[1] - solution.t[0])
        slot = min(int(max(planned, 0.0) / step + 1e-9), len(solution.t) - 1)
        if slot == self._last:
            return None
        self._last = slot
        precoders = solution.P_B[slot], solution.P_U[slot]
        P_B, P_U = (np.stack([P.real, P.imag], axis=-1).tolist() for P in precoders)
        share = None if solution.shares is None else float(solution.shares[slot])
        steps = (None, None) if solution.steps is None else [int(n[slot]) for n in solution.steps]
        told = {"slot": slot, "t": t, "east": float(w[0]), "north": float(w[1])}
        told |= {"P_B": P_B, "P_U": P_U, "receive_share": share}
        return json.dumps(told | {"step_B": steps[0], "step_U": steps[1]})

    def tell(self, t: float | None, w: Real) -> None:
        """Send the line of that slot, if it is another one."""
        line = self.line(t, w)
        if line is not None:
            with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as link, suppress(OSError):
                link.sendto(f"{line}\n".encode(), self._to)


class Telling:
    """Tells what a watch sees: called after its every step, it says what is new.

    `say` is given events, {"note": text}, of which one has "findings" too, what the gate before the
    flight found, and once a second how the flight stands: where the vehicle is, and beside
    `solution`, of which `track` is the predicted flight, how late it is and what it delivers.
    `radios` are told the slots of `solution` meanwhile.
    """

    def __init__(
        self,
        solution: Solution | None,
        track: Track | None,
        radios: Radios | None,
        say: Callable[[dict[str, Any]], object],
    ) -> None:
        self._solution, self._radios, self._say = solution, radios, say
        self._line = None if solution is None else predicted_line(solution, track)
        self._start: float | None = None
        self._told, self._heard, self._next, self._last = 0, 0, 0.0, -_PERIOD
        self._found: tuple[Finding, ...] | None = None

    def __call__(self, watch: Watch) -> None:
        """Say what has happened since the last call, and once a second how the flight stands."""
        seen, found, fixes = watch.seen, watch.gate.findings, watch.seen.fixes
        if found is not None and found != self._found:
            self._found = found
            self._say({"note": findings_text(found), "findings": [asdict(each) for each in found]})
        for text in seen.told[self._told :]:
            self._say({"note": text})
        self._told = len(seen.told)
        start = self._start if watch.relay_start is None else watch.relay_start
        if self._radios is not None and self._solution is not None and len(fixes) > self._heard:
            self._heard = len(fixes)
            place = FlightRecord.of(fixes[-1]).line(self._solution).w[0]
            self._radios.tell(None if start is None else fixes[-1].t - start, place)
        now = time.monotonic()
        ready = seen.heartbeat is not None and fixes and fixes[-1].t >= self._last + _PERIOD
        if ready and now >= self._next:
            self._next, self._last = now + _PERIOD, fixes[-1].t
            self._say(self._row(watch))

    def debriefing(self, report: FlightReport) -> Debriefing | None:
        """Return what became of the plan; None without one, or without its flight."""
        if self._solution is None or self._line is None or not len(report.record.t):
            return None
        return flown.debriefing(self._solution, self._line, report.record, report.relay_start)

    def _row(self, watch: Watch) -> dict[str, Any]:
        """Return a line of `--json`: s, degrees, m, V, percent, bit/s/Hz, bit/Hz and 10^6 bytes."""
        seen, last = watch.seen, watch.seen.fixes[-1]
        volts = _NO_VOLTAGE if seen.status is None else seen.status.voltage_battery
        return {
            "t": last.t,
            "phase": watch.phase,
            "mode": seen.mode,
            "item": seen.row,
            "latitude": last.latitude,
            "longitude": last.longitude,
            "height": seen.height,
            "volts": None if volts == _NO_VOLTAGE else volts / 1000,
            "battery": seen.battery,
            "plan": self._standing(watch),
        }

    def _standing(self, watch: Watch) -> dict[str, Any] | None:
        """Return how the flight stands; None before it has left w_I, and when it is over."""
        solution = self._solution
        if solution is None or self._line is None or watch.phase in BEFORE:
            return None
        record, start = watch.seen.record(), watch.relay_start
        if start is None and not watch.streams:
            self._start = start = flown.plan_start(solution, self._line, record.line(solution))
        if start is None:
            return None
        stands = flown.standing(solution, self._line, record.line(solution, start))
        told = asdict(stands)
        for name in ("delivered", "expected"):
            rate = told[name] / solution.plan.flight.duration
            told[f"{name}_mbytes"] = solution.plan.megabytes(rate)
        return None if stands.over else told


def findings_text(findings: Sequence[Finding]) -> str:
    """Return what the gate before a flight found, for people: a line for each rule."""
    lines = [f"before the flight: {', '.join(count_of(findings, level) for level in Level)}"]
    for group in by_rule(findings):
        action = f"; to do: {group[0].action}" if group[0].action else ""
        lines.append(f"   {line_of(group)}{action}")
    return "\n".join(lines)


HEADER = "    plan  mode      item   height     late  off plan  off path  to UAV  to user  arrived"
"""What the columns of `as_text` are: the plan's clock, s, the mode, the item under way, m above
home, how late against the plan, how far from it now and from its path, both hops' rates now,
bit/s/Hz, and what is delivered so far of what is expected by the end."""


def as_text(told: dict[str, Any]) -> str:
    """Return what a `Telling` says for people: an event, or a row of the table under `HEADER`."""
    if "note" in told:
        return f"-- {told['note']}"
    plan, item = told["plan"], "?" if told["item"] is None else told["item"]
    clock = f"{plan['time']:6.1f} s" if plan is not None else f"{'-':>8}"
    parts = [clock, f"{told['mode']:<8}", f"{item:>4}", f"{told['height']:5.1f} m"]
    if plan is not None:
        unit, suffix = ("bit/Hz", "") if plan["expected_mbytes"] is None else ("MB", "_mbytes")
        parts += [
            f"{plan['late']:+5.1f} s",
            f"{plan['apart']:6.1f} m",
            f"{plan['astray']:6.1f} m",
            f"{plan['I_U']:6.2f}",
            f"{plan['I_G']:7.2f}",
            f"{plan['delivered' + suffix]:.1f} of {plan['expected' + suffix]:.1f} {unit}",
        ]
    if told["battery"] is not None:
        parts.append(f"battery {told['battery']} %")
    return "  ".join(parts)
