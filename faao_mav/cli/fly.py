"""`faao-mission fly`: watch a mission to its end, beside its plan."""

import json
import time
from contextlib import AbstractContextManager, nullcontext
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from faao_mav.cli.planned import PlanFile, SolutionFile, check_one, planned
from faao_mav.cli.shared import (
    VEHICLE,
    Component,
    Log,
    Radio,
    SigningKey,
    System,
    Wait,
    exit_status,
    flag,
    note,
    option,
)
from faao_mav.errors import InputError

if TYPE_CHECKING:
    from faao_mav.mavlink.flying.fly import FlightReport
    from faao_mav.mavlink.flying.replan import Foresight, Solver
    from faao_mav.mavlink.flying.solving import ProcessSolver
    from faao_mav.mavlink.flying.watch import Watch
    from faao_mav.mission.formats import MissionFile
    from faao_mav.optimizer.solution import Solution
    from faao_mav.validate.flown import Debriefing, Line, Standing
    from faao_mav.vehicle import Track

_PERIOD = 1.0
"""Seconds between two lines, by the world's clock and by the vehicle's (a simulator's is quick)."""

_NO_VOLTAGE = 65_535
"""What SYS_STATUS says of a voltage that is not known."""


@exit_status()
def fly(
    mission_file: Annotated[Path, typer.Argument(metavar="MISSION", help="The mission file.")],
    to: Annotated[str, option("CONNECTION", VEHICLE)],
    plan_file: PlanFile = None,
    solution_file: SolutionFile = None,
    arm: Annotated[bool, flag("--arm", "Arm the vehicle and start the mission.")] = False,
    stream: Annotated[
        bool, flag("--stream", "Fly the plan by setpoints instead of the mission; needs --arm.")
    ] = False,
    rate: Annotated[float, option("HZ", "Setpoints a second of --stream.", min=4, max=50)] = 10.0,
    replan: Annotated[
        bool,
        flag("--replan", "Solve the rest again where the flight is off its plan; needs a plan."),
    ] = False,
    radio: Radio = None,
    as_json: Annotated[bool, flag("--json", "Print JSON objects, one a line.")] = False,
    system: System = None,
    component: Component = None,
    log: Log = None,
    timeout: Wait = 10.0,
    signing_key: SigningKey = None,
) -> None:
    """Watch a vehicle fly a mission that it holds, to the end.

    What the vehicle holds is compared with MISSION first. A line a second tells mode, item and
    battery; with a plan also how late the flight is, how far from plan and path (m), the rates of
    both hops, and what is delivered so far and by the end. It arms and starts only with --arm, once
    the autopilot's own checks pass and no other ground station is on the link. A pilot who changes
    the mode has the aircraft: nothing more is sent. With --stream a copter that holds the mission
    flies the trajectory of the plan by setpoints (GUIDED, Offboard), not the mission; with --replan
    the rest is solved again, and flown, where wind or a pause has put it off its plan by more than
    a second. Of a mission --replan only says what that would deliver. Ctrl-C asks a
    flight that was started here to hold, a second one leaves it; in other flights the first one
    leaves.

    Exit status: 0 the mission was flown to its end; 1 it was not, or that is not known; 2 unusable
    arguments or input.
    """
    from faao_mav.mavlink.flying.fly import fly as run
    from faao_mav.mavlink.flying.telemetry import POSITION_RATE
    from faao_mav.mission.formats import read_mission_file
    from faao_mav.report.summary import debriefing_lines, joined

    check_one(plan_file, solution_file)
    if stream and not arm:
        raise InputError("--stream: needs --arm: it arms the vehicle, and flies it")
    for name, given in (("--stream", stream), ("--replan", replan), ("--radio", radio)):
        if given and plan_file is None and solution_file is None:
            raise InputError(f"{name}: needs --plan or --solution: the flight that is planned")
    file = read_mission_file(mission_file)
    for line in file.warnings:
        note(line)
    solution = planned(plan_file, solution_file)
    feed = _Feed(solution, radio) if solution is not None and radio is not None else None
    track = None if stream else _predicted(mission_file, file, solution)
    telling = _Telling(solution, track, feed, as_json=as_json)
    rate = rate if stream else POSITION_RATE
    if feed is not None:
        rate = max(rate, feed.slots_per_second * 2)  # two positions for each slot at least
    with _solver(wanted=replan) as solver:
        if solver is not None and solution is not None and not stream:
            telling.foresee(solver)
        report = run(
            file.mission,
            to,
            arm=arm,
            lands=track is None or track.lands,
            stream=solution if stream else None,
            solver=solver,
            rate=rate,
            watching=telling,
            system=system,
            component=component,
            log=log,
            signing_key=signing_key,
            wait=timeout,
            note=note,
        )
    ending = report.ending
    found = telling.debriefing(report)
    if as_json:
        from faao_mav.workflow import debriefing_as_dict

        told: dict[str, Any] = {
            "ending": ending.kind if ending else "different",
            "text": ending.text if ending else "the vehicle holds another mission",
            "differences": [str(each) for each in report.differences],
            "flight": debriefing_as_dict(found) if found else None,
        }
        typer.echo(json.dumps(told, allow_nan=False))
    else:
        for each in report.differences:
            typer.echo(f"different    {each}")
        if found is not None:
            typer.echo(joined(debriefing_lines(found)))
        if ending is not None:
            typer.echo(f"{ending.kind:<13}{ending.text}")
        else:
            note("the vehicle holds another mission than the file: upload it first")
    if ending is None or ending.kind != "finished":
        raise typer.Exit(1)


