"""What ArduCopter and ArduPlane do by themselves on a loss.

Source: ArduPilot's lists of parameters and events of Copter and Plane 4.1 to 4.7.
"""

from collections.abc import Callable, Mapping

from faao_mav.autopilot.failsafe import Failsafe, Response, Values, chosen, setting

_RETURN, _LAND = "returns (RTL)", "lands where it is"
_SMART = "returns the way that it came (SmartRTL)"
_SEQUENCE = "flies to the mission's landing (DO_LAND_START), or returns"
_BRAKE = "brakes and holds, or lands"

_COPTER_RC = {
    **dict.fromkeys((1, 2), _RETURN),
    3: _LAND,
    **dict.fromkeys((4, 5), _SMART),
    6: _SEQUENCE,
    7: _BRAKE,
}
_COPTER_STATION = {
    **dict.fromkeys((1, 2), _RETURN),
    **dict.fromkeys((3, 4), _SMART),
    5: _LAND,
    6: _SEQUENCE,
    7: _BRAKE,
}
_COPTER_BATTERY = {
    1: _LAND,
    2: _RETURN,
    **dict.fromkeys((3, 4), _SMART),
    5: "stops its motors (terminates)",
    6: _SEQUENCE,
    7: _BRAKE,
}
_PLANE_BATTERY = {
    1: _RETURN,
    2: _SEQUENCE,
    3: "terminates the flight",
    4: "lands as a VTOL",
    5: "releases its parachute",
    6: "loiters, then lands as a VTOL",
    7: "lands by itself (AUTOLAND), or returns",
}
_PLANE_LONG = {
    0: "flies its mission on",
    1: _RETURN,
    2: "glides",
    3: "releases its parachute",
    4: "flies its mission (AUTO)",
    5: "lands by itself (AUTOLAND), or returns",
}

_CONTINUE_RC_AUTO, _CONTINUE_STATION_AUTO, _CONTINUE_RC_GUIDED = 1, 2, 4
"""Bits of FS_OPTIONS: to fly on in AUTO without RC, in AUTO without a ground station, and in GUIDED
without RC."""


def _goes_on(values: Values, bit: int) -> Response | None:
    """Return that it flies on, where a bit of FS_OPTIONS says so."""
    if int(values["FS_OPTIONS"]) & bit:
        return Response(f"flies on ({setting('FS_OPTIONS', values)})", acts=False)
    return None


def _copter_rc(values: Values, streamed: bool) -> Response:
    acts = chosen("FS_THR_ENABLE", values, _COPTER_RC)
    bit = _CONTINUE_RC_GUIDED if streamed else _CONTINUE_RC_AUTO
    return (_goes_on(values, bit) or acts) if acts.acts else acts


def _copter_station(values: Values, streamed: bool) -> Response:
    acts = chosen("FS_GCS_ENABLE", values, _COPTER_STATION)
    if not acts.acts:
        return acts
    if not streamed and (goes_on := _goes_on(values, _CONTINUE_STATION_AUTO)):
        return goes_on
    return Response(f"{acts.text} after {values['FS_GCS_TIMEOUT']:g} s")


def _battery(actions: Mapping[int, str]) -> Callable[[Values, bool], Response]:
    def response(values: Values, _: bool) -> Response:
        if values["BATT_MONITOR"] == 0:
            return Response("not known: it measures none (BATT_MONITOR 0)", acts=False)
        told, acts = [], False
        for stage, level in (("LOW", ""), ("CRT", "when critical ")):
            volts, charge = values[f"BATT_{stage}_VOLT"], values[f"BATT_{stage}_MAH"]
            limits = [f"{volts:g} V"] * (volts > 0) + [f"{charge:g} mAh left"] * (charge > 0)
            action = chosen(f"BATT_FS_{stage}_ACT", values, actions)
            if limits:
                told.append(f"{level}{action.text} at {' or '.join(limits)}")
            acts = acts or (action.acts and bool(limits))
        nothing = "does nothing: BATT_LOW_VOLT and BATT_LOW_MAH are 0"
        return Response("; ".join(told) or nothing, acts)

    return response


def _copter_position(values: Values, _: bool) -> Response:
    actions = {1: _LAND, 2: "keeps its height and drifts (ALT_HOLD: sticks fly it)", 3: _LAND}
    return chosen("FS_EKF_ACTION", values, actions)


def _plane_rc(values: Values, _: bool) -> Response:
    if values["THR_FAILSAFE"] != 1:
        return Response(f"does nothing ({setting('THR_FAILSAFE', values)})", acts=False)
    return _plane_long(values)


def _plane_station(values: Values, _: bool) -> Response:
    if values["FS_GCS_ENABL"] == 0:
        return Response("does nothing (FS_GCS_ENABL 0)", acts=False)
    return _plane_long(values)


def _plane_long(values: Values) -> Response:
    acts = chosen("FS_LONG_ACTN", values, _PLANE_LONG)
    after = f"{acts.text} after {values['FS_LONG_TIMEOUT']:g} s"
    return Response(after, acts=values["FS_LONG_ACTN"] not in (0, 4))


_BATTERY = {
    "BATT_MONITOR": 0,
    **dict.fromkeys(("BATT_LOW_MAH", "BATT_CRT_MAH", "BATT_FS_LOW_ACT", "BATT_FS_CRT_ACT"), 0),
    "BATT_LOW_VOLT": 10.5,
    "BATT_CRT_VOLT": 0.0,
}
"""With BATT_MONITOR 0 ArduPilot has none of the others."""

_LONG = {"FS_LONG_ACTN": 0, "FS_LONG_TIMEOUT": 5.0}

COPTER_FAILSAFES = (
    Failsafe("RC lost", {"FS_THR_ENABLE": 1, "FS_OPTIONS": 16}, _copter_rc),
    Failsafe(
        "ground station lost",
        {"FS_GCS_ENABLE": 0, "FS_OPTIONS": 16, "FS_GCS_TIMEOUT": 5.0},
        _copter_station,
        {"FS_GCS_TIMEOUT": 5.0},
    ),
    Failsafe("battery low", _BATTERY, _battery(_COPTER_BATTERY)),
    Failsafe("position lost", {"FS_EKF_ACTION": 1}, _copter_position),
)
"""ArduCopter's."""

PLANE_FAILSAFES = (
    Failsafe("RC lost", {"THR_FAILSAFE": 1, **_LONG}, _plane_rc),
    Failsafe("ground station lost", {"FS_GCS_ENABL": 0, **_LONG}, _plane_station),
    Failsafe("battery low", _BATTERY, _battery(_PLANE_BATTERY)),
)
"""ArduPlane's."""
