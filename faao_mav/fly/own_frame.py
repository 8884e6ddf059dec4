"""Setpoints in the vehicle's own local frame, from those about the plan's origin."""

import numpy as np

from faao_mav.arrays import Real
from faao_mav.autopilot import AutopilotFamily
from faao_mav.fly.course import Setpoint
from faao_mav.geodesy import LocalFrame
from faao_mav.plan.sections import Origin
from faao_mav.wire.messages import (
    GlobalPositionInt,
    GpsGlobalOrigin,
    SetPositionTargetLocalNed,
)
from faao_mav.wire.protocol import Address

LOCAL_NED = 1
"""MAV_FRAME_LOCAL_NED."""

_NO_YAW = 1 << 10 | 1 << 11
"""POSITION_TARGET_TYPEMASK: yaw and yaw rate are ignored, all else counts."""

_HOME_MOVED = 1.0
"""Metres by which home has to rise or fall in flight to be told; chosen."""


class OwnFrame:
    """The frame of an autopilot of `family`; `plan_origin` is the plan's, and the vehicle's home.

    `origin` is where its own frame has its origin, None until it tells. Heights are above home as
    the vehicle tells it, and from `depart` on above home as it was then: home may be set anew in
    flight, and the ground stays where it is.
    """

    def __init__(self, family: AutopilotFamily, plan_origin: Origin) -> None:
        self._family = family
        self._plans = LocalFrame(plan_origin.latitude, plan_origin.longitude)
        self.origin: GpsGlobalOrigin | None = None
        self._departed_from: int | None = None
        self._news_told = False

    def depart(self, position: GlobalPositionInt) -> None:
        """Keep to the home of a vehicle that departs from `position`."""
        self._departed_from = position.alt - position.relative_alt

    def news(self, position: GlobalPositionInt) -> str | None:
        """Return in words, once, that home is at another height now than at the departure."""
        risen = (position.alt - position.relative_alt - self._home(position)) / 1000
        if abs(risen) <= _HOME_MOVED or self._news_told:
            return None
        self._news_told = True
        return f"home is {risen:+.0f} m higher now: setpoints keep to that of the departure"

    def _home(self, position: GlobalPositionInt) -> int:
        """Return the altitude of home above sea, mm."""
        told = position.alt - position.relative_alt
        return told if self._departed_from is None else self._departed_from

    def place(self, position: GlobalPositionInt) -> Real:
        """Return where it is: (3,) m east, north, up of the plan's origin, which is its home."""
        level = self._plans.to_local(position.lat / 1e7, position.lon / 1e7)
        return np.append(level, (position.alt - self._home(position)) / 1000)

    def message(
        self, setpoint: Setpoint, position: GlobalPositionInt, target: Address
    ) -> SetPositionTargetLocalNed:
        """Return `setpoint` for the vehicle `target` that has told its `position`."""
        assert self.origin is not None
        own = self._family.local_frame(self.origin.latitude / 1e7, self.origin.longitude / 1e7)
        p, v, a = setpoint
        east, north = own.to_local(*self._plans.to_geodetic(p[:2]))
        home = (self._home(position) - self.origin.altitude) / 1000
        values = (north, east, -(p[2] + home), v[1], v[0], -v[2], a[1], a[0], -a[2])
        return SetPositionTargetLocalNed(
            target, position.time_boot_ms, LOCAL_NED, _NO_YAW, *map(float, values)
        )
