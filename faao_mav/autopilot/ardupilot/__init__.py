"""ArduPilot: what ArduCopter and ArduPlane share."""

import math
from collections.abc import Callable, Mapping

from faao_mav.autopilot.orbit import RallyRule
from faao_mav.autopilot.parameter import Parameter, ParameterValues
from faao_mav.autopilot.vehicle_type import AutopilotFamily, FenceAction, FenceResponse

ARDUPILOT = AutopilotFamily(
    key="ardupilot",
    name="ArduPilot",
    mav_autopilot=3,
    parameter_suffix=".param",
    parameter_style="list",
    parameter_prefixes=("WPNAV_", "WP_", "ATC_", "PSC_", "ARMING_"),
)

DEGREE = 111_318.84502145034
"""ArduPilot's degree of latitude, m; times the cosine of the latitude one of longitude."""

HOME_OUTSIDE_FENCE = "with FENCE_ENABLE 1 ArduPilot does not arm there"
"""Measured on ArduCopter and ArduPlane 4.7."""

_UNION = 2
"""The bit of FENCE_OPTIONS by which being inside one of several inclusions is enough."""


def needs_one_inclusion(vehicle: ParameterValues) -> bool:
    """Tell whether being inside one of several inclusion areas is enough for `vehicle`."""
    return bool(int(vehicle.value("fence_options")) & _UNION)


_AREAS = 4
"""The bit of FENCE_TYPE by which the areas of a fence count."""


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


SOURCE = "ArduPilot 4.7: parameter lists of Copter and Plane"


def switch(key: str, default: float, name: str, unit: str = "") -> Parameter:
    """Return a parameter of checks, fence or return, with one name in all generations."""
    return Parameter(key, unit, default, {name: 1.0}, source=SOURCE, motion=False)


SHARED = (
    switch("arming_items", 0, "ARMING_MIS_ITEMS"),
    switch("fence_enable", 0, "FENCE_ENABLE"),
    switch("fence_action", 1, "FENCE_ACTION"),
    switch("fence_margin", 2.0, "FENCE_MARGIN", "m"),
    switch("fence_ceiling", 100.0, "FENCE_ALT_MAX", "m"),
    switch("fence_floor", -10.0, "FENCE_ALT_MIN", "m"),
    switch("fence_radius", 300.0, "FENCE_RADIUS", "m"),
    switch("sd_storage", 0, "BRD_SD_MISSION"),
    switch("terrain_enable", 1, "TERRAIN_ENABLE"),
    switch("mission_options", 0, "MIS_OPTIONS"),
)
"""Arming, fence, storage and terrain. Each vehicle has defaults of its own for FENCE_OPTIONS and
FENCE_TYPE, whose bits are 1 ceiling, 2 circle, 4 areas, 8 floor."""


def rally_parameters(limit: float, home: float) -> tuple[Parameter, ...]:
    """Return what decides between home and rally points, with these defaults.

    `rally_limit` is how far the autopilot looks for a rally point, m, 0: any distance;
    `rally_home` whether home is one of the places to choose from.
    """
    names = {"RALLY_LIMIT_KM": 1000.0}
    return (
        Parameter("rally_limit", "m", limit, names, source=SOURCE, motion=False),
        switch("rally_home", home, "RALLY_INCL_HOME"),
    )


def rally_rule(vehicle: ParameterValues) -> RallyRule:
    """Return where a return goes (ArduPilot 4.7, AP_Rally)."""
    limit = vehicle.value("rally_limit")
    return RallyRule(limit if limit > 0 else math.inf, vehicle.value("rally_home") != 0)
