"""What real autopilots make of missions.

    FAAO_AUTOPILOTS=FOLDER python tests/real_autopilots/record_verdicts.py [NAME ...]

Each mission in `tests/data/verdicts/`, where each vehicle has a file, is uploaded to a simulated
autopilot and, if it is accepted, flown; what became of it is written there. A new one is added by
hand, as its parameters, its items (how often, command, frame, param1 to param4, x, y, z,
autocontinue; null is NaN) and perhaps the corners of a fence to stay in. Without names, VEHICLE or
VEHICLE/NAME, those missions are flown that have no verdict. PX4's runner uploads no fence: of its
missions with one, verdicts stay as they were recorded.

A mission has taken off and come to its end (`flown`), or not:
`refused` on upload; `rejected` by PX4 after it has acknowledged the upload; `not armed`;
`not started`; `on the ground`: armed, and never higher than a metre; `crashed`: came down on the
way to a waypoint; `stuck`: in the air, and not at the last item, when the watch ended; `ended
early`: before the last item.
"""

import csv
import json
import math
import os
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any, TypeAlias

DATA = Path(__file__).parents[1] / "data" / "verdicts"
HOME = (-35.363262, 149.165237, 584.0)
SPEEDUP = {"arducopter": 30, "arduplane": 30, "px4": 13}
"""Times real time: those that README of the autopilots calls reliable."""

WATCH = {"arducopter": 240, "arduplane": 300, "px4": 200}
"""Simulated seconds after arming in which a mission here should be over."""

INSTANCE = 70
"""PX4's instance number, which its ports follow."""

OFF_THE_GROUND = 1.0
"""The height, m above home, that an aircraft reaches that has taken off."""

TOUCH = 0.3
"""The height, m above home, below which an aircraft is down: its estimate is no better."""

LEAP = 5.0
"""Metres that no aircraft climbs or falls in a tenth of a second."""

TAKEOFFS = {22, 84}
TO_GROUND = {20, 21, 85, 94}
"""Return, landings, and placing a payload."""

ROUTINE = ("Skipping INS", "Throttle failsafe off", "EKF", "PreArm: Fence enabled, need position")
"""How texts begin that every start brings."""

Row: TypeAlias = list[Any]
"""Command, frame, param1 to param4, x, y, z, autocontinue; NaN is null in the files."""


def waypoints(items: Sequence[Row]) -> str:
    """Return the mission as the runners read it."""
    rows: list[Row] = [[16, 0, 0, 0, 0, 0, *HOME, 1], *items]
    lines = ["QGC WPL 110"]
    for n, row in enumerate(rows):
        values = ["nan" if value is None else f"{value:.10g}" for value in row]
        lines.append("\t".join([str(n), str(int(n == 0)), values[1], values[0], *values[2:]]))
    return "\n".join(lines) + "\n"


def run(folder: Path, vehicle: str, mission: dict[str, Any]) -> dict[str, Any]:
    """Fly `mission` and return what became of it; again where the simulator did not start."""
    items = unpacked(mission["items"])
    commands = [row[0] for row in items]
    with tempfile.TemporaryDirectory() as work:
        file, track, summary = (Path(work, name) for name in ("m.waypoints", "t.csv", "s.json"))
        file.write_text(waypoints(items))
        given = ",".join(f"{name}={value}" for name, value in mission["parameters"].items())
        runner = "fly_px4.py" if vehicle == "px4" else "fly_arducopter.py"
        command = [str(folder / runner), str(file), "--out", str(track), "--json", str(summary)]
        command += ["--speedup", str(SPEEDUP[vehicle]), "--max-sim-time", str(WATCH[vehicle])]
        command += ["--params", given]
        if vehicle == "px4":
            command += ["--instance", str(INSTANCE)]
        else:
            command += ["--tail", "15", "--on-ground", "--vehicle", vehicle.removeprefix("ardu")]
            if "fence" in mission:
                polygons = {"polygons": [{"polygon": mission["fence"], "inclusion": True}]}
                plan = Path(work, "fence.plan")
                plan.write_text(json.dumps({"geoFence": polygons}))
                command += ["--extras", str(plan)]
        for _ in range(3):
            track.unlink(missing_ok=True)
            done = subprocess.run([sys.executable, *command], capture_output=True, text=True)
            ran = done.returncode != 3
            found = json.loads(summary.read_text()) if summary.exists() else {}
            if settled(found) or (ran and "ended_by" in found):
                return became(found, commands, read_track(track) if ran else [])
        raise SystemExit(f"{vehicle}: not flown\n{done.stdout[-3000:]}\n{done.stderr[-3000:]}")


def settled(summary: dict[str, Any]) -> bool:
    """Tell whether the autopilot has said no before the flight."""
    refused = summary.get("ack", "MAV_MISSION_ACCEPTED") != "MAV_MISSION_ACCEPTED"
    later = "ack" in summary and (summary.get("infeasible") or "why_not" in summary)
    return refused or bool(later)


