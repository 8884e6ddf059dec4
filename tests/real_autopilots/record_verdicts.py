"""What real autopilots make of missions.

    FAAO_AUTOPILOTS=FOLDER python tests/real_autopilots/record_verdicts.py [--seconds S] [NAME ...]

Each mission of `MISSIONS` is uploaded to a simulated autopilot and, if it is accepted, flown. What
became of it is written to `tests/data/verdicts/`, one file for each vehicle; the missions there are
whole, so the tests need no autopilot. Without names those missions are flown that have no verdict
yet, and those that have changed since; `--seconds` ends the work in time, to be taken up again.

A mission has taken off and come to its end (`flown`), or not:
`refused` on upload; `rejected` by PX4 after it has acknowledged the upload; `not armed`;
`not started`; `on the ground`: armed, and never higher than a metre; `crashed`: came down on the
way to a waypoint; `stuck`: in the air, and not at the last item, when the watch ended; `ended
early`: before the last item.
"""

import argparse
import csv
import importlib.util
import json
import math
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeAlias

from faao_mav.geodesy import LocalFrame

DATA = Path(__file__).parents[1] / "data" / "verdicts"
HOME = (-35.363262, 149.165237, 584.0)
FRAME = LocalFrame(*HOME[:2])

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


def place(
    command: int,
    east: float,
    north: float,
    up: float | None,
    *params: float | None,
    frame: int = 3,
    autocontinue: int = 1,
) -> Row:
    """Return an item at a place, m from home."""
    latitude, longitude = (round(float(v), 7) for v in FRAME.to_geodetic([east, north]))
    four = (*params, 0, 0, 0, 0)[:4]
    return [command, frame, *four, latitude, longitude, up, autocontinue]


def wp(east: float, north: float, up: float | None = 20, *params: float | None, **more: int) -> Row:
    return place(16, east, north, up, *params, **more)


def do(command: int, *params: float | None, frame: int = 2) -> Row:
    return [command, frame, *(*params, 0, 0, 0, 0)[:4], 0, 0, 0, 1]


def here(command: int, up: float) -> Row:
    """Return an item at latitude and longitude 0."""
    return [command, 3, 0, 0, 0, 0, 0, 0, up, 1]


def speed(value: float | None, kind: float = 1, frame: int = 2) -> Row:
    return do(178, kind, value, -1, frame=frame)


def takeoff(up: float | None = 20, east: float = 0, north: float = 0) -> Row:
    return place(22, east, north, up)


UP, RTL, LAND = takeoff(), do(20), place(21, 0, 0, 0)
A, B, C = wp(0, 40), wp(40, 40), wp(40, 0)


def spline(east: float, north: float) -> Row:
    return place(82, east, north, 20)


def flown(*items: Row) -> list[Row]:
    """Return take-off, `items`, return."""
    return [UP, *items, RTL]


def square(side: float, east: float = 0) -> list[list[float]]:
    """Return the corners of a fence to stay in."""
    h = side / 2
    corners = ((east - h, -h), (east + h, -h), (east + h, h), (east - h, h))
    return [[float(v) for v in FRAME.to_geodetic(corner)] for corner in corners]


def case(items: Sequence[Row], fence: Any = None, **parameters: float) -> dict[str, Any]:
    found: dict[str, Any] = {"parameters": parameters, "items": list(items)}
    return found | ({"fence": fence} if fence else {})


