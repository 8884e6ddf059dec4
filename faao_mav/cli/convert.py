"""`faao-mission convert MISSION --out OTHER`: from one mission format to another."""

import json
from pathlib import Path
from typing import Annotated

import typer

from faao_mav.cli.outcome import exit_status
from faao_mav.errors import InputError
from faao_mav.files import check_writable, write_whole


def convert(
    mission_file: Annotated[Path, typer.Argument(metavar="MISSION", help="The mission to read.")],
    out: Annotated[
        Path, typer.Option(metavar="OTHER", help="The mission to write; its ending is the format.")
    ],
    as_json: Annotated[
        bool, typer.Option("--json", help="Print one JSON object instead of the summary.")
    ] = False,
) -> None:
    """Write a mission in another format.

    Exit status: 0 done; 2 unusable arguments or input.
    """
    with exit_status():
        _run(mission_file, out, as_json)


def _run(mission_file: Path, out: Path, as_json: bool) -> None:
    from faao_mav.mission.formats import check_suffix, read_mission, render_mission

    check_suffix(out)
    check_writable(out)
    if out.exists() and mission_file.exists() and out.samefile(mission_file):
        raise InputError(f"--out {out}: is the file to convert; give another name")
    mission = read_mission(mission_file)
    write_whole(out, render_mission(mission, out).encode())
    if as_json:
        typer.echo(json.dumps({"items": len(mission.items), "written": str(out)}))
    else:
        typer.echo(f"{len(mission.items)} items written to {out}")