def read_track(track: Path) -> list[tuple[float, int]]:
    """Return height, m above the start, and the number of the item under way, ten times a second.

    Heights are recorded above home: one that leaps is home that moves.
    """
    if not track.exists():
        return []
    with track.open() as file:
        rows = [(float(row["alt_rel_m"]), int(row["seq"])) for row in csv.DictReader(file)]
    found, raised, before = [], 0.0, 0.0
    for height, item in rows:
        raised += before - height if abs(before - height) > LEAP else 0.0
        found.append((height + raised, item))
        before = height
    return found


def became(
    summary: dict[str, Any], commands: Sequence[int], track: Sequence[tuple[float, int]]
) -> dict[str, Any]:
    """Return the verdict on a mission of `commands` by what its runner says."""
    answer = summary["ack"].removeprefix("MAV_MISSION_")
    shift = 0 if "vehicle" in summary else 1  # PX4 has no home row
    said = [text for _, severity, text in summary["texts"] if severity <= 4]
    said += [text for _, severity, _, text in summary.get("all_events", ()) if severity <= 4]
    said = [text for text in dict.fromkeys(said) if not text.startswith(ROUTINE)]
    found: dict[str, Any] = {"verdict": "", "answer": answer, "said": said}
    if answer != "ACCEPTED":
        if (refused := summary.get("rejected_item")) is not None:
            found["item"] = refused + shift
        return found | {"verdict": "refused"}
    if summary.get("infeasible"):
        return found | {"verdict": "rejected", "said": summary["infeasible"]}
    if "why_not" in summary:
        what, _, why = summary["why_not"].partition(": ")
        verdict = "not started" if what.startswith("AUTO") else "not armed"
        refusals = [text for text in why.split("; ") if not text.startswith(ROUTINE)]
        return found | {"verdict": verdict, "said": list(dict.fromkeys(refusals))}
    track = [(height, item + shift) for height, item in track]
    turns = [(round(t, 1), item + shift) for t, item in summary["current_changes"]]
    reached = [item + shift for _, item in summary["reached"]]
    heights, end = [height for height, _ in track] or [0.0], summary["ended_by"]
    # At the moment at which it disarms it turns to the next item, too.
    count = summary["sim_end_s"] - 2 if end == "disarmed" else math.inf
    last = max((k for k, each in enumerate(commands, start=1) if each <= 95), default=0)
    if max(heights) < OFF_THE_GROUND:
        verdict = "on the ground"
    elif hit_ground(commands, track):
        verdict = "crashed"
    elif end.startswith("gave up"):
        verdict = "stuck"
    elif max([*reached, *(item for moment, item in turns if moment < count)], default=0) < last:
        verdict = "ended early"
    else:
        verdict = "flown"
    return found | {
        "verdict": verdict,
        "end": end,
        "reached": reached,
        "highest": round(max(heights), 1),
        "lowest": round(min(heights), 1),
        "seconds": round(summary["duration_sim_s"]),
    }


def hit_ground(commands: Sequence[int], track: Sequence[tuple[float, int]]) -> bool:
    """Tell whether it came down where no item so far is to do with the ground."""
    flying = False
    for height, item in track:
        flying = flying or height > OFF_THE_GROUND
        way = commands[:item]
        if flying and height < TOUCH and way[-1] not in TAKEOFFS and not TO_GROUND & {*way}:
            return True
    return False


def unpacked(items: Sequence[Row]) -> list[Row]:
    """Return the rows, each as often as the number before it says."""
    return [row for times, *row in items for _ in range(times)]


def write(vehicle: str, missions: dict[str, Any]) -> None:
    """Write `missions` with their verdicts, an item a line."""
    lines = []
    for name, mission in missions.items():
        head = json.dumps({key: mission[key] for key in mission if key != "items"})[:-1]
        items = ",\n".join(f"    {json.dumps(row)}" for row in mission["items"])
        lines.append(f'  {json.dumps(name)}: {head}, "items": [\n{items}\n  ]}}')
    (DATA / f"{vehicle}.json").write_text("{\n" + ",\n".join(lines) + "\n}\n")


def main() -> None:
    folder, chosen = Path(os.environ["FAAO_AUTOPILOTS"]), set(sys.argv[1:])
    for vehicle in SPEEDUP:
        missions = json.loads((DATA / f"{vehicle}.json").read_text())
        for name, mission in missions.items():
            asked = {vehicle, f"{vehicle}/{name}"} & chosen
            fenced = vehicle == "px4" and "fence" in mission
            if fenced or (not asked and (chosen or "verdict" in mission)):
                continue
            kept = {key: mission[key] for key in ("parameters", "fence", "items") if key in mission}
            missions[name] = became = kept | run(folder, vehicle, mission)
            print(vehicle, name, became["verdict"], became["said"], flush=True)
            write(vehicle, missions)


if __name__ == "__main__":
    main()
