"""Whether the speeds that are asked for can be flown."""

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import groupby

import numpy as np

from faao_mav.autopilot.vehicle_type import OVERSPEED
from faao_mav.mission.command import Command
from faao_mav.validate.context import ValidationContext, number
from faao_mav.validate.rule import Issue, Rules
from faao_mav.validate.straight import HOME, Straight

RULES = Rules()

REACHED_SHARE = 0.8
"""The share of the commanded speed below which a leg is reported. Chosen."""

TIME_LOST = 2.0
"""The least time, s, that a reported run of slow legs loses: in less, corners are taken and speeds
are changed. Chosen."""

CRAWL_SHARE = 0.5
"""The share of the commanded speed below which a row of legs is a crawl. Chosen."""

CRAWL_LEGS = 5
"""The least number of legs in a row that make a crawl. Chosen."""

_LIMIT = "the plan's vehicle.max_speed"
_MEASURED = "flight models measured on ArduCopter 4.7 and PX4 1.16.1; the predicted flight"
_SHORTEST = 1.0
"""The length, m, below which a leg is a correction and not one to speed up on. Chosen."""

_SLOWEST = 0.1
"""The least speed that is reckoned with, m/s, so that times stay finite."""


@dataclass(frozen=True, slots=True)
class _Run:
    """Neighbouring legs that stay below their commanded speed, and what they reach, m/s."""

    legs: list[Straight]
    reached: list[float]

    @property
    def crawls(self) -> bool:
        """Whether the run is long and slow enough to be called a crawl."""
        commanded = sum(leg.speed for leg in self.legs)
        return len(self.legs) >= CRAWL_LEGS and sum(self.reached) < CRAWL_SHARE * commanded

    @property
    def time_lost(self) -> float:
        """Seconds at least that the run takes longer than at the commanded speeds."""
        return sum(
            leg.length * (1 / max(reached, _SLOWEST) - 1 / leg.speed)
            for leg, reached in zip(self.legs, self.reached, strict=True)
        )

    @property
    def last(self) -> int:
        """The number of the last item."""
        return number(self.legs[-1].index)

    @property
    def mean_speed(self) -> float:
        """The mean of what the legs reach, m/s."""
        return sum(self.reached) / len(self.reached)


@RULES.warning(
    "speed-not-reached",
    _MEASURED,
    summary=f"legs that stay below {100 * REACHED_SHARE:g} % of the commanded speed and lose "
    f"{TIME_LOST:g} s or more by it; with a plan its own clock is compared instead",
    kind="copter",
)
def _not_reached(context: ValidationContext) -> Iterator[Issue]:
    for run in _slow_runs(context):
        # A plan may ask for a speed that only the next leg reaches: link-timing judges that.
        if run.crawls or run.time_lost < TIME_LOST or context.link is not None:
            continue
        first, low, high = run.legs[0], min(run.reached), max(run.reached)
        if len(run.legs) == 1:
            what = f"on this leg of {first.length:.0f} m the aircraft gets to {low:.1f} m/s"
        else:
            span = f"{low:.1f}" if high - low < 0.05 else f"{low:.1f} to {high:.1f}"
            what = (
                f"on the {len(run.legs)} legs from here to item {run.last} the aircraft gets to "
                f"{span} m/s"
            )
        yield Issue(
            first.index,
            f"{what}, not to the commanded {max(leg.speed for leg in run.legs):g} m/s",
            "ask for what it reaches, or make the legs longer",
        )


@RULES.warning(
    "crawl",
    _MEASURED,
    summary=f"waypoints so dense that {CRAWL_LEGS} legs or more stay below "
    f"{100 * CRAWL_SHARE:g} % of the commanded speed",
    kind="copter",
)
def _crawl(context: ValidationContext) -> Iterator[Issue]:
    for run in _slow_runs(context):
        if run.crawls:
            spacing = sum(leg.length for leg in run.legs) / len(run.legs)
            yield Issue(
                run.legs[0].index,
                f"the {len(run.legs)} legs from here to item {run.last} are {spacing:.1f} m long "
                f"on average: the aircraft crawls at about {run.mean_speed:.1f} m/s of the "
                f"commanded {max(leg.speed for leg in run.legs):g}",
                "thin the waypoints: keep those that the shape of the path needs",
            )