def _solver(*, wanted: bool) -> "AbstractContextManager[ProcessSolver | None]":
    if not wanted:
        return nullcontext()
    from faao_mav.mavlink.flying.solving import ProcessSolver

    return ProcessSolver()


def _predicted(
    mission_file: Path, file: "MissionFile", solution: "Solution | None"
) -> "Track | None":
    """Return the predicted flight of the mission; None, which is noted, if there is none."""
    from faao_mav.cli.vehicle import choose_vehicle
    from faao_mav.errors import FaaoError
    from faao_mav.vehicle.predict import predict

    plan = solution.plan if solution is not None else None
    vehicle, _ = choose_vehicle(mission_file, file, plan, (None, None, None))
    try:
        return predict(file.mission, vehicle, wind=plan.wind if plan else (0.0, 0.0))
    except FaaoError as error:
        note(f"the flight is not predicted: {error}")
        return None


def _predicted_line(solution: "Solution", track: "Track | None") -> "Line":
    from faao_mav.validate.comparison import on_the_plans_clock
    from faao_mav.validate.flown import Line, planned_line

    return planned_line(solution) if track is None else Line(*on_the_plans_clock(solution, track))


class _Telling:
    """Tells what a watch sees: called after its every step, it prints what is new."""

    def __init__(
        self,
        solution: "Solution | None",
        track: "Track | None",
        feed: "_Feed | None",
        *,
        as_json: bool,
    ) -> None:
        self._solution, self._flown, self._feed = solution, solution, feed
        self._as_json = as_json
        self._start: float | None = None
        self._told, self._next, self._last = 0, 0.0, -_PERIOD
        self._line = None if solution is None else _predicted_line(solution, track)
        self._foresight: Foresight | None = None

    def foresee(self, solver: "Solver") -> None:
        """Tell what a new course would deliver where a mission's flight is off its plan."""
        from faao_mav.mavlink.flying.replan import Foresight

        if self._solution is not None:
            self._foresight = Foresight(self._solution, solver)

    def __call__(self, watch: "Watch") -> None:
        """Print what has happened since the last call, and once a second how the flight stands."""
        seen = watch.seen
        if watch.solution is not None and watch.solution is not self._flown:
            self._flown = watch.solution
            self._line = _predicted_line(watch.solution, None)
            if self._feed is not None:
                self._feed.follow(watch.solution)
        for text in seen.told[self._told :]:
            typer.echo(json.dumps({"note": text}) if self._as_json else f"-- {text}")
        self._told = len(seen.told)
        if self._feed is not None:
            self._feed(watch, self._start if watch.relay_start is None else watch.relay_start)
        now, t = time.monotonic(), seen.samples.t[-1] if seen.samples.t else float("-inf")
        if seen.heartbeat is None or now < self._next or t < self._last + _PERIOD:
            return
        self._next, self._last = now + _PERIOD, t
        stands = None
        if watch.phase not in ("checking", "engaging", "arming", "starting", "waiting"):
            stands = self._standing(watch)
        if stands is not None and self._foresight is not None:
            self._foresee(self._foresight, watch, stands)
        told = _as_dict(watch, stands, self._flown)
        typer.echo(json.dumps(told, allow_nan=False) if self._as_json else _as_text(told))

    def debriefing(self, report: "FlightReport") -> "Debriefing | None":
        """Return what became of the plan; None without one, or without its flight."""
        if self._solution is None or self._line is None or not report.samples.t:
            return None
        record = report.samples.record()
        flown = report.solution or self._solution
        found = record.debriefing(flown, self._line, report.relay_start)
        return None if found is None else replace(found, solution=self._solution)

    def _standing(self, watch: "Watch") -> "Standing | None":
        """Return how the flight stands; None before it has left w_I, and when it is over."""
        from faao_mav.validate.flown import Line, plan_start, standing

        if self._flown is None or self._line is None:
            return None
        flight = watch.seen.samples.record().line(self._flown)
        start = watch.relay_start
        if start is None and watch.solution is None:
            self._start = start = plan_start(self._flown, self._line, flight)
        if start is None:
            return None
        stands = standing(self._flown, self._line, Line(flight.t - start, flight.w))
        return None if stands.over else stands

    def _foresee(self, foresight: "Foresight", watch: "Watch", stands: "Standing") -> None:
        from faao_mav.mavlink.flying.course import Setpoint
        from faao_mav.validate.flown import Line

        if self._flown is None or self._start is None or watch.seen.position is None:
            return
        flight, position = watch.seen.samples.record().line(self._flown), watch.seen.position
        now = Setpoint.of(flight.w[-1], position)
        told = foresight.step(Line(flight.t - self._start, flight.w), now, stands, 1.0)
        if told is not None:
            watch.seen.told.append(told)