BOTH: dict[str, dict[str, Any]] = {
    "sound": case(flown(A, B)),
    "hold-and-speed": case(flown(speed(4), wp(0, 40, 20, 3), B)),
    "no-ending": case([UP, A, B]),
    "land-at-the-end": case([UP, A, place(21, 0, 40, 0)]),
    "takeoff-then-land": case([UP, LAND]),
    "no-takeoff": case([A, B, RTL]),
    "waypoint-before-takeoff": case([A, UP, B, RTL]),
    "speed-and-delay-before-takeoff": case([speed(5), do(93, 2, -1, -1, -1), UP, A, RTL]),
    "two-takeoffs": case([UP, A, takeoff(25), B, RTL]),
    "takeoff-height-0": case([takeoff(0), A, RTL]),
    "takeoff-height-1e-9": case([takeoff(1e-9), wp(0, 40, 1e-9), RTL]),
    "takeoff-below-home": case([takeoff(-5), A, RTL]),
    "takeoff-at-zero": case([here(22, 20), A, RTL]),
    "waypoint-at-zero": case(flown(A, here(16, 20))),
    "vtol-takeoff": case([place(84, 0, 0, 20), A, RTL]),
    "vtol-land": case([UP, A, place(85, 0, 40, 0)]),
    "starts-with-land": case([LAND, UP, A, RTL]),
    "only-do-items": case([speed(5), do(206, 0)]),
    "only-a-takeoff": case([UP]),
    "waypoint-20-m-below-home": case(flown(A, wp(0, 60, -20), B)),
    "waypoint-at-home-height": case(flown(A, wp(0, 60, 0), B)),
    "waypoint-2-m-up": case(flown(A, wp(0, 60, 2), B)),
    "height-1000-km": case(flown(wp(0, 40, 1e6), B)),
    "height-50-km": case(flown(wp(0, 40, 5e4), B)),
    "land-then-waypoint": case([UP, A, place(21, 0, 40, 0), B]),
    "land-then-waypoint-then-rtl": case([UP, A, place(21, 0, 40, 0), B, RTL]),
    "land-takeoff-waypoint-rtl": case([UP, A, place(21, 0, 40, 0), takeoff(20, 0, 40), B, RTL]),
    "rtl-then-waypoint": case([UP, A, RTL, B]),
    "loiter-for-ever-then-waypoint": case([UP, A, place(17, 40, 40, 20), C]),
    "loiter-time": case(flown(place(19, 0, 40, 20, 4))),
    "loiter-to-altitude": case(flown(place(31, 0, 40, 30, 0, 10))),
    "delay": case(flown(A, do(93, 4, -1, -1, -1), B)),
    "jump-to-itself": case(flown(A, do(177, 3, 3), B)),
    "jump-over-do-items": case(flown(A, speed(4), do(177, 3, 3), B)),
    "jump-over-do-items-once": case(flown(A, speed(4), do(177, 3, 1), B)),
    "jump-to-itself-for-ever": case(flown(A, do(177, 3, -1), B)),
    "jump-over-do-items-for-ever": case(flown(A, speed(4), do(177, 3, -1), B)),
    "jump-forward-for-ever": case(flown(A, do(177, 5, -1), speed(4), B)),
    "jump-twice": case(flown(A, B, do(177, 2, 2), C)),
    "jump-to-the-end": case(flown(A, do(177, 5, 1), B)),
    "jump-beyond-the-end": case(flown(A, do(177, 9, 1), B)),
    "jump-to-0": case(flown(A, do(177, 0, 1), B)),
    "speed-0": case(flown(speed(0), A)),
    "speed-minus-1": case(flown(speed(-1), A)),
    "climb-speed": case(flown(speed(2, 2), A)),
    "speed-in-frame-3": case(flown(speed(5, frame=3), A)),
    "rtl-in-frame-3": case([UP, A, do(20, frame=3)]),
    "waypoint-in-frame-2": case(flown([16, 2, 0, 0, 0, 0, *A[6:8], 604, 1])),
    "local-frame": case(flown(wp(0, 40, 20, frame=1))),
    "terrain-frame": case(flown(wp(0, 40, 20, frame=10))),
    "above-sea-level": case(flown(wp(0, 40, 604, frame=0), wp(40, 40, 604, frame=5))),
    "unknown-command": case(flown([9999, 3, *A[2:]])),
    "fence-row": case(flown(place(5001, 0, 40, 0, 3))),
    "nan-hold": case(flown(wp(0, 40, 20, None))),
    "nan-yaw": case(flown(wp(0, 40, 20, 0, 0, 0, None))),
    "nan-height": case(flown(wp(0, 40, None), B)),
    "latitude-95": case(flown([16, 3, 0, 0, 0, 0, 95, 149.0, 20, 1])),
    "condition-delay": case(flown(do(112, 3), A)),
    "condition-distance": case(flown(do(114, 10), A)),
    "condition-yaw": case(flown(do(115, 90, 10, 1, 0), A)),
    "spline": case(flown(spline(0, 40), spline(40, 40))),
    "same-place-twice": case(flown(A, A, B)),
    "autocontinue-off": case(flown(wp(0, 40, 20, autocontinue=0), B)),
    "guided-enable": case(flown(A, do(92, 1), B)),
    "set-home": case(flown(A, do(179, 1), B)),
    "set-home-before-takeoff": case([do(179, 1), UP, A, RTL]),
    "set-home-to-a-place": case(flown(A, place(179, 0, 0, 584, 0, frame=0), B)),
    "set-home-to-a-higher-place": case(flown(A, place(179, 0, 40, 594, 0, frame=0), B)),
    "roi-of-next-waypoint": case(flown(do(201, 1), A)),
    "land-start-on-the-way": case(flown(A, do(189), B)),
    "home-outside-fence": case([UP, wp(0, 20), RTL], square(100, 100)),
    "waypoint-outside-fence": case(flown(wp(0, 80), A), square(100)),
    "within-fence": case(flown(A, wp(-30, -30)), square(100)),
}
"""What is tried on both copters, by name."""