def _slow_runs(context: ValidationContext) -> Iterator[_Run]:
    """Yield the runs of neighbouring legs that stay below their commanded speed."""
    pairs = zip(*_reached_speeds(context), strict=True)
    for slow, run in groupby(pairs, lambda pair: pair[1] < REACHED_SHARE * pair[0].speed):
        if slow:
            legs, reached = zip(*run, strict=True)
            yield _Run(list(legs), list(reached))


def _reached_speeds(context: ValidationContext) -> tuple[list[Straight], list[float]]:
    """Return the level legs between waypoints, and the speed that each reaches, m/s.

    That is the greatest speed of the predicted flight towards the leg's end. Without one it is
    what the leg's length allows by the model of a single leg, of which splines have none.
    """
    legs = [
        leg
        for leg in context.legs
        if leg.start.index != HOME
        and not leg.jump
        and leg.length >= _SHORTEST
        and context.items[leg.index].command in (Command.NAV_WAYPOINT, Command.NAV_SPLINE_WAYPOINT)
    ]
    if context.track is not None:
        fastest = np.full(len(context.items), -np.inf)
        np.maximum.at(fastest, context.track.item, np.hypot(*context.track.velocity[:, :2].T))
        legs = [leg for leg in legs if fastest[leg.index] >= 0]  # the others are not flown
        return legs, [float(fastest[leg.index]) for leg in legs]
    legs = [leg for leg in legs if not leg.spline]
    lengths = np.array([leg.length for leg in legs], dtype=float)
    reachable = context.vehicle.legs.reachable_speed(lengths)
    return legs, [min(float(v), leg.speed) for v, leg in zip(reachable, legs, strict=True)]


@RULES.error(
    "speed-above-limit",
    _LIMIT,
    summary=f"faster than the vehicle's max_speed by more than {100 * (OVERSPEED - 1):.0f} %",
)
def _above_limit(context: ValidationContext) -> Iterator[Issue]:
    limit = context.limits.max_speed
    if limit is not None:
        for index, speed in _faster_than(OVERSPEED * limit, context):
            yield Issue(
                index,
                f"{speed:g} m/s from here on; the vehicle's max_speed is {limit:g} m/s",
                f"put a DO_CHANGE_SPEED of {limit:g} m/s or less before this item",
            )


@RULES.note(
    "speed-headroom",
    _LIMIT,
    summary=f"faster than the vehicle's max_speed by up to {100 * (OVERSPEED - 1):.0f} %",
)
def _headroom(context: ValidationContext) -> Iterator[Issue]:
    limit = context.limits.max_speed
    if limit is None:
        return
    above = [found for found in _faster_than(limit, context) if found[1] <= OVERSPEED * limit]
    if above:
        index, speed = max(above, key=lambda found: found[1])
        yield Issue(
            index,
            f"up to {speed:g} m/s is commanded; the vehicle's max_speed is {limit:g} m/s",
            "nothing, if the vehicle may; else plan with a lower vehicle.max_speed",
        )


def _faster_than(speed: float, context: ValidationContext) -> Iterator[tuple[int, float]]:
    """Yield the index of each leg on which a speed above `speed` begins, and that speed, m/s."""
    before = None
    for leg in (leg for leg in context.legs if leg.length >= _SHORTEST):
        if leg.speed > speed and leg.speed != before:
            yield leg.index, leg.speed
        before = leg.speed


@RULES.warning(
    "acceleration-above-limit", "the plan's vehicle.max_acceleration; the predicted flight"
)
def _acceleration(context: ValidationContext) -> Iterator[Issue]:
    """The predicted flight accelerates more than the vehicle's max_acceleration."""
    limit, track = context.limits.max_acceleration, context.track
    if limit is None or track is None or len(track.t) < 3:
        return
    change = np.gradient(track.velocity[:, :2], track.t, axis=0)
    acceleration = np.hypot(*change.T)
    worst = int(np.argmax(acceleration))
    if acceleration[worst] > 1.05 * limit:
        yield Issue(
            int(track.item[worst]),
            f"the predicted flight accelerates by {acceleration[worst]:.1f} m/s^2 at "
            f"{track.t[worst]:.0f} s; the vehicle's max_acceleration is {limit:g} m/s^2",
            "lower the autopilot's acceleration (WPNAV_ACCEL, MPC_ACC_HOR)",
        )
