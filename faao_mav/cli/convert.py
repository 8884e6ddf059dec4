"""`faao-mission convert MISSION --out OTHER`: from one mission format to another."""

import json
from pathlib import Path
from typing import Annotated, Literal

import typer

from faao_mav.cli.outcome import exit_status, note
from faao_mav.files import check_apart, check_writable, write_whole

Autopilot = Literal["ardupilot", "px4"]


def convert(
    mission_file: Annotated[
        Path,
        typer.Argument(metavar="MISSION", help="The mission: .waypoints, .txt or .plan."),
    ],
    out: Annotated[
        Path,
        typer.Option(metavar="OTHER", help="What to write: .waypoints, .txt, .plan or .kml."),
    ],
    autopilot: Annotated[
        Autopilot | None,
        typer.Option(help="Whom a .plan is for; else whom the mission read says it is for."),
    ] = None,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print one JSON object instead of the summary.")
    ] = False,
) -> None:
    """Write a mission in another format, and say what that cannot hold.

    Exit status: 0 done; 2 unusable arguments or input.
    """
    with exit_status():
        _run(mission_file, out, autopilot, as_json)


def _run(mission_file: Path, out: Path, autopilot: Autopilot | None, as_json: bool) -> None:
    from faao_mav.mission.formats import (
        check_readable,
        check_suffix,
        losses_in,
        read_mission_file,
        render_mission,
    )
    from faao_mav.vehicle import Vehicle

    check_readable(mission_file)
    check_suffix(out)
    check_writable(out)
    check_apart({"--out": out}, {"MISSION": mission_file})
    read = read_mission_file(mission_file)
    whose = autopilot or read.autopilot
    vehicle = Vehicle(whose, read.kind or "copter") if whose else None
    lost = losses_in(read.mission, out, vehicle)
    write_whole(out, render_mission(read.mission, out, vehicle).encode())
    for line in lost:
        note(f"{out}: {line}")
    items = len(read.mission.items)
    if as_json:
        typer.echo(json.dumps({"items": items, "lost": lost, "written": str(out)}))
    else:
        typer.echo(f"{items} items written to {out}")