COPTER: dict[str, dict[str, Any]] = BOTH | {
    "home-outside-fence": case([UP, wp(0, 20), RTL], square(100, 100), FENCE_ENABLE=1),
    "waypoint-outside-fence": case(flown(wp(0, 80), A), square(100), FENCE_ENABLE=1),
    "within-fence": case(flown(A, wp(-30, -30)), square(100), FENCE_ENABLE=1),
    "above-fence-ceiling": case(flown(wp(0, 40, 35)), FENCE_ENABLE=1, FENCE_ALT_MAX=25),
    "beyond-fence-circle": case(flown(wp(0, 80)), FENCE_ENABLE=1, FENCE_RADIUS=50),
    "terrain-frame-terrain-off": case(flown(wp(0, 40, 20, frame=10)), TERRAIN_ENABLE=0),
    "landing-required": case(flown(A), ARMING_MIS_ITEMS=1),
    "rally-required": case(flown(A), ARMING_MIS_ITEMS=32),
    "spline-is-last": case([UP, A, spline(0, 80), spline(40, 80)]),
    "one-spline-is-last": case([UP, A, spline(40, 40)]),
    "spline-then-do-item-last": case([UP, A, spline(40, 40), speed(5)]),
    "spline-after-takeoff-is-last": case([UP, spline(0, 40)]),
    "land-takeoff-and-MIS_OPTIONS": case(
        [UP, A, place(21, 0, 40, 0), takeoff(20, 0, 40), B, RTL], MIS_OPTIONS=4
    ),
    "land-waypoint-and-MIS_OPTIONS": case([UP, A, place(21, 0, 40, 0), B, RTL], MIS_OPTIONS=4),
    "rtl-waypoint-and-MIS_OPTIONS": case([UP, A, RTL, B], MIS_OPTIONS=4),
    "spline-before-rtl": case([UP, A, spline(40, 40), RTL]),
    "spline-before-land": case([UP, A, spline(40, 40), place(21, 40, 40, 0)]),
    "spline-before-loiter": case([UP, A, spline(40, 40), place(19, 40, 0, 20, 3), RTL]),
    "delay-after-spline": case(flown(spline(0, 40), do(93, 3, -1, -1, -1), A)),
    "guided-enable-last": case([UP, A, do(92, 1)]),
    "payload-place": case(flown(place(94, 0, 40, 0, 5))),
    "script-time": case(flown(A, do(42702, 1, 10), B)),
    "attitude-time": case(flown(A, do(42703, 3, 0, 0, 0), B)),
    "turns": case(flown(place(18, 0, 40, 20, 1, 0, 10))),
    "continue-and-change-altitude": case(flown(place(30, 0, 40, 25), A)),
    "altitude-wait": case(flown(do(83, 10, 1), A)),
    "parachute": case(flown(A, do(208, 1), B)),
    "land-start-then-land": case([UP, A, do(189), B, place(21, 40, 40, 0)]),
    "700-items": case([UP, *[A] * 700, RTL]),
    "height-83-km": case(flown(wp(0, 40, 83_001), B)),
    "hover-at-half-a-metre": case([takeoff(0.5), wp(0, 40, 0.5), RTL]),
}

