"""`faao-mission convert MISSION --out OTHER`: from one mission format to another."""

from pathlib import Path
from typing import Annotated

import typer

from faao_mav.cli.shared import (
    AsJson,
    Whose,
    check_known,
    exit_status,
    note,
    option,
    read_noted,
    show,
)
from faao_mav.files import check_apart, check_writable


@exit_status()
def convert(
    mission_file: Annotated[
        Path, typer.Argument(metavar="MISSION", help="The mission: .waypoints, .txt or .plan.")
    ],
    out: Annotated[Path, option("OTHER", "What to write: .waypoints, .txt, .plan or .kml.")],
    autopilot: Whose = None,
    as_json: AsJson = False,
) -> None:
    """Write a mission in another format, and say what that cannot hold.

    The fence of a .waypoints or .txt file is a second file, M.fence.waypoints of M.waypoints.

    Without --autopilot a .plan is for whom the mission that is read, or the parameters beside it,
    say it is for.

    Exit status: 0 done; 2 unusable arguments or input.
    """
    from faao_mav.autopilot import Vehicle, kind_by_number
    from faao_mav.autopilot.files import plan_target
    from faao_mav.cli.vehicle import told_vehicle
    from faao_mav.mission.formats import check_readable, check_suffix, write_mission

    check_known(autopilot, None)
    check_readable(mission_file)
    check_suffix(out)
    check_writable(out)
    check_apart({"--out": out}, {"MISSION": mission_file})
    read = read_noted(mission_file)
    kind = kind_by_number(read.vehicle_type) or "copter"
    told = told_vehicle(mission_file, read, None, None, (autopilot, None, None))
    vehicle = Vehicle(autopilot, kind) if autopilot else told[0] if told is not None else None
    target = plan_target(vehicle)
    written = write_mission(read.mission, out, target)
    for line in written.lost:
        note(f"{out}: {line}")
    items, names = len(read.mission.items), " and ".join(map(str, written.contents))
    show(
        lambda: {"items": items, "lost": written.lost, "written": str(out)},
        lambda: [f"{items} items written to {names}"],
        as_json=as_json,
    )
