"""`faao-mission debrief`: what became of a plan in a real flight, from its log."""

from pathlib import Path
from typing import Annotated

import typer

from faao_mav.cli.planned import PlanFile, SolutionFile, planned
from faao_mav.cli.shared import (
    AsJson,
    File,
    Radio,
    System,
    check_page,
    exit_status,
    note,
    option,
    show,
)
from faao_mav.errors import InputError
from faao_mav.files import write_whole


@exit_status()
def debrief(
    log: Annotated[Path, typer.Argument(metavar="LOG", help="The log: .bin, .tlog or .ulg.")],
    plan_file: PlanFile = None,
    solution_file: SolutionFile = None,
    system: System = None,
    report: Annotated[File, option("PAGE.html", "One page with all three tracks.")] = None,
    radio: Radio = None,
    as_json: AsJson = False,
) -> None:
    """Say what became of a plan, from the log of its flight.

    Finds the relay flight in the log of an ArduPilot (.bin), a PX4 (.ulg, with pyulog) or a ground
    station (.tlog), and tells how late it was, how far from plan and path, and what each hop
    carried along the real track with the planned precoders, beside what was planned and predicted.
    Of several vehicles in a .tlog it is the one whose flight is the plan's, or that of --system.
    --radio replays the flight to radios, at the pace at which it was flown.

    Exit status: 0 told; 1 the plan's flight is not in the log; 2 unusable arguments or input.
    """
    if plan_file is None and solution_file is None:
        raise InputError("--plan or --solution: give the plan that was flown")
    check_page(report, {"LOG": log, "--plan": plan_file, "--solution": solution_file})
    from faao_mav.fly.logs import read_log
    from faao_mav.fly.radio import Radios
    from faao_mav.report.debrief import FromLog
    from faao_mav.report.summary import joined
    from faao_mav.workflow import Result, with_mission

    records = read_log(log, system)
    solution = planned(plan_file, solution_file)
    assert solution is not None
    radios = None if radio is None else Radios(solution, radio)
    told = FromLog.of(records, with_mission(Result(solution)), str(log))
    if report is not None:
        from faao_mav.report.page import render_report

        page = render_report(told, title=log.name)
        write_whole(report, page.encode())
    show(told.as_dict, lambda: [joined(told.lines())], as_json=as_json)
    if radios is not None:
        count = radios.replay(told.record.line(solution, told.found.start))
        note(f"{count} slots were told to {radio}")
