"""What is judged, written in a line: `given("px4 square:100 takeoff waypoint:0,50.1,30 return")`.

The words of a line, in any order but for the items, which are flown in theirs:

- `copter`, `plane`, `px4`, `px4-plane`: the vehicle; `NAME=VALUE`: one of its parameters;
- `max_altitude=50` and so forth: a limit; `airborne`; `home=LATITUDE,LONGITUDE,HEIGHT`, `homeless`;
- `energy=WH,W`: what the flight takes of 100 Wh, 20 % of which are kept, and the least power;
- `link`, `link.NAME=VALUE`: a plan that is delivered, but for a value of `LinkCheck`;
- `predicted`: the flight is, `unpredicted`: it cannot be; `fly:PACE;PLACE;PLACE,INDEX;...`: it is
  so, at m/s, to these items;
- `square:SIDE,EAST`, `area:PLACE;...`, `disc:PLACE,RADIUS`: inclusions, the square about home or
  a place east of it; `zone:PLACE,RADIUS`: an exclusion; `rally:PLACE`, `back:PLACE`: where a
  return, and one after a breach, ends;
- `takeoff`, `return`, `land`: items at home; `row=COUNT,SPACING`: waypoints to the north of home;
- `waypoint:PLACE,PARAM1,...`: a command, by its name or number, at a place: metres east, north and
  above home; `waypoint@...`: at degrees; `jump=PARAM1,...`: without a place; `/FRAME` after it: in
  another frame than 3, or 2; `!` at the end: autocontinue off; `3*` before it: three times.
"""

import re
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from faao_mav.autopilot import Track, Vehicle
from faao_mav.autopilot.predict import predict
from faao_mav.geodesy import LocalFrame
from faao_mav.mission.command import Command, Frame
from faao_mav.mission.fence import Circle, Fence, Polygon, RallyPoint
from faao_mav.mission.item import Home, Mission, MissionItem
from faao_mav.plan.vehicle import Battery
from faao_mav.validate import Finding, Level, Limits, LinkCheck, ValidationContext, validate
from faao_mav.validate.demands import EnergyUse

HOME = Home(-35.363262, 149.165237, 584.0)
FRAME = LocalFrame(HOME.latitude, HOME.longitude)

COPTER = Vehicle("ardupilot", "copter")
PLANE = Vehicle("ardupilot", "plane")
PX4 = Vehicle("px4", "copter")
PX4_PLANE = Vehicle("px4", "plane")
VEHICLES = (COPTER, PLANE, PX4, PX4_PLANE)
_NAMED = dict(zip(("copter", "plane", "px4", "px4-plane"), VEHICLES, strict=True))
_COMMANDS = {c.name.partition("_")[2].lower(): c for c in sorted(Command, reverse=True)}

LINK = LinkCheck(
    planned_rate=2.0,
    predicted_rate=2.0,
    planned_delivered=2.0,
    predicted_delivered=2.0,
    planned_duration=120.0,
    predicted_duration=120.0,
    rms_position_error=1.0,
    max_position_error=2.0,
    path_error=1.0,
    path_tolerance=2.0,
)


def latlon(east: float, north: float) -> tuple[float, float]:
    latitude, longitude = FRAME.to_geodetic([east, north])
    return float(latitude), float(longitude)


def at(
    east: float, north: float, up: float, *params: float, command: int = 16, frame: int = 3
) -> MissionItem:
    """An item that flies to a local place, by default a waypoint above home."""
    one, two, three, last = (*params, 0.0, 0.0, 0.0, 0.0)[:4]
    return MissionItem(command, frame, (one, two, three, last), *latlon(east, north), up)


def do(command: int, *params: float, frame: int = Frame.MISSION) -> MissionItem:
    """An item without a place."""
    return replace(at(0, 0, 0, *params, command=command, frame=frame), x=0.0, y=0.0)


TAKEOFF = at(0, 0, 30, command=Command.NAV_TAKEOFF)
RTL = do(Command.NAV_RETURN_TO_LAUNCH)
LAND = at(0, 0, 0, command=Command.NAV_LAND)


def polygon(*corners: tuple[float, float], inclusion: bool = True) -> Polygon:
    return Polygon(tuple(latlon(*corner) for corner in corners), inclusion)


def track(
    points: Sequence[Sequence[float]], items: Sequence[int], pace: float, frame: LocalFrame = FRAME
) -> Track:
    """Straight lines through `points` at `pace` m/s, towards the items at `items`, at 10 Hz."""
    t, position, velocity, item = [0.0], [np.array(points[0], dtype=float)], [np.zeros(3)], []
    reached = np.full(max(items) + 1, np.nan)
    for start, end, index in zip(points, points[1:], items, strict=False):
        a, b = np.array(start, dtype=float), np.array(end, dtype=float)
        samples = max(1, round(float(np.linalg.norm(b - a)) / pace / 0.1))
        for k in range(samples):
            t.append(t[-1] + 0.1)
            position.append(a + (b - a) * (k + 1) / samples)
            velocity.append((b - a) / (samples * 0.1))
            item.append(index)
        reached[index] = t[-1]
    velocity[0] = velocity[1]
    samples_of = (np.array(t), np.array(position), np.array(velocity))
    return Track(*samples_of, np.array([items[0], *item]), reached, frame)


