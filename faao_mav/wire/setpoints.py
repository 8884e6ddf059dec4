"""How autopilots follow setpoints, and what they do when no more come."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import NamedTuple

from faao_mav.autopilot import AutopilotFamily
from faao_mav.autopilot.ardupilot import ARDUPILOT
from faao_mav.autopilot.px4 import PX4
from faao_mav.wire.modes import px4_mode

_LEAST_TIMEOUT = 0.5
"""Seconds for which an autopilot has to do without setpoints at least; chosen: the slowest come
four times a second, irregularly."""


class LossAction(NamedTuple):
    """What is done without setpoints: the name of a mode, its custom mode, whether sticks fly it.

    Where there are no sticks PX4 1.16.1 sank in Position by 0.7 m/s to the ground, in simulation.
    """

    name: str
    mode: int
    by_sticks: bool = False


@dataclass(frozen=True, slots=True)
class SetpointRules:
    """The rules of an autopilot for flights by setpoints.

    Attributes:
        timeout: the parameter that says for how many seconds it does without setpoints.
        least_timeout: the least time, s, whatever that parameter says.
        most_timeout: the longest time, s, with which it is flown by setpoints.
        loss: the parameter that says which of `actions`, by their values, it then does; "": it
            stops in its place, and stays in its mode.
        forbidden: the values of that parameter with which it is not flown so, and what they do.
        streamed: for so many seconds setpoints have to come before it enters the mode; it then
            takes off by them. 0: it enters the mode at any time, and takes off by a command.
        carries_on: it goes on from a setpoint by the velocity and the acceleration in it; else it
            goes to where the setpoint is, and waits there for the next.
        defaults: the values of these parameters that it comes with.
    """

    timeout: str
    least_timeout: float = 0.0
    most_timeout: float = math.inf
    loss: str = ""
    actions: Mapping[float, LossAction] = field(default_factory=dict)
    forbidden: Mapping[float, str] = field(default_factory=dict)
    streamed: float = 0.0
    carries_on: bool = False
    defaults: dict[str, float] = field(default_factory=dict)

    @property
    def takes_off_by_setpoints(self) -> bool:
        """Whether it takes off by setpoints, which have to come before it enters the mode."""
        return self.streamed > 0

    def comes_back_from(self, mode: int, values: Mapping[str, float]) -> bool:
        """Tell whether it changes to `mode` for want of setpoints, and back when they come again.

        That is so given its parameters' `values`, but not where sticks fly it: somebody may be at
        them.
        """
        action = self.actions.get(values.get(self.loss, math.nan))
        return action is not None and action.mode == mode and not action.by_sticks

    def refusal(self, values: Mapping[str, float]) -> tuple[str, str] | None:
        """Return why it is not flown by setpoints, and what to do; None where it may be.

        `values` are those of its parameters: what it does without setpoints has to be known, and
        neither to stop its motors nor to have it fly on for long.
        """
        untold = [name for name in self.defaults if name not in values]
        if untold:
            text = f"it does not tell {' and '.join(untold)}, what it does without setpoints"
            return text, "try again, or fly the mission"
        after = values[self.timeout]
        if not _LEAST_TIMEOUT <= after <= self.most_timeout:
            flies_on = ", and until then flies on" if self.carries_on else ""
            limits = f"{_LEAST_TIMEOUT:g} to {self.most_timeout:g} s"
            text = f"without setpoints it acts after {after:g} s ({self.timeout}){flies_on}"
            return text, f"set {self.timeout} to {limits}"
        if self.loss and values[self.loss] not in self.actions:
            value = values[self.loss]
            does = self.forbidden.get(value, "does what is not known here")
            *some, last = (
                f"{key:g} ({each.name})" for key, each in self.actions.items() if not each.by_sticks
            )
            text = f"without setpoints it {does} ({self.loss} {value:g})"
            return text, f"set {self.loss} to {', '.join(some)} or {last}"
        return None

    def without(self, values: Mapping[str, float]) -> str:
        """Return in words what it does without setpoints, given `values` that are not refused."""
        after = values[self.timeout]
        if not self.loss:
            return f"it stops after {after:g} s ({self.timeout})"
        action = self.actions[values[self.loss]]
        told = ", ".join(f"{name} {values[name]:g}" for name in self.defaults)
        if action.by_sticks:
            name, back = f"{action.name} (and sinks, unless sticks fly it)", ""
        else:
            name, back = action.name, ", until they come again"
        return f"it changes to {name} after {after:g} s ({told}){back}"


_RULES = {
    ARDUPILOT: SetpointRules(
        "GUID_TIMEOUT",
        least_timeout=0.1,
        most_timeout=1.0,  # at 8 m/s it flies 24 m on with its default
        carries_on=True,
        defaults={"GUID_TIMEOUT": 3.0},
    ),
    PX4: SetpointRules(
        "COM_OF_LOSS_T",
        most_timeout=60.0,  # the greatest value that it takes
        loss="COM_OBL_RC_ACT",
        actions={
            0: LossAction("Position", px4_mode(3, 0), by_sticks=True),
            1: LossAction("Altitude", px4_mode(2, 0), by_sticks=True),
            2: LossAction("Stabilized", px4_mode(7, 0), by_sticks=True),
            3: LossAction("Return", px4_mode(4, 5)),
            4: LossAction("Land", px4_mode(4, 6)),
            5: LossAction("Hold", px4_mode(4, 3)),
        },
        forbidden={6: "terminates the flight", 7: "stops its motors"},
        streamed=1.0,
        defaults={"COM_OF_LOSS_T": 1.0, "COM_OBL_RC_ACT": 0},
    ),
}


def setpoint_rules(family: AutopilotFamily) -> SetpointRules:
    """Return the rules of `family`."""
    return _RULES[family]
