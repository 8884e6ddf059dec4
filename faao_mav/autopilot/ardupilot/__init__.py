"""ArduPilot: what its copters and planes share; and their dialects, of items kept in 15 bytes."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial

import numpy as np
from numpy.typing import ArrayLike

from faao_mav.arrays import Real
from faao_mav.autopilot.dialect import (
    Dialect,
    Limit,
    SpeedAxis,
    SpeedChange,
    commands_of,
    dropped,
    int16,
    uint8,
)
from faao_mav.autopilot.manners import FenceAction, Manners, SetpointRules, meanings_of
from faao_mav.autopilot.parameter import ParameterValues
from faao_mav.autopilot.vehicle_type import AutopilotFamily, FenceResponse, RallyRule, VehicleType
from faao_mav.geodesy import LocalFrame
from faao_mav.mission.command import LANDINGS, Command, Frame
from faao_mav.mission.item import MissionItem

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
        request_period=1.0, patience=8.0, any_request_order=True, meanings=meanings_of("ardupilot")
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


ardupilot_type = partial(
    VehicleType,
    family=ARDUPILOT,
    spool=3.5,  # measured: 100 m of take-off take 46 s
    fence_needs_one_inclusion=lambda vehicle: int(vehicle.value("fence_options")) & _UNION != 0,
    home_outside_fence="with FENCE_ENABLE 1 ArduPilot does not arm there",  # measured on 4.7
    models_wind=True,
    rally=lambda vehicle: RallyRule(  # AP_Rally
        limit if (limit := vehicle.value("rally_limit")) > 0 else math.inf,
        vehicle.value("rally_home") != 0,
    ),
)
"""Makes the `VehicleType` of what ArduPilot flies."""

_HIGHEST = 83_000.0  # The altitude from which on items are refused, m. Read in AP_Mission.

_CONTINUE_AFTER_LAND = 4
"""The bit of MIS_OPTIONS by which a take-off behind a landing is flown. Measured on ArduCopter 4.7:
without it the mission ends there, and with it before any other item too."""


def _altitude(value: float) -> float:
    """Whole centimetres."""
    centimetres = int(np.float32(min(max(value, -_HIGHEST), _HIGHEST)) * np.float32(100))
    return float(np.float32(centimetres) * np.float32(0.01))


_SEA, _HOME, _TERRAIN = Frame.GLOBAL, Frame.GLOBAL_RELATIVE_ALT, Frame.GLOBAL_TERRAIN_ALT
_FRAMES = {0: _SEA, 2: _SEA, 3: _HOME, 5: _SEA, 6: _HOME, 10: _TERRAIN, 11: _TERRAIN}

_YAW = dict.fromkeys(
    (Command.NAV_WAYPOINT, Command.NAV_LAND, Command.NAV_TAKEOFF, Command.NAV_VTOL_TAKEOFF), (3,)
)

_COPTER_SPEEDS: dict[float, SpeedAxis] = dict(
    enumerate(("horizontal", "horizontal", "climb", "descent"))
)
_PLANE_SPEEDS: dict[float, SpeedAxis] = {0: "airspeed", 1: "least ground speed"}
_PLANE_DEFAULT = -2.0  # The airspeed of a DO_CHANGE_SPEED that stands for the plane's own, m/s.


def _speed_change(item: MissionItem, axes: Mapping[float, SpeedAxis]) -> SpeedChange | None:
    axis, speed = axes.get(uint8(item.params[0])), item.params[1]
    if axis == "airspeed" and speed == _PLANE_DEFAULT:
        return SpeedChange(axis, None)
    return SpeedChange(axis, speed) if axis is not None and speed > 0 else None


def _dialect(name: str, most: int, axes: Mapping[float, SpeedAxis]) -> Dialect:
    placed, unplaced = commands_of(name.lower())
    return Dialect(
        name=name,
        home_row=True,
        items=Limit(650, most),  # 655 in simulation
        jumps=Limit(15, 100),
        fence_rows=84,
        rally_rows=10,
        atomic=False,
        unset_is_zero=True,
        zero_means_here=True,
        placed=placed,
        unplaced=unplaced,
        frames=_FRAMES,
        idle_frames=dict.fromkeys(range(256), Frame.GLOBAL),
        may_be_unset=_YAW | {Command.NAV_VTOL_LAND: (2, 3)},
        altitude=_altitude,
        fence_altitude=dropped,
        rally_altitude=int16,
        highest=_HIGHEST,
        always_continues=True,
        keeps_idle=False,
        speed_change=lambda item: _speed_change(item, axes),
        unlimited=lambda values: values.value("sd_storage") > 0,
        endings=LANDINGS | {Command.NAV_LOITER_UNLIM, Command.NAV_RETURN_TO_LAUNCH},
        flies_on=lambda values: bool(int(values.value("mission_options")) & _CONTINUE_AFTER_LAND),
        make_room="set BRD_SD_MISSION to store missions on the card",
    )


COPTER_DIALECT = _dialect("ArduCopter", 718, _COPTER_SPEEDS)
PLANE_DIALECT = _dialect("ArduPlane", 724, _PLANE_SPEEDS)
