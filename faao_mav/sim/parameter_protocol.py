"""The parameters that ground stations ask a mock autopilot for, and its answers."""

import math
from collections.abc import Mapping

from faao_mav.autopilot import VehicleType
from faao_mav.wire.messages import Message, ParamRequestList, ParamRequestRead, ParamSet, ParamValue
from faao_mav.wire.parameters import carried, value_in

_INT32, _REAL32 = 6, 9
"""MAV_PARAM_TYPE of whole numbers, and of single-precision ones."""


class ParameterServer:
    """Parameters of `vehicle` by name, in the autopilot's own units.

    Those whose default is an `int` are whole numbers; `given` are other values than the `defaults`.
    Of the names that one parameter has it knows the oldest that is given. An autopilot that sends
    whole numbers as their bits sets nothing that comes with another type than it has.
    """

    def __init__(
        self, defaults: Mapping[str, float], given: Mapping[str, float], vehicle: VehicleType
    ) -> None:
        self._vehicle = vehicle
        self.values: dict[str, float] = {
            name: type(defaults.get(name, value))(value)
            for name, value in {**defaults, **given}.items()
        }
        for parameter in vehicle.parameters.values():
            known = [name for name in parameter.names if name in given]
            for other in {*parameter.names} - {*known[-1:]} if known else ():
                self.values.pop(other, None)

    def on(self, message: ParamRequestList | ParamRequestRead | ParamSet) -> list[Message]:
        """Return the answer to a request; unknown names get none."""
        names = list(self.values)
        match message:
            case ParamRequestRead(param_index=index) if index != -1:
                names = names[index : index + 1] if index >= 0 else []
            case ParamRequestRead(param_id=name):
                names = [name] if name in self.values else []
            case ParamSet(param_id=name):
                names = [name] if self._takes(message) else []
        return [self._told(name) for name in names]

    def _takes(self, message: ParamSet) -> bool:
        """Set a parameter; tell whether it is one, whatever became of its value."""
        name, value = message.param_id, value_in(message, self._vehicle)
        strict = self._vehicle.family.whole_as_bits
        if name not in self.values or (strict and message.param_type != self._kind(name)):
            return False
        if math.isfinite(value):
            self.values[name] = type(self.values[name])(value)
        return True

    def _kind(self, name: str) -> int:
        return _INT32 if isinstance(self.values[name], int) else _REAL32

    def _told(self, name: str) -> ParamValue:
        index, kind = list(self.values).index(name), self._kind(name)
        number = carried(float(self.values[name]), kind, self._vehicle)
        return ParamValue(name, number, kind, len(self.values), index)