FAR, NORTH, EAST = wp(0, 400, 60), wp(400, 400, 60), wp(400, 0, 60)
PLANE_UP = place(22, 0, 100, 60, 15)
PLANE_LAND = place(21, 0, 0, 0)


def circuit(*items: Row) -> list[Row]:
    return [PLANE_UP, *items, RTL]


PLANE: dict[str, dict[str, Any]] = {
    "sound": case(circuit(FAR, NORTH)),
    "no-ending": case([PLANE_UP, FAR, NORTH]),
    "no-takeoff": case([FAR, NORTH, RTL]),
    "vtol-takeoff": case([place(84, 0, 100, 60), FAR, NORTH, RTL]),
    "waypoint-before-takeoff": case([FAR, PLANE_UP, NORTH, RTL]),
    "takeoff-height-0": case([place(22, 0, 100, 0, 15), FAR, RTL]),
    "takeoff-at-zero": case([here(22, 60), FAR, RTL]),
    "takeoff-then-land": case([PLANE_UP, place(21, 0, 800, 0)]),
    "takeoff-then-land-at-home": case([PLANE_UP, PLANE_LAND]),
    "landing": case([PLANE_UP, NORTH, wp(0, 700, 40), wp(0, 350, 20), PLANE_LAND]),
    "landing-then-waypoint": case(
        [PLANE_UP, NORTH, wp(0, 700, 40), wp(0, 350, 20), PLANE_LAND, FAR, RTL]
    ),
    "land-start-rtl-autoland-0": case(
        [PLANE_UP, NORTH, do(189), wp(0, 700, 40), wp(0, 350, 20), PLANE_LAND], RTL_AUTOLAND=0
    ),
    "land-start-rtl-autoland-2": case(
        [PLANE_UP, NORTH, do(189), wp(0, 700, 40), wp(0, 350, 20), PLANE_LAND], RTL_AUTOLAND=2
    ),
    "land-start-rtl-autoland-3": case(
        [PLANE_UP, NORTH, do(189), wp(0, 700, 40), wp(0, 350, 20), PLANE_LAND], RTL_AUTOLAND=3
    ),
    "delay": case(circuit(FAR, do(93, 20, -1, -1, -1), NORTH)),
    "delay-first": case([do(93, 5, -1, -1, -1), PLANE_UP, FAR, RTL]),
    "guided-enable": case(circuit(FAR, do(92, 1), NORTH)),
    "spline": case(circuit(FAR, place(82, 400, 400, 60))),
    "only-do-items": case([speed(15, 0), do(206, 0)]),
    "only-a-takeoff": case([PLANE_UP]),
    "waypoint-20-m-below-home": case(circuit(FAR, wp(0, 900, -20), NORTH)),
    "jump-over-do-items": case(circuit(FAR, speed(15, 0), do(177, 3, 3), NORTH)),
    "jump-to-itself": case(circuit(FAR, do(177, 3, 3), NORTH)),
    "rtl-then-waypoint": case([PLANE_UP, FAR, RTL, NORTH]),
    "loiter-for-ever-then-waypoint": case([PLANE_UP, FAR, place(17, 400, 400, 60), EAST]),
    "vtol-land": case([PLANE_UP, FAR, place(85, 400, 400, 0)]),
    "landing-then-takeoff": case(
        [PLANE_UP, wp(0, 700, 40), wp(0, 350, 20), PLANE_LAND, PLANE_UP, FAR, RTL]
    ),
    "starts-with-land": case([PLANE_LAND, PLANE_UP, FAR, RTL]),
    "terrain-frame": case(circuit(wp(0, 400, 60, frame=10))),
    "condition-yaw": case(circuit(do(115, 90, 10, 1, 0), FAR)),
    "landing-required": case(circuit(FAR), ARMING_MIS_ITEMS=1),
    "nan-height": case(circuit(wp(0, 400, None))),
    "turns": case(circuit(place(18, 0, 400, 60, 1, 0, 60))),
    "loiter-time": case(circuit(place(19, 0, 400, 60, 10))),
    "hold": case(circuit(wp(0, 400, 60, 20), NORTH)),
    "home-outside-fence": case(circuit(FAR), square(200, 400), FENCE_ENABLE=1),
    "too-slow": case(circuit(speed(5, 0), FAR, NORTH)),
    "vtol-transition": case(circuit(FAR, do(3000, 4), NORTH)),
}

