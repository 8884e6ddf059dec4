"""What a flight is asked to keep: limits, the plan that it carries out, its battery."""

import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from faao_mav.arrays import Real
from faao_mav.errors import InputError
from faao_mav.plan import Plan, Radio, Vector
from faao_mav.plan.vehicle import Battery
from faao_mav.power import JOULES_PER_WH, least_power

ELSEWHERE = 2_000.0
"""Metres that a mission comes no nearer to the planned path if it is of another place. Chosen."""

LATE_START = 10.0
"""Seconds by which a flight begins late to stations that move, where it is told what that costs.
Chosen."""

_AIRSPEEDS = np.linspace(0.0, 100.0, 1001)
"""The airspeeds, m/s, of which one has the least power. Chosen: all that are flown."""


@dataclass(frozen=True, slots=True)
class Limits:
    """What a flight must stay within; None: no limit.

    `max_duration`, s, of the whole flight; `max_distance`, m, from home over ground;
    `max_altitude`, m above home; `max_speed`, m/s, over ground; `max_acceleration`, m/s², over
    ground. Raises `InputError` for one that is not a finite number above 0.

    >>> from faao_mav import Vehicle, check, read_mission
    >>> low = Limits(max_altitude=20.0)
    >>> found = check(read_mission("tests/data/missions/plain.waypoints"), Vehicle(), limits=low)
    >>> {finding.rule for finding in found.findings} == {"above-ceiling", "predicted-beyond"}
    True
    """

    max_duration: float | None = None
    max_distance: float | None = None
    max_altitude: float | None = None
    max_speed: float | None = None
    max_acceleration: float | None = None

    def __post_init__(self) -> None:
        for name in self.__dataclass_fields__:
            value = getattr(self, name)
            if value is not None and not (math.isfinite(value) and value > 0):
                raise InputError(f"{name}: {value}; expected a number above 0")


@dataclass(frozen=True, slots=True)
class LinkCheck:
    """A plan and how the mission is predicted to carry it out.

    Rates in bit/s/Hz, averaged over the flight: `planned_rate` and `predicted_rate` are R_avg,
    `planned_delivered` and `predicted_delivered` what the relay delivers. `causal` tells whether it
    is the delivered rate that was planned for. Durations in s; `rms_position_error` and
    `max_position_error` m between planned and predicted position at equal times; `path_error` m
    between planned and predicted path, `path_tolerance` m what the plan allows of it;
    `altitude_error` m between planned and predicted height; `bandwidth_mhz` is None where the plan
    has none. `radio` is what the plan says of both links, `away` the least distance, m, between the
    two paths. `unmeasured` says where the planned route leaves what the gain of a hop was measured
    at, `off_map` where the predicted flight first is in ground or off a map of the gain. The plan
    begins `begins` s after the mission; `late_share` is the part of the planned rate that one which
    begins `LATE_START` later delivers, None where no station moves.

    >>> from faao_mav import plan_mission, read_plan
    >>> link = plan_mission(read_plan("missions/copter_relay.yaml")).check.link
    >>> 0.99 < link.predicted_rate / link.planned_rate < 1.01, link.late < 1.0
    (True, True)
    """

    planned_rate: float
    predicted_rate: float
    planned_delivered: float
    predicted_delivered: float
    planned_duration: float
    predicted_duration: float
    rms_position_error: float
    max_position_error: float
    path_error: float
    path_tolerance: float
    altitude_error: float = 0.0
    causal: bool = True
    bandwidth_mhz: float | None = None
    radio: Radio | None = None
    away: float = 0.0
    unmeasured: tuple[str, ...] = ()
    off_map: str = ""
    begins: float = 0.0
    late_share: float | None = None

    @property
    def elsewhere(self) -> bool:
        """Whether the mission flies at another place than the plan."""
        return self.away > ELSEWHERE

    @property
    def late(self) -> float:
        """By how many seconds the predicted flight takes longer than planned."""
        return self.predicted_duration - self.planned_duration

    @property
    def predicted_mbytes(self) -> float | None:
        """What is predicted to be delivered in all, 10^6 bytes; None without a bandwidth."""
        if self.bandwidth_mhz is None:
            return None
        return self.predicted_delivered * self.bandwidth_mhz * self.planned_duration / 8

    @property
    def share(self) -> float:
        """The part of the planned rate that is predicted, by which the mission is judged.

        It is the delivered rate. A plan for R_avg promises that as well: the smaller part counts.
        """
        rates = [(self.predicted_delivered, self.planned_delivered)]
        rates += [] if self.causal else [(self.predicted_rate, self.planned_rate)]
        return min(flown / planned if planned > 0 else 1.0 for flown, planned in rates)


@dataclass(frozen=True, slots=True, eq=False)
class EnergyUse:
    """The power, W, of flight and relay at the times `t` (n,), s, and what was used by then, Wh.

    `battery` is the plan's, if it has one; `lands` is whether the flight ends on the ground;
    `least_power`, W, is that of flight and relay at the airspeed of least power.
    """

    t: Real
    power: Real
    used: Real
    battery: Battery | None
    lands: bool
    least_power: float

    @property
    def total(self) -> float:
        """What the whole flight takes, Wh."""
        return float(self.used[-1])

    @property
    def left(self) -> float | None:
        """The share of the battery that is left at the end; None without a battery."""
        return None if self.battery is None else 1 - self.total / self.battery.capacity_wh

    def as_dict(self) -> dict[str, Any]:
        """Return the object `energy` of `--json`: Wh, W, a share."""
        return {
            "used_wh": self.total,
            "mean_power_w": float(self.total * JOULES_PER_WH / self.t[-1]),
            "capacity_wh": self.battery.capacity_wh if self.battery else None,
            "reserve": self.battery.reserve / 100 if self.battery else None,
            "left": self.left,
            "lands": self.lands,
        }


def energy_use(
    plan: Plan, t: Real, velocity: Real, wind: Vector, *, lands: bool = True
) -> EnergyUse | None:
    """Return what a flight of `plan` takes; None without a power model.

    Its `velocity` (n, 3), m/s at `t` (n,), s, is that over ground; the air moves with `wind`, m/s.
    The relay's transmit power counts for as long as the flight lasts.
    """
    model, relay = plan.power_model, plan.radio.relay.power
    if model is None or len(t) < 2:
        return None
    air = velocity - np.array([*wind, 0.0])
    power = model(air, np.gradient(air, t, axis=0)) + relay
    steps = np.diff(t) * (power[1:] + power[:-1]) / 2
    used = np.concatenate([[0.0], np.cumsum(steps)]) / JOULES_PER_WH
    least = least_power(model, _AIRSPEEDS)[1] + relay
    return EnergyUse(t, power, used, plan.vehicle.battery, lands, least)
