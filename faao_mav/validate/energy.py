"""What a predicted mission takes from the battery, from the climb to the landing."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from faao_mav.arrays import Real
from faao_mav.plan import Plan, Vector
from faao_mav.plan.energy import Battery
from faao_mav.power import JOULES_PER_WH

_AIRSPEEDS = np.linspace(0.0, 100.0, 1001)
"""The airspeeds, m/s, of which one has the least power. Chosen: all that are flown."""


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
    least = model.least_power(_AIRSPEEDS)[1] + relay
    return EnergyUse(t, power, used, plan.vehicle.battery, lands, least)
