"""What an autopilot does on the wire and by itself: modes, lists, setpoints, failsafes.

A row of `failsafes.tsv` is one stage of what a vehicle does by itself about a loss, of a link, its
battery or its position. Columns, "-" for nothing:

- `vehicle`, `loss`
- `defaults`: the parameters that decide, with the autopilot's defaults; a whole number is one of 32
  bits on PX4's wire
- `absent`: the values that count in versions without the parameter
- `off`: a parameter, and the values with which nothing is done
- `flies on by`: a parameter, and its bits in a mission and in a flight by setpoints, with which the
  vehicle flies on
- `decides`, `does`: a parameter, and what is done by its values from 1 on, between bars; "" where
  that is not known; names in braces stand for the values of parameters
- `idle`: values of `decides` with which nothing is done, or the mission goes on
- `after`: the parameter that says after how many seconds
- `below`: the parameters below which it acts, with their units; with 0 it does not
- `when`: when that is, as the beginning of what is done

Sources: ArduPilot's lists of parameters and events of Copter and Plane 4.1 to 4.7; PX4 1.14 to
1.16: parameter reference, and the module commander (behaviour of its failsafes).
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from typing import Literal, NamedTuple, TypeAlias

from faao_mav.files import table

Values: TypeAlias = Mapping[str, float]
"""Parameters by the autopilot's names, in its units."""

FenceAction: TypeAlias = Literal["nothing", "report", "hold", "return", "land", "terminate"]
"""What a vehicle does that leaves its fence: flies on, says so and flies on, and so forth."""


@dataclass(frozen=True, slots=True)
class Modes:
    """Custom modes of an autopilot that flies one type of vehicle.

    `rest` is one to stand and be armed in, `mission` flies the mission, `hold` stays at the place
    (a plane circles there) without sticks, `guided` flies by setpoints (None: streams are not flown
    by that type). `at_fence` hold, return and land, as after a breach of the fence, `at_end` are
    set by a mission's last item. In those `not_to_arm_in` it does not arm, or takes off by itself.
    """

    rest: int
    mission: int
    hold: int
    at_fence: Mapping[FenceAction, int] = field(default_factory=dict)
    at_end: frozenset[int] = frozenset()
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


def meanings_of(autopilot: str) -> dict[str, str]:
    """Return what the table `meanings.tsv` says of the results of an `autopilot`.

    Those of "any" have that meaning where it has none of its own; "order" has the MAV_RESULT.
    """
    told = (row for row in table("autopilot/meanings.tsv") if row["autopilot"] == autopilot)
    return {row["result"]: row["means"] for row in told}


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


class Response(NamedTuple):
    """What a vehicle does about a loss, as the end of a sentence; `acts`: it does anything."""

    text: str
    acts: bool


@dataclass(frozen=True, slots=True)
class Failsafe:
    """What a vehicle does when `loss`, the beginning of a sentence, happens in flight.

    `stages` are its rows of the table, `defaults` the parameters that decide, as they come, and
    `absent` the values that count in versions that lack the parameter.
    """

    loss: str
    stages: tuple[Mapping[str, str], ...]
    defaults: Values
    absent: Values

    def told(self, values: Values, *, streamed: bool) -> Response | None:
        """Return what a vehicle with these `values` does; None where one that decides is missing.

        `streamed`: in a flight by setpoints, else by its mission.

        >>> failsafe = failsafes("px4")[1]
        >>> failsafe.told({"NAV_DLL_ACT": 2, "COM_DL_LOSS_T": 10}, streamed=False)
        Response(text='returns (NAV_DLL_ACT 2) after 10 s (COM_DL_LOSS_T)', acts=True)
        >>> failsafe.told({}, streamed=False) is None
        True
        """
        values = {**self.absent, **values}
        try:
            told = [_told(stage, values) for stage in self.stages]
            acts = any(each.acts for each in told)
            if acts and (exception := self.stages[0]["flies on by"]):
                name, *bits = exception.split()
                if int(values[name]) & int(bits[streamed]):
                    return Response(f"flies on ({name} {values[name]:g})", acts=False)
        except KeyError:
            return None
        return Response("; ".join(dict.fromkeys(each.text for each in told if each.text)), acts)


def _told(stage: Mapping[str, str], values: Values) -> Response:
    """Return what a vehicle with these `values` does by a `stage`; "" for nothing to tell."""
    name, _, off = stage["off"].partition("=")
    if name and f"{values[name]:g}" in off.split(","):
        return Response(f"does nothing ({name} {values[name]:g})", acts=False)
    below = dict(each.split(" ", 1) for each in stage["below"].split("|") if each)
    limits = [f"{values[name]:g} {unit}" for name, unit in below.items() if values[name]]
    if below and not limits:
        nothing = "" if stage["when"] else f"does nothing: {' and '.join(below)} are 0"
        return Response(nothing, acts=False)
    decides, does, when = stage["decides"], stage["does"].split("|"), stage["when"]
    if not decides:
        return Response(does[0], acts=True)
    number, set_to = int(values[decides]), f"{decides} {values[decides]:g}"
    text = does[number - 1] if 0 < number <= len(does) else ""
    acts = str(number) not in stage["idle"].split(",")
    if text:
        text = f"{text.format_map(values)} ({set_to})"
    elif not acts:
        return Response(f"{when}does nothing ({set_to})", acts=False)
    else:
        text = f"does what {set_to} says, which is not known here"
    text += f" after {values[stage['after']]:g} s ({stage['after']})" if stage["after"] else ""
    return Response(f"{when}{text}{' at ' * bool(limits)}{' or '.join(limits)}", acts)


@cache
def failsafes(vehicle: str) -> tuple[Failsafe, ...]:
    """Return what the `vehicle` of the table does, loss by loss.

    >>> [each.loss for each in failsafes("arduplane")]
    ['RC lost', 'ground station lost', 'battery low']
    """
    found: dict[str, list[Mapping[str, str]]] = {}
    for row in table("autopilot/failsafes.tsv"):
        if row["vehicle"] == vehicle:
            found.setdefault(row["loss"], []).append(row)

    def numbers(stages: list[Mapping[str, str]], column: str) -> Values:
        pairs = (each.split("=") for stage in stages for each in stage[column].split())
        return {name: float(value) if "." in value else int(value) for name, value in pairs}

    return tuple(
        Failsafe(loss, tuple(stages), numbers(stages, "defaults"), numbers(stages, "absent"))
        for loss, stages in found.items()
    )
