"""What a vehicle does by itself when a link, its battery or its position is lost."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TypeAlias

Values: TypeAlias = Mapping[str, float]
"""Parameters by the autopilot's names, in its units."""


@dataclass(frozen=True, slots=True)
class Response:
    """What a vehicle does about a loss, as the end of a sentence; `acts`: it does anything."""

    text: str
    acts: bool = True


@dataclass(frozen=True, slots=True)
class Action:
    """What a vehicle does by the value of the parameter `decides`."""

    decides: str
    # What it does by that value, from 1 on; "" for what is not known. Names in braces stand for the
    # values of parameters
    does: Sequence[str]
    # The values with which it does nothing, or goes on with its mission
    idle: Collection[int] = (0,)
    after: str = ""  # The parameter that says after how many seconds it acts
    # Parameters below which it acts, 0 for none, with their units
    below: Mapping[str, str] = field(default_factory=dict)
    when: str = ""  # When that is, as the beginning of what it does

    def told(self, values: Values) -> Response:
        """Return what it does by `values`; nothing to tell where none of its limits is set."""
        limits = [f"{values[name]:g} {unit}" for name, unit in self.below.items() if values[name]]
        if self.below and not limits:
            return Response("", acts=False)
        number, set_to = int(values[self.decides]), f"{self.decides} {values[self.decides]:g}"
        does = dict(enumerate(self.does, 1)).get(number, "")
        if does:
            text = f"{does.format_map(values)} ({set_to})"
        elif number in self.idle:
            return Response(f"{self.when}does nothing ({set_to})", acts=False)
        else:
            text = f"does what {set_to} says, which is not known here"
        text += f" after {values[self.after]:g} s ({self.after})" if self.after else ""
        text += f" at {' or '.join(limits)}" if limits else ""
        return Response(f"{self.when}{text}", number not in self.idle)


@dataclass(frozen=True, slots=True)
class Failsafe:
    """What a vehicle does when `loss`, the beginning of a sentence, happens in flight."""

    loss: str
    # The parameters that decide, with the autopilot's defaults; a whole number is one of 32 bits on
    # PX4's wire
    defaults: Values
    # What it does, by its parameters; without any it always does what `always` says
    actions: tuple[Action, ...] = ()
    always: str = ""
    # The values of parameters with which it does nothing
    off: Mapping[str, Collection[float]] = field(default_factory=dict)
    # The parameter, and its bits in a mission and in a flight by setpoints, by which it flies on
    exceptions: tuple[str, int, int] | None = None
    # The values that count in versions that lack the parameter
    absent: Values = field(default_factory=dict)

    def told(self, values: Values, *, streamed: bool) -> Response | None:
        """Return what a vehicle with these `values` does; None where one that decides is missing.

        `streamed`: in a flight by setpoints, else by its mission.

        >>> failsafe = Failsafe("RC lost", {"FS": 1.0}, (Action("FS", ("returns",)),))
        >>> failsafe.told({"FS": 1.0}, streamed=False)
        Response(text='returns (FS 1)', acts=True)
        >>> failsafe.told({"FS": 0.0}, streamed=False)
        Response(text='does nothing (FS 0)', acts=False)
        >>> failsafe.told({}, streamed=False) is None
        True
        """
        values = {**self.absent, **values}
        try:
            for name, off in self.off.items():
                if values[name] in off:
                    return Response(f"does nothing ({name} {values[name]:g})", acts=False)
            told = [action.told(values) for action in self.actions]
            acts = self.always != "" or any(each.acts for each in told)
            if acts and self.exceptions is not None:
                name, *bits = self.exceptions
                if int(values[name]) & bits[streamed]:
                    return Response(f"flies on ({name} {values[name]:g})", acts=False)
        except KeyError:
            return None
        text = "; ".join(each.text for each in told if each.text)
        nothing = f"does nothing: {' and '.join(self.actions[0].below)} are 0" if told else ""
        return Response(text or self.always or nothing, acts)