GATE = 4501
PX4: dict[str, dict[str, Any]] = BOTH | {
    "gate-at-its-neighbour": case(flown(A, place(GATE, 0, 40, 20), B)),
    "gate-on-the-way": case(flown(A, place(GATE, 20, 40, 20), B)),
    "gate-first": case([place(GATE, 0, 0, 20), UP, A, RTL]),
    "10001-items": case([UP, *[A] * 10_000]),
    "loiter-turns": case(flown(place(18, 0, 40, 20, 1, 0, 10))),
    "takeoff-required": case([A, RTL], MIS_TKO_LAND_REQ=1),
    "landing-required": case(flown(A), MIS_TKO_LAND_REQ=2),
    "both-required": case(flown(A), MIS_TKO_LAND_REQ=3),
    "both-or-none-required": case(flown(A), MIS_TKO_LAND_REQ=4),
    "beyond-GF_MAX_HOR_DIST": case(flown(wp(0, 80)), GF_MAX_HOR_DIST=50),
    "beyond-GF_MAX_VER_DIST": case(flown(wp(0, 40, 30)), GF_MAX_VER_DIST=25),
    "first-waypoint-beyond-MIS_DIST_1WP": case([wp(0, 80), A, RTL], MIS_DIST_1WP=50),
    "vtol-transition": case(flown(A, do(3000, 4), B)),
    "takeoff-half-a-metre": case([takeoff(0.5), A, RTL]),
    "takeoff-elsewhere": case([takeoff(20, 0, 40), B, RTL]),
    "roi-in-frame-2": case(flown(do(201, 3), A)),
    "actuator-before-takeoff": case([do(187), UP, A, RTL]),
    "delay-in-frame-3": case(flown(A, do(93, 3, frame=3), B)),
    "waypoint-half-a-metre-up": case(flown(A, wp(0, 60, 0.5), B)),
    "waypoint-5-m-below-home": case(flown(A, wp(0, 60, -5), B)),
    "only-a-delay": case([do(93, 3)]),
    "only-a-return": case([RTL]),
    "climb-speed-3-m/s": case(flown(speed(3, 2), A)),
}

MISSIONS = {"arducopter": COPTER, "arduplane": PLANE, "px4": PX4}


def waypoints(items: Sequence[Row]) -> str:
    """Return the mission as the runners read it."""
    rows: list[Row] = [[16, 0, 0, 0, 0, 0, *HOME, 1], *items]
    lines = ["QGC WPL 110"]
    for n, row in enumerate(rows):
        values = ["nan" if value is None else f"{value:.10g}" for value in row]
        lines.append("\t".join([str(n), str(int(n == 0)), values[1], values[0], *values[2:]]))
    return "\n".join(lines) + "\n"


def qgc_fence(corners: Sequence[Sequence[float]]) -> str:
    fence = {"polygons": [{"polygon": corners, "inclusion": True}]}
    return json.dumps({"geoFence": fence})


