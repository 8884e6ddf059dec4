"""Whether the path's corners and climbs can be flown at speed."""

import math
from collections.abc import Iterator
from itertools import pairwise

from faao_mav.mission.command import Command
from faao_mav.power import GRAVITY
from faao_mav.validate.context import ValidationContext
from faao_mav.validate.rule import Issue, Rules
from faao_mav.validate.straight import HOME, Straight

RULES = Rules()

SHARP = 45.0
"""The turn, degrees, above which a copter slows down for a corner. Measured on ArduCopter and
PX4."""

_SLOW = 3.0
"""The commanded speed, m/s, up to which corners hardly matter. Chosen."""

_CLIMB_SHARE = 0.8
"""The share of the climbing time that the way over ground may fall short to: less, and the leg is
steep. Chosen."""

_SHORTEST = 1.0
"""The length, m, below which a leg has no direction to turn from. Chosen."""


def _corners(context: ValidationContext) -> Iterator[tuple[Straight, Straight, float]]:
    """Yield the legs before and after each plain waypoint that is passed, and the turn, degrees."""
    # A return to launch starts from a stop.
    legs = [
        leg
        for leg in context.legs
        if not leg.jump and leg.end.index != HOME and leg.length >= _SHORTEST
    ]
    for before, after in pairwise(legs):
        item = context.items[before.index]
        passed = item.command == Command.NAV_WAYPOINT and not item.params[0] > 0
        if passed and after.start == before.end and not after.spline:
            yield before, after, math.degrees(before.turn(after))


@RULES.note(
    "sharp-corners",
    "measured on ArduCopter 4.7 and PX4 1.16.1",
    summary=f"turns of more than {SHARP:g} degrees at speed: the aircraft slows down for them",
    kind="copter",
)
def _sharp(context: ValidationContext) -> Iterator[Issue]:
    sharp = [
        (turn, before)
        for before, _, turn in _corners(context)
        if turn > SHARP and before.speed > _SLOW
    ]
    if sharp:
        turn, leg = max(sharp, key=lambda corner: corner[0])
        slow = ""
        if (passing := context.vehicle.type.corner_speed) is not None:
            speed = passing(context.vehicle, math.radians(turn))
            slow = f", passed at about {speed:.1f} m/s"
        corners = "1 corner" if len(sharp) == 1 else f"{len(sharp)} corners"
        yield Issue(
            leg.index,
            f"{corners} of more than {SHARP:g} degrees at speed; this is the sharpest: "
            f"{turn:.0f} degrees at {leg.speed:g} m/s{slow}",
            "allow time for it, or round the corner with two or three waypoints",
        )


@RULES.warning("turn-too-tight", "coordinated turn: radius v^2 / (g tan bank)", kind="plane")
def _tight(context: ValidationContext) -> Iterator[Issue]:
    """A corner that a plane cannot fly between its waypoints."""
    bank = context.vehicle.value("roll_limit")
    shown = f"{math.degrees(bank):g} degrees of bank"
    for before, after, turn in _corners(context):
        radius = before.speed * before.speed / (GRAVITY * math.tan(bank))
        needed = radius * math.tan(math.radians(min(turn, 179.0)) / 2)
        room = min(before.length, after.length)
        if needed > room:
            yield Issue(
                before.index,
                f"a turn of {turn:.0f} degrees at {before.speed:g} m/s and {shown} "
                f"takes {needed:.0f} m of the legs before and after; the shorter one has "
                f"{room:.0f} m",
                "make the legs longer, the turn wider or the speed lower",
            )


@RULES.warning(
    "steep-leg", "WPNAV_SPEED_UP and _DN, TECS_CLMB_MAX, MPC_Z_V_AUTO_UP and _DN, FW_T_CLMB_MAX"
)
def _steep(context: ValidationContext) -> Iterator[Issue]:
    """A leg so steep that the climb or descent takes longer than the way over ground."""
    climb = context.vehicle.value("climb_speed")
    descent = context.vehicle.value("descent_speed")
    for leg in context.legs:
        command = context.items[leg.index].command
        limit = climb if leg.rise > 0 else descent
        on_ground = leg.start.index == HOME
        if on_ground or command != Command.NAV_WAYPOINT or leg.length < _SHORTEST:
            continue
        level, vertical = leg.length / leg.speed, abs(leg.rise) / limit
        if math.isfinite(vertical) and level < _CLIMB_SHARE * vertical:
            way = "climbs" if leg.rise > 0 else "descends"
            yield Issue(
                leg.index,
                f"the leg {way} {abs(leg.rise):.0f} m in {leg.length:.0f} m: at {limit:g} m/s that "
                f"takes {vertical:.0f} s, the way over ground {level:.0f} s at {leg.speed:g} m/s",
                f"ask for {leg.length / vertical:.1f} m/s on this leg, or change height at a "
                "waypoint of its own",
            )
