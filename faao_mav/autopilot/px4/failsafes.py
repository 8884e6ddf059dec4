"""What PX4 does by itself on a loss.

Source: PX4 1.14 to 1.16: parameter reference, and the module commander (behaviour of its
failsafes).
"""

from faao_mav.autopilot.failsafe import Action, Failsafe

_LINK = (
    "holds its place",
    "returns",
    "lands where it is",
    "",
    "terminates the flight",
    "stops its motors",
)
_BATTERY = (
    "returns at {BAT_CRIT_THR:g} of its charge",
    "lands where it is at {BAT_CRIT_THR:g} of its charge",
    "returns at {BAT_CRIT_THR:g} of its charge, lands where it is at {BAT_EMERGEN_THR:g}",
)

FAILSAFES = (
    Failsafe(
        "RC lost",
        {"NAV_RCL_ACT": 2, "COM_RC_LOSS_T": 0.5, "COM_RCL_EXCEPT": 0, "COM_RC_IN_MODE": 3},
        (Action("NAV_RCL_ACT", _LINK, after="COM_RC_LOSS_T"),),
        off={"COM_RC_IN_MODE": (4,)},
        exceptions=("COM_RCL_EXCEPT", 1, 4),
    ),
    Failsafe(
        "ground station lost",
        {"NAV_DLL_ACT": 0, "COM_DL_LOSS_T": 10, "COM_DLL_EXCEPT": 0},
        (Action("NAV_DLL_ACT", _LINK, after="COM_DL_LOSS_T"),),
        exceptions=("COM_DLL_EXCEPT", 1, 4),
        absent={"COM_DLL_EXCEPT": 0},
    ),
    Failsafe(
        "battery low",
        {"COM_LOW_BAT_ACT": 0, "BAT_CRIT_THR": 0.07, "BAT_EMERGEN_THR": 0.05},
        (Action("COM_LOW_BAT_ACT", _BATTERY),),
    ),
    Failsafe("position lost", {}, always="descends where it is and drifts with the wind"),
)
"""PX4's, of copters and planes."""
