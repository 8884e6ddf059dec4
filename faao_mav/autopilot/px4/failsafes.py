"""What PX4 does by itself on a loss.

Source: PX4 1.14 to 1.16: parameter reference, and the module commander (behaviour of its
failsafes).
"""

from collections.abc import Callable

from faao_mav.autopilot.failsafe import Failsafe, Response, Values, chosen, setting

_LINK = {
    1: "holds its place",
    2: "returns",
    3: "lands where it is",
    5: "terminates the flight",
    6: "stops its motors",
}
"""Of NAV_RCL_ACT and NAV_DLL_ACT."""

_NO_STICKS = 4
"""COM_RC_IN_MODE: there are no sticks, so none can be lost."""

_MISSION, _OFFBOARD = 1, 4
"""Bits of COM_RCL_EXCEPT and COM_DLL_EXCEPT: in that mode it flies on."""


def _excepted(name: str, values: Values, streamed: bool) -> Response | None:
    """Return that it flies on, where the exceptions in the parameter `name` say so."""
    if int(values[name]) & (_OFFBOARD if streamed else _MISSION):
        return Response(f"flies on ({setting(name, values)})", acts=False)
    return None


def _link(action: str, delay: str, exceptions: str) -> Callable[[Values, bool], Response]:
    """Return what it does without a link, by the names of the parameters that decide."""

    def response(values: Values, streamed: bool) -> Response:
        acts = chosen(action, values, _LINK)
        if not acts.acts:
            return acts
        told = Response(f"{acts.text} after {values[delay]:g} s ({delay})")
        return _excepted(exceptions, values, streamed) or told

    return response


_WITHOUT_RC = _link("NAV_RCL_ACT", "COM_RC_LOSS_T", "COM_RCL_EXCEPT")


def _rc(values: Values, streamed: bool) -> Response:
    if values["COM_RC_IN_MODE"] == _NO_STICKS:
        return Response(f"does nothing ({setting('COM_RC_IN_MODE', values)})", acts=False)
    return _WITHOUT_RC(values, streamed)


def _battery(values: Values, _: bool) -> Response:
    critical, emergency = (f"{100 * values[f'BAT_{each}_THR']:g} %" for each in ("CRIT", "EMERGEN"))
    actions = {
        1: f"returns at {critical}",
        2: f"lands where it is at {critical}",
        3: f"returns at {critical}, lands where it is at {emergency}",
    }
    return chosen("COM_LOW_BAT_ACT", values, actions)


def _position(*_: object) -> Response:
    return Response("descends where it is and drifts with the wind")


FAILSAFES = (
    Failsafe(
        "RC lost",
        {"NAV_RCL_ACT": 2, "COM_RC_LOSS_T": 0.5, "COM_RCL_EXCEPT": 0, "COM_RC_IN_MODE": 3},
        _rc,
    ),
    Failsafe(
        "ground station lost",
        {"NAV_DLL_ACT": 0, "COM_DL_LOSS_T": 10, "COM_DLL_EXCEPT": 0},
        _link("NAV_DLL_ACT", "COM_DL_LOSS_T", "COM_DLL_EXCEPT"),
        {"COM_DLL_EXCEPT": 0},
    ),
    Failsafe(
        "battery low",
        {"COM_LOW_BAT_ACT": 0, "BAT_CRIT_THR": 0.07, "BAT_EMERGEN_THR": 0.05},
        _battery,
    ),
    Failsafe("position lost", {}, _position),
)
"""PX4's, of copters and planes."""
