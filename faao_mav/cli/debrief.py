"""`faao-mission debrief`: what became of a plan in a real flight, from its log."""

import json
from collections.abc import Iterator
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from faao_mav.cli.planned import PlanFile, SolutionFile, check_one, planned
from faao_mav.cli.shared import AsJson, File, Radio, exit_status, flag, note, option
from faao_mav.errors import InputError
from faao_mav.files import PAGES, check_apart, check_ending, check_writable, write_whole

if TYPE_CHECKING:
    from faao_mav.mavlink.flying.record import FlightRecord
    from faao_mav.report.lines import Line
    from faao_mav.validate.calibrate import Calibrated
    from faao_mav.validate.flown import Debriefing
    from faao_mav.workflow import Result


@exit_status()
def debrief(
    log: Annotated[Path, typer.Argument(metavar="LOG", help="The log: .bin, .tlog or .ulg.")],
    plan_file: PlanFile = None,
    solution_file: SolutionFile = None,
    report: Annotated[File, option("PAGE.html", "One page with all three tracks.")] = None,
    calibrate: Annotated[
        bool, flag("--calibrate", "Say which parameters would have predicted the flight better.")
    ] = False,
    radio: Radio = None,
    as_json: AsJson = False,
) -> None:
    """Say what became of a plan, from the log of its flight.

    Finds the relay flight in the log of an ArduPilot (.bin), a PX4 (.ulg, with pyulog) or a ground
    station (.tlog), and tells how late it was, how far from plan and path, and what each hop
    carried along the real track with the planned precoders, beside what was planned and predicted.
    --calibrate looks for parameters of the vehicle, each alone, with which the mission's flight
    would have been predicted nearer to the real one, in the wind that the autopilot estimated.
    --radio replays the flight to radios, at the pace at which it was flown.

    Exit status: 0 told; 1 the plan's flight is not in the log; 2 unusable arguments or input.
    """
    check_one(plan_file, solution_file)
    if plan_file is None and solution_file is None:
        raise InputError("--plan or --solution: give the plan that was flown")
    if report is not None:
        check_ending(report, "--report", PAGES)
        check_writable(report)
    read = {"LOG": log, "--plan": plan_file, "--solution": solution_file}
    check_apart({"--report": report}, read)
    from faao_mav.mavlink.flying.logs import read_log
    from faao_mav.mavlink.flying.radio import UdpRadio, replay, replayed
    from faao_mav.report.debrief import debriefed, other_parameters, remarks_on
    from faao_mav.report.flights import debriefing_lines
    from faao_mav.report.lines import joined
    from faao_mav.validate.flown import Line
    from faao_mav.workflow import Result, debriefing_as_dict, with_mission

    to = None if radio is None else UdpRadio(radio)
    record = read_log(log)
    solution = planned(plan_file, solution_file)
    assert solution is not None
    result = with_mission(Result(solution))
    found = debriefed(record, result, str(log))
    remarks = list(remarks_on(record, found, result))
    calibrated = _calibrated(record, found, result) if calibrate else []
    if calibrate:
        remarks += _calibration_lines(calibrated)
    if report is not None:
        from faao_mav.report.page import render_report

        page = render_report(result, title=f"{log.name}", debriefing=found, remarks=remarks)
        write_whole(report, page.encode())
    if as_json:
        told = debriefing_as_dict(found) | {
            "wind": None,
            "parameters": other_parameters(record, result),
        }
        if calibrate:
            told["calibrated"] = [asdict(each) for each in calibrated]
        wind = record.mean_wind(found.start, solution.plan.flight.duration)
        told["wind"] = None if wind is None else wind.tolist()
        typer.echo(json.dumps(told, allow_nan=False))
    else:
        typer.echo(joined([*debriefing_lines(found), *remarks]))
    if to is not None:
        flight = record.line(solution)
        lines = replayed(solution, Line(flight.t - found.start, flight.w))
        note(f"{replay(lines, to.send)} slots were told to {radio}")


def _calibrated(
    record: "FlightRecord", found: "Debriefing", result: "Result"
) -> "list[Calibrated]":
    """Return which parameters would have predicted the flight better."""
    from faao_mav.errors import FaaoError
    from faao_mav.validate.calibrate import calibrate
    from faao_mav.validate.flown import Line

    if result.conversion is None:
        raise FaaoError(f"--calibrate: the plan has no mission: {result.no_mission}")
    flight = record.line(found.solution)
    wind = record.mean_wind(found.start, found.solution.plan.flight.duration)
    air = found.solution.plan.wind if wind is None else (float(wind[0]), float(wind[1]))
    moved = Line(flight.t - found.start, flight.w)
    return calibrate(found.solution, result.conversion, moved, air)


def _calibration_lines(calibrated: "list[Calibrated]") -> "Iterator[Line]":
    if not calibrated:
        yield "calibrated", "no parameter alone predicts the flight better by a tenth"
    for each in calibrated:
        change = f"{each.name} {each.better:g} instead of {each.value:g}"
        text = f"{each.rms_better:.2f} m rms from the flight instead of {each.rms:.2f}"
        yield "calibrated", f"{change}: the prediction is {text}"
