"""The power that flight takes, W, as a function of velocity: rotary and fixed wings.

Rotary wings (Zeng, Xu and Zhang, "Energy Minimization for Wireless Communication With Rotary-Wing
UAV", IEEE TWC 2019, (12)), at the airspeed v:

    P(v) = P_0 (1 + 3 v^2 / U^2) + P_i ((1 + v^4 / (4 v_0^4))^(1/2) - v^2 / (2 v_0^2))^(1/2)
           + d_0 rho s A v^3 / 2

are blade profile, induced and parasite power. Fixed wings (Zeng and Zhang, "Energy-Efficient UAV
Communication With Trajectory Optimization", IEEE TWC 2017, (7)), with the acceleration a across v:

    P(v, a) = c_1 v^3 + (c_2 / v) (1 + a^2 / g^2)

Both are for level flight. Climbing and gaining speed cost the growth of potential and, for fixed
wings, of kinetic energy; what is set free by descending and slowing is lost. So that flights can be
optimised, `partials` are the derivatives of the power of level flight.
"""

from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np

from faao_mav.arrays import Real, products

GRAVITY = 9.80665
"""Standard gravity, m/s^2."""

JOULES_PER_WH = 3600.0
"""Joules of a watt-hour."""

_PROFILE_DRAG = 0.012
"""Profile drag coefficient delta of the blades, by the table of 2019."""

_INDUCED_FACTOR = 0.1
"""Share k by which the induced power is above that of an ideal rotor, by the table of 2019."""

_LEAST_AIRSPEED = 1.0
"""Airspeed below which a fixed wing is not flying, m/s: c_2 / v is held there. Chosen."""


_KINK = 1.0
"""Half the width, W/kg, in which `partials` lets the growth of kinetic energy set in smoothly.

It is half of that too large at an even speed, and nowhere too small. Measured on a plane of 2.5 kg
and 90 W that circles for 32 s: with 0.02 no search converges in 300 steps, with 1 nearly all do.
"""

_STILL = 1e-9
"""The least airspeed that is divided by, m/s: far below any that is flown."""


@dataclass(frozen=True, slots=True)
class PowerPartials:
    """P, W (...), its gradients by v and a (2, ...) and its Hessians by each (3, ...): xx, xy, yy.

    `by_va` (2, 2, ...) are the second derivatives by v (first) and a.
    """

    value: Real
    by_v: Real
    by_a: Real
    by_vv: Real
    by_aa: Real
    by_va: Real


@dataclass(frozen=True, slots=True)
class RotaryWing:
    """P_0 and P_i, W, U and v_0, m/s, the parasite power's factor of v^3, W s^3/m^3, weight, N.

    >>> table = RotaryWing.of(mass=20 / GRAVITY, rotor_area=0.503, solidity=0.05, tip_speed=120.0,
    ...                       drag_ratio=0.6, air_density=1.225)
    >>> speeds = np.array([0.0, 10.0, 18.0])
    >>> table.level(speeds).round(1).tolist()
    [168.5, 126.0, 159.0]
    """

    blade: float
    induced: float
    tip_speed: float
    induced_speed: float
    parasite: float
    weight: float

    @classmethod
    def of(
        cls,
        *,
        mass: float,
        rotor_area: float,
        solidity: float,
        tip_speed: float,
        drag_ratio: float,
        air_density: float,
    ) -> "RotaryWing":
        """Return the model of an aircraft: kg, m^2, 1, m/s, 1, kg/m^3."""
        weight, swept = mass * GRAVITY, air_density * rotor_area
        return cls(
            blade=_PROFILE_DRAG / 8 * swept * solidity * tip_speed**3,
            induced=(1 + _INDUCED_FACTOR) * weight**1.5 / (2 * swept) ** 0.5,
            tip_speed=tip_speed,
            induced_speed=(weight / (2 * swept)) ** 0.5,
            parasite=drag_ratio * solidity * swept / 2,
            weight=weight,
        )

    def fitted(self, hover: float, cruise: float, speed: float) -> "RotaryWing":
        """Return the model of P(0) = `hover` and P(`speed`) = `cruise`, W.

        Blade profile and induced power keep their ratio and their speeds; the rest is parasite,
        which is negative where `cruise` is too little.
        """
        share = hover / (self.blade + self.induced)
        bare = replace(self, blade=share * self.blade, induced=share * self.induced, parasite=0.0)
        return replace(bare, parasite=(cruise - float(bare.level(np.array(speed)))) / speed**3)

    def level(self, speed: Real) -> Real:
        """Return P(v), W, at airspeeds of level flight, m/s."""
        ratio = speed**2 / (2 * self.induced_speed**2)
        # (1 + r^2)^(1/2) - r without the cancellation at high speeds
        inflow = np.sqrt(1 / (np.sqrt(1 + ratio**2) + ratio))
        profile = self.blade * (1 + 3 * speed**2 / self.tip_speed**2)
        return np.asarray(profile + self.induced * inflow + self.parasite * speed**3)

    def __call__(self, velocity: Real, acceleration: Real) -> Real:  # noqa: ARG002
        """Return W (...) at velocities through the air (..., 3), m/s; accelerations are free."""
        speed = np.linalg.norm(velocity[..., :2], axis=-1)
        return np.asarray(self.level(speed) + self.weight * np.maximum(0.0, velocity[..., 2]))

    def partials(self, v: Real, a: Real) -> PowerPartials:  # noqa: ARG002
        """Return what flight at v (2, ...), m/s, takes, with derivatives: those by a are 0."""
        speed = np.hypot(*v)
        # P as a function of q = v^2, and the inflow as one of r = q / (2 v_0^2)
        per_square = 1 / (2 * self.induced_speed**2)
        r = per_square * speed**2
        root = np.sqrt(1 + r**2)
        inflow = np.sqrt(1 / (root + r))
        first = 3 * self.blade / self.tip_speed**2 + 1.5 * self.parasite * speed
        first -= self.induced * per_square * inflow / (2 * root)
        second = 0.75 * self.parasite / np.maximum(speed, _STILL)
        second += self.induced * per_square**2 * inflow * (1 / root**2 + 2 * r / root**3) / 4
        by_vv = 4 * second * products(v, v)
        by_vv[::2] += 2 * first
        none = np.zeros((2, *v.shape))
        return PowerPartials(self.level(speed), 2 * first * v, 0 * v, by_vv, 0 * by_vv, none)


