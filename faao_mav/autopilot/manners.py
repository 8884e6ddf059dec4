"""What the wire shows of an autopilot: its modes, how it takes lists and setpoints."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal, NamedTuple, TypeAlias

FenceAction: TypeAlias = Literal["nothing", "report", "hold", "return", "land", "terminate"]
"""What a vehicle does that leaves its fence: flies on, says so and flies on, and so forth."""


@dataclass(frozen=True, slots=True)
class Modes:
    """Custom modes of an autopilot that flies one type of vehicle.

    `rest` is one to stand on the ground in, `mission` flies the mission, `hold` stays at the place
    (a plane circles there) without sticks, `guided` flies by setpoints (None: streams are not flown
    by that type). `at_fence` are those that hold, return and land, as after a breach of the fence.
    In the modes `not_to_arm_in` the autopilot does not arm, or takes off as soon as it has.
    """

    rest: int
    mission: int
    hold: int
    at_fence: Mapping[FenceAction, int] = field(default_factory=dict)
    guided: int | None = None
    not_to_arm_in: frozenset[int] = frozenset()


@dataclass(frozen=True, slots=True)
class Manners:
    """How an autopilot behaves in transfers; the defaults are those of one that is not known.

    `patience` is how long it waits for the next packet of a transfer before it gives up, s.

    In uploads: `request_period` is how long after its last request it asks again, s. An item that
    it did not ask for it passes over without a word (`ignores_other_items`), or answers
    INVALID_SEQUENCE and goes on waiting.

    In downloads: `any_request_order` tells that it answers each request by itself, so that several
    can be under way, and `final_acks` how many acknowledgements it is sent at the end.

    `meanings` say what a MAV_MISSION_RESULT means, by its name, if it is this autopilot's.
    """

    request_period: float = math.inf
    patience: float = math.inf
    ignores_other_items: bool = False
    any_request_order: bool = False
    final_acks: int = 1
    meanings: Mapping[str, str] = field(default_factory=dict)


_LEAST_TIMEOUT = 0.5
"""Seconds for which an autopilot has to do without setpoints at least; chosen: the slowest come
four times a second, irregularly."""


class LossAction(NamedTuple):
    """What is done without setpoints: the name of a mode, its custom mode, whether sticks fly it.

    Without sticks the aircraft may sink in a mode that they fly.
    """

    name: str
    mode: int
    by_sticks: bool = False


@dataclass(frozen=True, slots=True)
class SetpointRules:
    """The rules of an autopilot for flights by setpoints."""

    # The parameter that says for how many seconds it does without setpoints; "": it is not flown by
    # them
    timeout: str = ""
    least_timeout: float = 0.0  # The least time, s, whatever that parameter says
    most_timeout: float = math.inf  # The longest time, s, with which it is flown by setpoints
    # The parameter that says which of `actions`, by their values, it then does; "": it stops in its
    # place, and stays in its mode
    loss: str = ""
    actions: Mapping[float, LossAction] = field(default_factory=dict)
    # The values of that parameter with which it is not flown so, and what they do
    forbidden: Mapping[float, str] = field(default_factory=dict)
    # For so many seconds setpoints have to come before it enters the mode; it then takes off by
    # them. 0: it enters the mode at any time, and takes off by a command
    streamed: float = 0.0
    # It goes on from a setpoint by the velocity and the acceleration in it; else it goes to where
    # the setpoint is, and waits there for the next
    carries_on: bool = False
    # The values of these parameters that it comes with
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