def run(folder: Path, vehicle: str, mission: dict[str, Any]) -> dict[str, Any]:
    """Fly `mission` and return what became of it; again where the simulator did not start."""
    commands = [row[0] for row in mission["items"]]
    with tempfile.TemporaryDirectory() as work:
        file, track, summary = (Path(work, name) for name in ("m.waypoints", "t.csv", "s.json"))
        file.write_text(waypoints(mission["items"]))
        given = ",".join(f"{name}={value}" for name, value in mission["parameters"].items())
        runner = "fly_px4.py" if vehicle == "px4" else "fly_arducopter.py"
        command = [str(folder / runner), str(file), "--out", str(track), "--json", str(summary)]
        command += ["--speedup", str(SPEEDUP[vehicle]), "--max-sim-time", str(WATCH[vehicle])]
        command += ["--params", given]
        if vehicle == "px4":
            command += ["--instance", str(INSTANCE)]
            if "fence" in mission:
                command = [__file__, "--px4-fence", json.dumps(mission["fence"]), *command]
        else:
            command += ["--tail", "15", "--on-ground"]
            command += ["--vehicle", vehicle.removeprefix("ardu")]
            if "fence" in mission:
                plan = Path(work, "fence.plan")
                plan.write_text(qgc_fence(mission["fence"]))
                command += ["--extras", str(plan)]
        for _ in range(3):
            track.unlink(missing_ok=True)
            done = subprocess.run([sys.executable, *command], capture_output=True, text=True)
            if done.returncode != 3 and summary.exists():
                found = json.loads(summary.read_text())
                if "ended_by" in found or settled(found):
                    return became(found, commands, read_track(track))
            elif summary.exists() and settled(json.loads(summary.read_text())):
                return became(json.loads(summary.read_text()), commands, [])
        raise SystemExit(f"{vehicle}: not flown\n{done.stdout[-3000:]}\n{done.stderr[-3000:]}")


def settled(summary: dict[str, Any]) -> bool:
    """Tell whether the autopilot has said no before the flight."""
    accepted = summary.get("ack") == "MAV_MISSION_ACCEPTED"
    no = not accepted or summary.get("infeasible") or "why_not" in summary
    return "ack" in summary and bool(no)


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
    up = [height for height, _ in track]
    flight = Flight(
        summary["ended_by"],
        [number + shift for _, number in summary["reached"]],
        [(round(t, 1), number + shift) for t, number in summary["current_changes"]],
        summary["sim_end_s"],
        [(height, number + shift) for height, number in track],
    )
    return found | {
        "verdict": flight.verdict(commands),
        "end": flight.end,
        "reached": flight.reached,
        "highest": round(max(up, default=0.0), 1),
        "lowest": round(min(up, default=0.0), 1),
        "seconds": round(summary["duration_sim_s"]),
    }


@dataclass(frozen=True)
class Flight:
    """A flight: why it ended and when, s; the items that were reached; those that were turned to,
    with the time, s; height, m above home, and item, all along. Items count from 1."""

    end: str
    reached: list[int]
    turns: list[tuple[float, int]]
    time: float
    track: list[tuple[float, int]]

    def verdict(self, commands: Sequence[int]) -> str:
        if max((height for height, _ in self.track), default=0.0) < OFF_THE_GROUND:
            return "on the ground"
        if self.hit_ground(commands):
            return "crashed"
        if self.end.startswith("gave up"):
            return "stuck"
        last = max(k for k, command in enumerate(commands, start=1) if command <= 95)
        # At the moment at which it disarms it turns to the next item, too.
        count = self.time - 2 if self.end == "disarmed" else math.inf
        turned = any(item >= last and moment < count for moment, item in self.turns)
        return "flown" if turned or max(self.reached, default=0) >= last else "ended early"

    def hit_ground(self, commands: Sequence[int]) -> bool:
        """Tell whether it came down where no item is to do with the ground."""
        flying = False
        for height, item in self.track:
            flying = flying or height > OFF_THE_GROUND
            way = commands[:item]
            if flying and height < TOUCH and way[-1] not in TAKEOFFS and not TO_GROUND & {*way}:
                return True
        return False


