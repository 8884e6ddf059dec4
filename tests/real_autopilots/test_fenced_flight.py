"""A fenced mission on real autopilots with their fence on: stored, verified, flown, kept."""

import time
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import MISSIONS, edited
from pymavlink import mavutil
from simulators import simulated

from faao_mav import plan_mission, upload
from faao_mav.plan import parse_plan

PATIENCE = 60.0
"""Seconds that a simulated autopilot has to start, and to get ready to arm."""

LONGEST = 150.0
"""Seconds that the flight may take, many times as fast as in the world."""

MODES = {"arducopter": (3, 0), "px4": (4, 4)}
"""The mode and the sub mode in which each flies its mission."""

ON = {"FENCE_ENABLE": 1, "FENCE_TYPE": 4, "AUTO_OPTIONS": 3}
"""ArduCopter: areas of the fence count; it may be armed and take off in AUTO."""

PLAN = {
    "flight.start": [0, 60],
    "flight.end": [130, 0],
    "flight.duration": 40,
    "flight.altitude": 15,
    "vehicle.max_speed": 6,
    "radio.base_station.position": [0, 60],
    "radio.ground_user.position": [130, 60],
    "radio.fading": "none",
    "fence.margin": 3,
    "fence.inclusion": [[-50, -40], [170, -40], [170, 100], [-50, 100]],
    "fence.exclusion": [
        {"polygon": [[-20, 25], [20, 25], [20, 35], [-20, 35]]},
        {"center": [65, 45], "radius": 15},
        {"polygon": [[60, -30], [80, -30], [80, 10], [60, 10]]},
    ],
}
"""A wall before home, a round zone before the user, a wall on the way home."""


@pytest.mark.parametrize("kind", ["arducopter", "px4"])
def test_it_keeps_inside(kind: str, autopilots: Path, tmp_path: Path) -> None:
    changes = PLAN | {"vehicle.autopilot": "px4" if kind == "px4" else "ardupilot"}
    result = plan_mission(parse_plan(edited((MISSIONS / "copter_relay.yaml").read_text(), changes)))
    plan, conversion = result.solution.plan, result.conversion
    assert result.flyable
    assert conversion is not None
    given = {**conversion.parameters, **({} if kind == "px4" else ON)}
    listed = ",".join(f"{name}={value:g}" for name, value in given.items())
    options = ("--params", listed, "--speedup", "8") if kind == "px4" else ("--speedup", "10")
    with simulated(autopilots, kind, tmp_path, *options) as connection:
        report = upload(conversion.mission, connection, wait=PATIENCE)
        assert [part.verdict for part in report.parts] == ["verified"] * 2
        places, texts = flown(connection, kind, {} if kind == "px4" else given)
    assert not [text for text in texts if "ence" in text or "ailsafe" in text]
    assert plan.keep_in is not None
    track = plan.origin.frame.to_local(*(1e-7 * np.array(places).T))
    assert np.abs(track - result.solution.w[-1]).sum(axis=1).min() < 3
    assert plan.keep_in.clearance(track) > 0.5
    assert np.hypot(*track[-1]) < 3


def flown(
    connection: str, kind: str, parameters: dict[str, float]
) -> tuple[list[tuple[int, int]], list[str]]:
    """Set `parameters`, arm, fly until it disarms; return its places, 1e-7 degrees, and texts."""
    link = mavutil.mavlink_connection(connection)
    link.wait_heartbeat(timeout=PATIENCE)
    for name, value in parameters.items():
        link.mav.param_set_send(link.target_system, 1, name.encode(), value, 9)
        link.recv_match(type="PARAM_VALUE", blocking=True, timeout=1)
    command(link, 511, 33, 1e5)  # positions at 10 Hz of simulated time
    end = time.monotonic() + PATIENCE
    while True:  # the estimate of the position takes its time
        link.mav.heartbeat_send(6, 8, 0, 0, 0)
        command(link, 176, 1, *MODES[kind])
        if command(link, 400, 1) == 0:
            break
        assert time.monotonic() < end, "it does not arm"
    places, texts, beat = list[tuple[int, int]](), list[str](), 0.0
    end = time.monotonic() + LONGEST
    while time.monotonic() < end:
        if time.monotonic() - beat > 0.2:
            beat = time.monotonic()
            link.mav.heartbeat_send(6, 8, 0, 0, 0)
        message = link.recv_match(blocking=True, timeout=1)
        match message and message.get_type():
            case "GLOBAL_POSITION_INT":
                places.append((message.lat, message.lon))
            case "STATUSTEXT":
                texts.append(message.text)
            case "HEARTBEAT" if message.get_srcComponent() == 1 and len(places) > 100:
                if not message.base_mode & 128:
                    link.close()
                    return places, texts
    raise AssertionError(f"no end: {texts}")


def command(link: Any, number: int, *params: float) -> int | None:
    """Send a command and return its result, None if there is no answer."""
    values = [*params, *[0.0] * 7][:7]
    link.mav.command_long_send(link.target_system, 1, number, 0, *values)
    end = time.monotonic() + 2
    while time.monotonic() < end:
        answer = link.recv_match(type="COMMAND_ACK", blocking=True, timeout=1)
        if answer is not None and answer.command == number:
            return int(answer.result)
    return None
