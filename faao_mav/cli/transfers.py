"""`faao-mission upload` and `download`: a mission to a vehicle, verified, and what one holds."""

import sys
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

import faao_mav.cli.shared as cli

if TYPE_CHECKING:
    from faao_mav.mission.item import Mission
    from faao_mav.wire.jobs import UploadReport


@cli.with_link
def upload(
    mission_file: Path = typer.Argument(metavar="MISSION", help="The mission file."),
    to: str = cli.option("CONNECTION", cli.VEHICLE, default=...),
    parameters: cli.File = cli.option(
        "FILE", "Set the parameters that MISSION is timed for, first, and read them back."
    ),
    clear_rest: bool = cli.flag(
        "--clear-rest", "Clear a fence and rally points that MISSION does not have."
    ),
    as_json: bool = cli.AS_JSON,
    allow_armed: bool = cli.ALLOW_ARMED,
    *,
    link: dict[str, Any],
) -> None:
    """Upload a mission, read it back and compare.

    It says how far the vehicle stands from the mission's home, and how much higher or lower. A
    mission for another autopilot or type of vehicle is not uploaded. --parameters sets what shapes
    how a mission is flown, and nothing that decides about failsafes, fence, return or checks.

    Exit status: 0 it is on the vehicle, whole and equal; 1 it is not, or that is not known; 2
    unusable arguments or input.
    """
    from faao_mav.autopilot.files import made_for
    from faao_mav.mission.formats.parameter_file import read_parameters
    from faao_mav.wire.parameters import check_settable

    file = cli.read_noted(mission_file)
    values = None if parameters is None else read_parameters(parameters)
    check_settable(values or (), parameters)
    report = send(
        file.mission,
        to,
        shown=sys.stderr.isatty() and not as_json,
        allow_armed=allow_armed,
        made_for=made_for(mission_file, file),
        parameters=values,
        clear_rest=clear_rest,
        **link,
    )
    cli.show(lambda: as_dict(report), lambda: [str(report)], as_json=as_json)
    if not report.verified:
        raise typer.Exit(1)


def send(mission: "Mission", to: str, *, shown: bool, **options: Any) -> "UploadReport":
    """Upload a mission and verify it, with progress where that is `shown`; see `upload` there."""
    from faao_mav.wire.client import upload as run

    with cli.progress(shown=shown) as observe:
        report = run(mission, to, observe=observe, **options)
    if not report.verified:
        cli.note("the mission is not verified; do not fly it")
    return report


def as_dict(report: "UploadReport") -> dict[str, Any]:
    """Return `report` as JSON takes it."""
    vehicle, stands = report.vehicle, report.stands
    lists = [
        {
            "list": part.part.name.lower(),
            **_fields(part, "part", "said"),
            "differences": [_fields(each, "part") for each in part.differences],
        }
        for part in report.parts
    ]
    return {
        "verified": report.verified,
        "vehicle": {
            "system": vehicle.address.system,
            "component": vehicle.address.component,
            "autopilot": vehicle.autopilot,
            "type": vehicle.kind,
        },
        "stands": stands and _fields(stands) | {"is_meant": stands.is_meant},
        "parameters": [_fields(each) for each in report.changes],
        "seconds": round(report.seconds, 3),
        "problems": list(report.problems),
        "lists": lists,
    }


def _fields(record: Any, *but: str) -> dict[str, Any]:
    """Return the fields of `record` as JSON takes them, `but` some."""
    return {name: _plain(value) for name, value in asdict(record).items() if name not in but}


def _plain(value: Any) -> Any:
    """Return `value` as JSON takes it: NaN, which JSON does not have, is None."""
    if isinstance(value, tuple):
        return [_plain(each) for each in value]
    return None if value != value else value


@cli.with_link
def download(
    source: str = cli.option("CONNECTION", cli.VEHICLE, "--from", default=...),
    out: Path = cli.option("MISSION", "Write the mission.", default=...),
    *,
    link: dict[str, Any],
) -> None:
    """Download the mission, fence and rally points of a vehicle.

    A fence or rally points that do not come are told, and the rest is written.

    Exit status: 0 done; 1 there is no such vehicle, or a list did not come whole; 2 unusable
    arguments.
    """
    from faao_mav.autopilot import Vehicle
    from faao_mav.autopilot.files import plan_target
    from faao_mav.mission.formats import check_suffix
    from faao_mav.wire.client import holdings

    check_suffix(out)
    cli.check_outputs({"--out": out}, {})
    with cli.progress(shown=sys.stderr.isatty()) as observe:
        held = holdings(source, observe=observe, **link)
    found, mission = held.vehicle, held.mission
    target = plan_target(Vehicle(found.autopilot, found.kind)) if found.vehicle else None
    written = cli.write_noted(mission, out, target)
    told = {
        "fence": f"{len(mission.fence.areas)} fence areas",
        "rally points": f"{len(mission.rally)} rally points",
    }
    told |= {part: f"{part} not read" for part in mission.unread}
    typer.echo(f"vehicle      {found}")
    typer.echo(f"mission      {len(mission.items)} items, {', '.join(told.values())}")
    for path in written.contents:
        typer.echo(f"written      {path}")
    for problem in held.problems:
        cli.note(problem)
    if held.problems:
        raise typer.Exit(1)
