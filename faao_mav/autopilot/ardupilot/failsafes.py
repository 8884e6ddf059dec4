"""What ArduCopter and ArduPlane do by themselves on a loss.

Source: ArduPilot's lists of parameters and events of Copter and Plane 4.1 to 4.7.
"""

from collections.abc import Sequence

from faao_mav.autopilot.failsafe import Action, Failsafe

_RETURN, _LAND = "returns (RTL)", "lands where it is"
_SMART = "returns the way that it came (SmartRTL)"
_SEQUENCE = "flies to the mission's landing (DO_LAND_START), or returns"
_BRAKE = "brakes and holds, or lands"
_AUTOLAND = "lands by itself (AUTOLAND), or returns"

_COPTER_RC = (_RETURN, _RETURN, _LAND, _SMART, _SMART, _SEQUENCE, _BRAKE)
_COPTER_STATION = (_RETURN, _RETURN, _SMART, _SMART, _LAND, _SEQUENCE, _BRAKE)
_TERMINATES = "stops its motors (terminates)"
_COPTER_BATTERY = (_LAND, _RETURN, _SMART, _SMART, _TERMINATES, _SEQUENCE, _BRAKE)
_PLANE_BATTERY = (
    _RETURN,
    _SEQUENCE,
    "terminates the flight",
    "lands as a VTOL",
    "releases its parachute",
    "loiters, then lands as a VTOL",
    _AUTOLAND,
)
_COPTER_POSITION = (_LAND, "keeps its height and drifts (ALT_HOLD: sticks fly it)", _LAND)

_PLANE_LONG = Action(
    "FS_LONG_ACTN",
    (_RETURN, "glides", "releases its parachute", "flies its mission (AUTO)", _AUTOLAND),
    idle=(0, 4),
    after="FS_LONG_TIMEOUT",
)
_LONG = {"FS_LONG_ACTN": 0, "FS_LONG_TIMEOUT": 5.0}


def _battery(actions: Sequence[str]) -> Failsafe:
    """Return what it does at two levels; with BATT_MONITOR 0 it has none of the others."""
    stages = [
        Action(
            f"BATT_FS_{level}_ACT",
            actions,
            below={f"BATT_{level}_VOLT": "V", f"BATT_{level}_MAH": "mAh left"},
            when=when,
        )
        for level, when in (("LOW", ""), ("CRT", "when critical "))
    ]
    limits = {name: 0 for each in stages for name in (*each.below, each.decides)}
    return Failsafe(
        "battery low",
        {"BATT_MONITOR": 0, **limits, "BATT_LOW_VOLT": 10.5, "BATT_CRT_VOLT": 0.0},
        tuple(stages),
        off={"BATT_MONITOR": (0,)},
    )


COPTER_FAILSAFES = (
    Failsafe(
        "RC lost",
        {"FS_THR_ENABLE": 1, "FS_OPTIONS": 16},
        (Action("FS_THR_ENABLE", _COPTER_RC),),
        exceptions=("FS_OPTIONS", 1, 4),
    ),
    Failsafe(
        "ground station lost",
        {"FS_GCS_ENABLE": 0, "FS_OPTIONS": 16, "FS_GCS_TIMEOUT": 5.0},
        (Action("FS_GCS_ENABLE", _COPTER_STATION, after="FS_GCS_TIMEOUT"),),
        exceptions=("FS_OPTIONS", 2, 0),
        absent={"FS_GCS_TIMEOUT": 5.0},
    ),
    _battery(_COPTER_BATTERY),
    Failsafe("position lost", {"FS_EKF_ACTION": 1}, (Action("FS_EKF_ACTION", _COPTER_POSITION),)),
)
"""ArduCopter's."""

PLANE_FAILSAFES = (
    Failsafe("RC lost", {"THR_FAILSAFE": 1, **_LONG}, (_PLANE_LONG,), off={"THR_FAILSAFE": (0, 2)}),
    Failsafe(
        "ground station lost",
        {"FS_GCS_ENABL": 0, **_LONG},
        (_PLANE_LONG,),
        off={"FS_GCS_ENABL": (0,)},
    ),
    _battery(_PLANE_BATTERY),
)
"""ArduPlane's."""