class Given(ValidationContext):
    """What is judged."""

    def by(self, rule: str) -> list[Finding]:
        return [finding for finding in validate(self) if finding.rule == rule]


_WORD = re.compile(r"(?:(\d+)\*)?([\w.-]+)(?:([:=@])([^/!]*)(?:/(\d+))?)?(!?)")
_ITEMS = {"takeoff": TAKEOFF, "return": RTL, "land": LAND}


def given(line: str) -> Given:
    """Return what `line` says, as the head of this file has it."""
    case: dict[str, Any] = {"vehicle": COPTER}
    named: dict[str, dict[str, Any]] = {"NAME": {}, "max": {}, "link": {}}
    items: list[MissionItem] = []
    parts: dict[str, list[Any]] = {"polygons": [], "circles": [], "rally": []}
    home: Home | None = HOME
    back = None
    for word in line.split():
        match = _WORD.fullmatch(word)
        assert match is not None, word
        count, head, sign, rest, frame, off = match.groups()
        rows = [[float(x) for x in row.split(",") if x] for row in (rest or "").split(";")]
        first, times = rows[0], int(count or 1)
        kind, _, field = head.rpartition(".") if "." in head else head.partition("_")
        if head in _NAMED:
            case["vehicle"] = _NAMED[head]
        elif head.isupper():
            named["NAME"][head] = first[0]
        elif kind in named:
            named[kind] |= {head if kind == "max" else field: first[0]} if first else {}
            case["link"] = LINK if kind == "link" else case.get("link")
        elif head in ("airborne", "predicted"):
            case[head] = True
        elif head == "unpredicted":
            case[head] = "the flight would take too long"
        elif head in ("home", "homeless"):
            home = Home(*first) if first else None
        elif head == "energy":
            t, battery = np.array([0.0, 3600.0]), Battery(capacity_wh=100)
            case["energy"] = EnergyUse(t, t, np.array([0.0, first[0]]), battery, True, first[1])
        elif head == "fly":
            case["track"] = track(
                [r[:3] for r in rows[1:]], [int(r[3]) for r in rows[2:]], first[0]
            )
        elif head == "square":
            half, east = first[0] / 2, first[1] if first[1:] else 0.0
            ways = ((-half, -half), (half, -half), (half, half), (-half, half))
            parts["polygons"] += [polygon(*((east + x, y) for x, y in ways))] * times
        elif head == "area":
            parts["polygons"].append(polygon(*((x, y) for x, y in rows)))
        elif head in ("disc", "zone"):
            parts["circles"].append(Circle(latlon(*first[:2]), first[2], head == "disc"))
        elif head in ("rally", "back"):
            point = RallyPoint(*latlon(*first[:2]), first[2])
            parts["rally"] += [point] * times if head == "rally" else []
            back = back if head == "rally" else point
        elif head == "row":
            items += [at(0, first[1] * (k + 1), 30) for k in range(int(first[0]))]
        elif not sign:
            items += [_ITEMS[head]] * times
        else:
            command = int(head) if head.isdigit() else _COMMANDS[head]
            item = do(command, *first, frame=int(frame or 2))
            if sign != "=":
                item = at(*(first if sign == ":" else [0, 0, *first[2:]]), command=command)
                item = replace(item, frame=int(frame or 3))
            if sign == "@":
                item = replace(item, x=first[0], y=first[1])
            items += [replace(item, autocontinue=not off)] * times
    fence = Fence(tuple(parts["polygons"]), tuple(parts["circles"]), back)
    case["vehicle"] = replace(case["vehicle"], parameters=named["NAME"])
    case["limits"] = Limits(**named["max"])
    if case.get("link") is not None:
        case["link"] = replace(LINK, **named["link"])
    told = Mission(tuple(items), home, fence, tuple(parts["rally"]))
    if case.pop("predicted", False):
        case["track"] = predict(told, case["vehicle"])
    return Given(told, **case)


def check(rule: str, trips: Given, item: int | None, passes: Given) -> None:
    """Assert that `rule` speaks about `trips` at `item` and says nothing about `passes`."""
    found = trips.by(rule)
    assert found, f"{rule} does not speak; {[finding.rule for finding in validate(trips)]} do"
    assert found[0].item == item
    assert all(finding.message for finding in found)
    assert all(finding.action or finding.level is Level.NOTE for finding in found)
    assert passes.by(rule) == []
