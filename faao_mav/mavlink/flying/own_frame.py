"""Setpoints in the vehicle's own local frame, from those about the plan's origin."""

import numpy as np

from faao_mav.arrays import Real
from faao_mav.geodesy import LocalFrame
from faao_mav.mavlink.flying.course import Setpoint
from faao_mav.mavlink.local_frame import frame_of
from faao_mav.mavlink.messages import (
    GlobalPositionInt,
    GpsGlobalOrigin,
    SetPositionTargetLocalNed,
)
from faao_mav.mavlink.protocol import Address
from faao_mav.plan.sections import Origin
from faao_mav.vehicle import AutopilotFamily

LOCAL_NED = 1
"""MAV_FRAME_LOCAL_NED."""

_NO_YAW = 1 << 10 | 1 << 11
"""POSITION_TARGET_TYPEMASK: yaw and yaw rate are ignored, all else counts."""


class OwnFrame:
    """The frame of an autopilot of `family`; `plan_origin` is the plan's, and the vehicle's home.

    `origin` is where its own frame has its origin, None until it tells.
    """

    def __init__(self, family: AutopilotFamily, plan_origin: Origin) -> None:
        self._family = family
        self._plans = LocalFrame(plan_origin.latitude, plan_origin.longitude)
        self.origin: GpsGlobalOrigin | None = None

    def place(self, position: GlobalPositionInt) -> Real:
        """Return where it is: (3,) m east, north, up of the plan's origin, which is its home."""
        level = self._plans.to_local(position.lat / 1e7, position.lon / 1e7)
        return np.append(level, position.relative_alt / 1000)

    def message(
        self, setpoint: Setpoint, position: GlobalPositionInt, target: Address
    ) -> SetPositionTargetLocalNed:
        """Return `setpoint` for the vehicle `target` that has told its `position`."""
        assert self.origin is not None
        own = frame_of(self._family, self.origin.latitude / 1e7, self.origin.longitude / 1e7)
        p, v, a = setpoint
        east, north = own.to_local(*self._plans.to_geodetic(p[:2]))
        home = (position.alt - position.relative_alt - self.origin.altitude) / 1000
        values = (north, east, -(p[2] + home), v[1], v[0], -v[2], a[1], a[0], -a[2])
        return SetPositionTargetLocalNed(
            target, position.time_boot_ms, LOCAL_NED, _NO_YAW, *map(float, values)
        )
