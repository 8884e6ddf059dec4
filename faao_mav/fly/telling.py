"""What is told of a flight while it is watched: to people, to programs, and to radios."""

import time
from collections.abc import Callable, Sequence
from dataclasses import asdict
from typing import Any

from faao_mav.autopilot import Track
from faao_mav.fly.fly import FlightReport
from faao_mav.fly.radio import Radios
from faao_mav.fly.watch import Watch
from faao_mav.optimizer.solution import Solution
from faao_mav.validate.comparison import predicted_line
from faao_mav.validate.flown import (
    Debriefing,
    FlightRecord,
    Standing,
    debriefing,
    plan_start,
    standing,
)
from faao_mav.validate.rule import Finding, Level
from faao_mav.validate.words import by_rule, count_of, line_of

_PERIOD = 1.0
"""Seconds between two lines, by the world's clock and by the vehicle's (a simulator's is quick)."""

_NO_VOLTAGE = 65_535
"""What SYS_STATUS says of a voltage that is not known."""


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
        seen, found, fixes = watch.seen, watch.findings, watch.seen.fixes
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
        if not ready or now < self._next:
            return
        self._next, self._last = now + _PERIOD, fixes[-1].t
        self._say(_as_dict(watch, self._standing(watch), self._solution))

    def debriefing(self, report: FlightReport) -> Debriefing | None:
        """Return what became of the plan; None without one, or without its flight."""
        if self._solution is None or self._line is None or not len(report.record.t):
            return None
        return debriefing(self._solution, self._line, report.record, report.relay_start)

    def _standing(self, watch: Watch) -> Standing | None:
        """Return how the flight stands; None before it has left w_I, and when it is over."""
        before = watch.phase in ("checking", "engaging", "arming", "starting", "waiting")
        if self._solution is None or self._line is None or before:
            return None
        record, start = watch.seen.record(), watch.relay_start
        if start is None and not watch.streams:
            flight = record.line(self._solution)
            self._start = start = plan_start(self._solution, self._line, flight)
        if start is None:
            return None
        stands = standing(self._solution, self._line, record.line(self._solution, start))
        return None if stands.over else stands


def _as_dict(watch: Watch, stands: Standing | None, solution: Solution | None) -> dict[str, Any]:
    """Return a line of `--json`: s, degrees, m, V, percent, bit/s/Hz, bit/Hz and 10^6 bytes."""
    seen, last = watch.seen, watch.seen.fixes[-1]
    volts = _NO_VOLTAGE if seen.status is None else seen.status.voltage_battery
    told: dict[str, Any] = {
        "t": last.t,
        "phase": watch.phase,
        "mode": seen.mode,
        "item": seen.row,
        "latitude": last.latitude,
        "longitude": last.longitude,
        "height": seen.height,
        "volts": None if volts == _NO_VOLTAGE else volts / 1000,
        "battery": seen.battery,
        "plan": None if stands is None else asdict(stands),
    }
    if stands is not None and solution is not None:
        for name in ("delivered", "expected"):
            rate = told["plan"][name] / solution.plan.flight.duration
            told["plan"][f"{name}_mbytes"] = solution.plan.megabytes(rate)
    return told


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