def with_px4_fence(fence: str, arguments: Sequence[str]) -> int:
    """Run PX4's runner so that it uploads a fence before each mission."""
    runner, *rest = arguments
    spec = importlib.util.spec_from_file_location("fly_px4", runner)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    mission_only = module.Vehicle.upload
    corners = json.loads(fence)

    def upload(self: Any, items: Any, drop_ack: bool = False) -> Any:
        self.m.mav.mission_count_send(self.me, 1, len(corners), 1)
        while True:
            asked = self.pump(("MISSION_REQUEST", "MISSION_REQUEST_INT", "MISSION_ACK"), 3)
            assert asked is not None, "PX4 does not ask for the fence"
            if asked.mission_type != 1:
                continue
            if asked.get_type() == "MISSION_ACK":
                assert asked.type == 0, "PX4 refuses the fence"
                return mission_only(self, items, drop_ack)
            x, y = (round(1e7 * v) for v in corners[asked.seq])
            head = (self.me, 1, asked.seq, 0, 5001, 0, 1, len(corners), 0, 0, 0)
            self.m.mav.mission_item_int_send(*head, x, y, 0, 1)

    module.Vehicle.upload = upload
    sys.argv = [runner, *rest]
    status: int = module.main()
    return status


def recorded(vehicle: str) -> dict[str, Any]:
    file = DATA / f"{vehicle}.json"
    found: dict[str, Any] = json.loads(file.read_text()) if file.exists() else {}
    return found


def packed(items: Sequence[Row]) -> list[Row]:
    """Return the rows with how often each is repeated in its place before it."""
    found: list[Row] = []
    for row in items:
        if found and found[-1][1:] == row:
            found[-1][0] += 1
        else:
            found.append([1, *row])
    return found


def same(recorded: dict[str, Any] | None, mission: dict[str, Any]) -> bool:
    packed_mission = mission | {"items": packed(mission["items"])}
    return recorded is not None and all(
        recorded.get(key) == packed_mission.get(key) for key in ("items", "parameters", "fence")
    )


def write(vehicle: str, found: dict[str, Any]) -> None:
    """Write the verdicts in the order of the missions, an item a line."""
    lines = []
    for name in MISSIONS[vehicle]:
        if name in found:
            mission = dict(found[name])
            rows = mission.pop("items")
            head = json.dumps(mission)[:-1]
            items = ",\n".join(f"    {json.dumps(row)}" for row in rows)
            lines.append(f'  {json.dumps(name)}: {head}, "items": [\n{items}\n  ]}}')
    (DATA / f"{vehicle}.json").write_text("{\n" + ",\n".join(lines) + "\n}\n")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*", help="fly these again, VEHICLE or VEHICLE/NAME")
    parser.add_argument("--seconds", type=float, default=math.inf, help="begin none after that")
    options = parser.parse_args()
    folder, end = Path(os.environ["FAAO_AUTOPILOTS"]), time.monotonic() + options.seconds
    left = 0
    for vehicle, missions in MISSIONS.items():
        found = recorded(vehicle)
        for name, mission in missions.items():
            asked = {vehicle, f"{vehicle}/{name}"} & set(options.names)
            if not asked and (options.names or same(found.get(name), mission)):
                continue
            if time.monotonic() > end:
                left += 1
                continue
            items = {"items": packed(mission["items"])}
            found[name] = mission | items | run(folder, vehicle, mission)
            print(vehicle, name, found[name]["verdict"], found[name]["said"], flush=True)
            write(vehicle, found)
    print(f"{left} left")


if __name__ == "__main__":
    if sys.argv[1:2] == ["--px4-fence"]:
        sys.exit(with_px4_fence(sys.argv[2], sys.argv[3:]))
    main()
