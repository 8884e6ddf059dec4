"""ArduPilot: what ArduCopter and ArduPlane share."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import ArrayLike

from faao_mav.arrays import Real
from faao_mav.autopilot.manners import FenceAction, Manners, SetpointRules
from faao_mav.autopilot.orbit import RallyRule
from faao_mav.autopilot.parameter import ParameterValues, rule
from faao_mav.autopilot.vehicle_type import AutopilotFamily, FenceResponse, VehicleType
from faao_mav.geodesy import LocalFrame

_DEGREE = 111_318.84502145034
"""ArduPilot's degree of latitude, m; times the cosine of the latitude one of longitude."""


@dataclass(frozen=True, slots=True)
class FlatFrame(LocalFrame):
    """ArduPilot's flat Earth: degrees times a length, those of longitude shrunk by cos(latitude).

    The latitude is the mean of the position's and the origin's. Over 500 m that is up to 2 m from
    WGS84.

    >>> frame = FlatFrame(-35.363262, 149.165237)
    >>> frame.to_local(-35.360107, 149.165237).round(2)
    array([  0.  , 351.21])
    """

    def to_local(self, latitude: ArrayLike, longitude: ArrayLike) -> Real:
        """Return positions (..., 2) in metres."""
        lat, turned = np.asarray(latitude, dtype=float), np.asarray(longitude) - self.longitude
        east = self._shrunk(lat) * ((turned + 180) % 360 - 180)
        return _DEGREE * np.stack([east, lat - self.latitude], axis=-1)

    def to_geodetic(self, positions: ArrayLike) -> tuple[Real, Real]:
        """Return latitude and longitude in degrees."""
        east, north = np.moveaxis(np.asarray(positions, dtype=float) / _DEGREE, -1, 0)
        lat = self.latitude + north
        return lat, (self.longitude + east / self._shrunk(lat) + 180) % 360 - 180

    def _shrunk(self, latitude: Real) -> Real:
        return np.asarray(np.cos(np.radians((latitude + self.latitude) / 2)))


ARDUPILOT = AutopilotFamily(
    key="ardupilot",
    name="ArduPilot",
    mav_autopilot=3,
    parameter_suffix=".param",
    parameter_style="list",
    parameter_prefixes=("WPNAV_", "WP_", "ATC_", "PSC_", "ARMING_"),
    manners=Manners(
        request_period=1.0,
        patience=8.0,
        any_request_order=True,
        meanings={
            "ERROR": (
                "no transfer under way, an item beyond the list, or a change of the mission that "
                "it is flying"
            ),
            "INVALID": "command 0 or 1",
            "UNSUPPORTED": (
                "a command that this vehicle does not know, or fence and rally points over "
                "MAVLink 1"
            ),
            "DENIED": "another ground station is uploading",
        },
    ),
    setpoints=SetpointRules(
        "GUID_TIMEOUT",
        least_timeout=0.1,
        most_timeout=1.0,  # at 8 m/s it flies 24 m on with its default
        carries_on=True,
        defaults={"GUID_TIMEOUT": 3.0},
    ),
    local_frame=FlatFrame,
    mavlink_2="SERIALn_PROTOCOL 2",
    only_one_station=(
        "where it takes orders of only MAV_GCS_SYSID (SYSID_ENFORCE, MAV_OPTIONS), give that "
        "number: --own-system"
    ),
)
"""Manners: `MissionItemProtocol.cpp` (behaviour only), and what it did in its simulator."""

_UNION = 2  # The bit of FENCE_OPTIONS by which being inside one of several inclusions is enough.
_AREAS = 4  # The bit of FENCE_TYPE by which the areas of a fence count.


def at_fence(actions: Mapping[int, FenceAction]) -> Callable[[ParameterValues], FenceResponse]:
    """Return what a vehicle does at its fence that takes FENCE_ACTION for `actions`.

    Numbers that are not among them make it return: each has that in its name.
    """

    def response(vehicle: ParameterValues) -> FenceResponse:
        if vehicle.value("fence_enable") == 0:
            return FenceResponse("nothing", "fence_enable", "1")
        kinds = int(vehicle.value("fence_type"))
        if not kinds & _AREAS:
            return FenceResponse("nothing", "fence_type", f"{kinds | _AREAS}")
        action = actions.get(int(vehicle.value("fence_action")), "return")
        return FenceResponse(action, "fence_action", "1" if action == "report" else "")

    return response


SHARED = (
    rule("arming_items", 0, "ARMING_MIS_ITEMS"),
    rule("fence_enable", 0, "FENCE_ENABLE"),
    rule("fence_action", 1, "FENCE_ACTION"),
    rule("fence_margin", 2.0, "FENCE_MARGIN", "m"),
    rule("fence_ceiling", 100.0, "FENCE_ALT_MAX", "m"),
    rule("fence_floor", -10.0, "FENCE_ALT_MIN", "m"),
    rule("fence_radius", 300.0, "FENCE_RADIUS", "m"),
    rule("sd_storage", 0, "BRD_SD_MISSION"),
    rule("terrain_enable", 1, "TERRAIN_ENABLE"),
    rule("mission_options", 0, "MIS_OPTIONS"),
)
"""Arming, fence, storage and terrain. Each vehicle has defaults of its own for FENCE_OPTIONS and
FENCE_TYPE, whose bits are 1 ceiling, 2 circle, 4 areas, 8 floor. Source: ArduPilot 4.7."""


def _rally_rule(vehicle: ParameterValues) -> RallyRule:
    """Return where a return goes (ArduPilot 4.7, AP_Rally)."""
    limit = vehicle.value("rally_limit")
    return RallyRule(limit if limit > 0 else math.inf, vehicle.value("rally_home") != 0)


ardupilot_type = partial(
    VehicleType,
    family=ARDUPILOT,
    spool=3.5,  # measured: 100 m of take-off take 46 s
    fence_needs_one_inclusion=lambda vehicle: int(vehicle.value("fence_options")) & _UNION != 0,
    home_outside_fence="with FENCE_ENABLE 1 ArduPilot does not arm there",  # measured on 4.7
    models_wind=True,
    rally=_rally_rule,
)
"""Makes the `VehicleType` of what ArduPilot flies."""