class _Feed:
    """Tells radios the slots that are reached: called after every step of a watch."""

    def __init__(self, solution: "Solution", to: str) -> None:
        from faao_mav.mavlink.flying.radio import RadioFeed, UdpRadio

        self._solution = solution
        self._feed, self._radio = RadioFeed(solution), UdpRadio(to)
        self._seen = 0
        self.slots_per_second = 1 / solution.plan.flight.time_step

    def follow(self, solution: "Solution") -> None:
        """Go on with the slots of `solution`, whose clock is the same."""
        from faao_mav.mavlink.flying.radio import RadioFeed

        self._solution, self._feed = solution, RadioFeed(solution)

    def __call__(self, watch: "Watch", start: float | None) -> None:
        """Send what is new; the plan's clock read 0 at `start`, s on the vehicle's."""
        samples = watch.seen.samples
        if len(samples.t) == self._seen:
            return
        self._seen = len(samples.t)
        t = None if start is None else samples.t[-1] - start
        place = samples.record(-1).line(self._solution).w[0]
        if (line := self._feed.line(t, place)) is not None:
            self._radio.send(line)


def _as_dict(
    watch: "Watch", stands: "Standing | None", solution: "Solution | None"
) -> dict[str, Any]:
    """Return a line of `--json`: s, m, V, percent, bit/s/Hz, bit/Hz and 10^6 bytes."""
    samples, status = watch.seen.samples, watch.seen.status
    volts = status.voltage_battery if status is not None else _NO_VOLTAGE
    percent = status.battery_remaining if status is not None else -1
    told: dict[str, Any] = {
        "t": samples.t[-1],
        "phase": watch.phase,
        "mode": watch.seen.mode,
        "item": watch.seen.row,
        "height": samples.height[-1],
        "volts": None if volts == _NO_VOLTAGE else volts / 1000,
        "battery": None if percent < 0 else percent,
        "plan": asdict(stands) if stands is not None else None,
    }
    if stands is not None and solution is not None:
        for name in ("delivered", "expected"):
            rate = told["plan"][name] / solution.plan.flight.duration
            told["plan"][f"{name}_mbytes"] = solution.plan.megabytes(rate)
    return told


def _as_text(told: dict[str, Any]) -> str:
    """Return that line for people."""
    item = "?" if told["item"] is None else told["item"]
    parts = [f"{told['mode']:<10}item {item:<3}{told['height']:6.1f} m"]
    if (plan := told["plan"]) is not None:
        unit, suffix = ("bit/Hz", "") if plan["expected_mbytes"] is None else ("MB", "_mbytes")
        parts = [
            f"{plan['time']:6.1f} s",
            *parts,
            f"{plan['late']:+5.1f} s, {plan['apart']:.1f} m off, {plan['astray']:.1f} m from path",
            f"rates {plan['I_U']:.2f} {plan['I_G']:.2f}",
            f"{plan['delivered' + suffix]:.1f} of {plan['expected' + suffix]:.1f} {unit}",
        ]
    if told["battery"] is not None:
        parts.append(f"battery {told['battery']} %")
    return "  ".join(parts)
