"""The parameters that ground stations ask a mock autopilot for, and its answers."""

from collections.abc import Mapping

from faao_mav.mavlink.messages import (
    Message,
    ParamRequestList,
    ParamRequestRead,
    ParamSet,
    ParamValue,
)

_REAL32 = 9
"""MAV_PARAM_TYPE of single-precision numbers."""


class ParameterServer:
    """Parameters by name, in the autopilot's own units; all are single-precision numbers."""

    def __init__(self, values: Mapping[str, float]) -> None:
        self.values = dict(values)

    def on(self, message: ParamRequestList | ParamRequestRead | ParamSet) -> list[Message]:
        """Return the answer to a request; unknown names get none."""
        match message:
            case ParamRequestList():
                return [self._value(name) for name in self.values]
            case ParamRequestRead(param_index=-1, param_id=name):
                return [self._value(name)] if name in self.values else []
            case ParamRequestRead(param_index=index):
                names = list(self.values)
                return [self._value(names[index])] if 0 <= index < len(names) else []
            case ParamSet(param_id=name, param_value=value):
                if name in self.values:
                    self.values[name] = value
                    return [self._value(name)]
        return []

    def _value(self, name: str) -> ParamValue:
        index = list(self.values).index(name)
        return ParamValue(name, float(self.values[name]), _REAL32, len(self.values), index)