@dataclass(frozen=True, slots=True)
class FixedWing:
    """c_1, W s^3/m^3, c_2, W m/s, and the mass, kg.

    >>> float(FixedWing(9.26e-4, 2250.0, 10.0).level(np.array(30.0), np.array(0.0)).round(1))
    100.0
    """

    c1: float
    c2: float
    mass: float

    @classmethod
    def fitted(cls, cruise: float, speed: float, mass: float) -> "FixedWing":
        """Return the model of least energy per metre at `speed`, where it takes `cruise`, W."""
        return cls(cruise / (2 * speed**3), cruise * speed / 2, mass)

    def level(self, speed: Real, across: Real | float = 0.0) -> Real:
        """Return P(v, a), W, at airspeeds and accelerations across them, m/s, m/s^2."""
        lift = self.c2 / np.maximum(speed, _LEAST_AIRSPEED)
        return np.asarray(self.c1 * speed**3 + lift * (1 + (across / GRAVITY) ** 2))

    def __call__(self, velocity: Real, acceleration: Real) -> Real:
        """Return W (...) at velocities through the air and accelerations (..., 3), m/s, m/s^2."""
        v, a = velocity[..., :2], acceleration[..., :2]
        speed = np.linalg.norm(v, axis=-1)
        across = np.abs(v[..., 0] * a[..., 1] - v[..., 1] * a[..., 0])
        gained = (v * a).sum(axis=-1) + GRAVITY * velocity[..., 2]
        turning = across / np.maximum(speed, _LEAST_AIRSPEED)
        return np.asarray(self.level(speed, turning) + self.mass * np.maximum(0.0, gained))

    def partials(self, v: Real, a: Real) -> PowerPartials:
        """Return what flight at v and a (2, ...), m/s, m/s^2, takes at most, with derivatives."""
        speed = np.maximum(np.hypot(*v), _LEAST_AIRSPEED)
        across = v[0] * a[1] - v[1] * a[0]
        by_turn = np.stack([a[1], -a[0]])  # the gradients of across
        turned = np.stack([-v[1], v[0]])
        bank = self.c2 / GRAVITY**2 / speed**3
        gained = (v * a).sum(axis=0)
        root = np.hypot(gained, _KINK)
        share, curved = (1 + gained / root) / 2, _KINK**2 / (2 * root**3)
        along = 3 * self.c1 * speed - self.c2 / speed**3 - 3 * bank * across**2 / speed**2
        by_v = along * v + 2 * bank * across * by_turn + self.mass * share * a
        by_a = 2 * bank * across * turned + self.mass * share * v
        outward = 3 * self.c1 / speed + 3 * self.c2 / speed**5 + 15 * bank * across**2 / speed**4
        by_vv = outward * products(v, v) + 2 * bank * products(by_turn, by_turn)
        by_vv -= 12 * bank * across / speed**2 * products(v, by_turn)
        by_vv += self.mass * curved * products(a, a)
        by_vv[::2] += along
        by_aa = 2 * bank * products(turned, turned) + self.mass * curved * products(v, v)
        outer = by_turn - 3 * across / speed**2 * v
        by_va = 2 * bank * outer[:, None] * turned + self.mass * curved * a[:, None] * v
        by_va[0, 0] += self.mass * share
        by_va[1, 1] += self.mass * share
        by_va[0, 1] += 2 * bank * across
        by_va[1, 0] -= 2 * bank * across
        value = self.level(speed, across / speed) + self.mass * (gained + root) / 2
        return PowerPartials(value, by_v, by_a, by_vv, by_aa, by_va)


PowerModel: TypeAlias = RotaryWing | FixedWing
"""What tells the power, W, that a flight takes: of a rotary wing or of a fixed one."""


def least_power(model: PowerModel, speeds: Real) -> tuple[float, float]:
    """Return the one of the `speeds`, m/s, of least power in straight level flight, and that, W."""
    powers = model.level(speeds)
    least = int(powers.argmin())
    return float(speeds[least]), float(powers[least])
