"""`faao-mission download`: what a vehicle holds, to a mission file."""

import sys
from pathlib import Path
from typing import Annotated

import typer

from faao_mav.cli.shared import (
    VEHICLE,
    Component,
    Log,
    OwnSystem,
    SigningKey,
    System,
    Wait,
    exit_status,
    note,
    option,
)


@exit_status()
def download(
    source: Annotated[str, option("CONNECTION", VEHICLE, "--from")],
    out: Annotated[Path, option("MISSION", "Write the mission.")],
    system: System = None,
    component: Component = None,
    own_system: OwnSystem = None,
    log: Log = None,
    timeout: Wait = 10.0,
    signing_key: SigningKey = None,
) -> None:
    """Download the mission, fence and rally points of a vehicle.

    A fence or rally points that do not come are told, and the rest is written.

    Exit status: 0 done; 1 there is no such vehicle, or a list did not come whole; 2 unusable
    arguments.
    """
    from faao_mav.autopilot import Vehicle
    from faao_mav.autopilot.files import plan_target
    from faao_mav.cli.progress import transfer_progress
    from faao_mav.files import check_writable
    from faao_mav.mission.formats import check_suffix, write_mission
    from faao_mav.wire.client import holdings

    check_suffix(out)
    check_writable(out)
    with transfer_progress(shown=sys.stderr.isatty()) as observe:
        held = holdings(
            source,
            system=system,
            component=component,
            own_system=own_system,
            log=log,
            signing_key=signing_key,
            wait=timeout,
            observe=observe,
            note=note,
        )
    found, mission = held.vehicle, held.mission
    target = plan_target(Vehicle(found.autopilot, found.kind)) if found.vehicle else None
    written = write_mission(mission, out, target)
    for line in written.lost:
        note(f"{out}: {line}")
    areas = len(mission.fence.polygons) + len(mission.fence.circles)
    told = {"fence": f"{areas} fence areas", "rally points": f"{len(mission.rally)} rally points"}
    told |= {part: f"{part} not read" for part in mission.unread}
    typer.echo(f"vehicle      {found}")
    typer.echo(f"mission      {len(mission.items)} items, {', '.join(told.values())}")
    for path in written.contents:
        typer.echo(f"written      {path}")
    for problem in held.problems:
        note(problem)
    if held.problems:
        raise typer.Exit(1)
