"""ArduPilot, whatever it flies."""

from faao_mav.vehicle.parameter import ParameterValues
from faao_mav.vehicle.vehicle_type import AutopilotFamily

ARDUPILOT = AutopilotFamily(
    key="ardupilot",
    name="ArduPilot",
    mav_autopilot=3,
    parameter_suffix=".param",
    parameter_style="list",
    parameter_prefixes=("WPNAV_", "WP_", "ATC_", "PSC_", "ARMING_"),
)

_UNION = 2
"""The bit of FENCE_OPTIONS by which being inside one of several inclusions is enough."""


def needs_one_inclusion(vehicle: ParameterValues) -> bool:
    """Tell whether being inside one of several inclusion areas is enough for `vehicle`."""
    return bool(int(vehicle.value("fence_options")) & _UNION)
