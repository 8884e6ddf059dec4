"""`faao-mission debrief`: what became of a plan in a real flight, from its log."""

from pathlib import Path
from typing import Annotated

import typer

from faao_mav.cli.planned import PlanFile, SolutionFile, check_one, planned
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
    check_one(plan_file, solution_file)
    if plan_file is None and solution_file is None:
        raise InputError("--plan or --solution: give the plan that was flown")
    check_page(report, {"LOG": log, "--plan": plan_file, "--solution": solution_file})
    from faao_mav.fly.logs import read_log
    from faao_mav.fly.radio import Radios
    from faao_mav.report.debrief import debriefed, other_parameters, remarks_on
    from faao_mav.report.flights import debriefing_lines
    from faao_mav.report.lines import joined
    from faao_mav.validate.flown import Line
    from faao_mav.workflow import Result, debriefing_as_dict, with_mission

    records = read_log(log, system)
    solution = planned(plan_file, solution_file)
    assert solution is not None
    radios = None if radio is None else Radios(solution, radio)
    result = with_mission(Result(solution))
    record, found = debriefed(records, result, str(log))
    remarks = list(remarks_on(records, record, found, result))
    if report is not None:
        from faao_mav.report.page import render_report

        page = render_report(result, title=f"{log.name}", debriefing=found, remarks=remarks)
        write_whole(report, page.encode())
    wind = record.mean_wind(found.start, solution.plan.flight.duration)
    own = {
        "wind": None if wind is None else wind.tolist(),
        "parameters": other_parameters(record, result),
        "system": record.system,
    }
    show(
        lambda: debriefing_as_dict(found) | own,
        lambda: [joined([*debriefing_lines(found), *remarks])],
        as_json=as_json,
    )
    if radios is not None:
        flight = record.line(solution)
        count = radios.replay(Line(flight.t - found.start, flight.w))
        note(f"{count} slots were told to {radio}")
