"""Who flies an aircraft that follows setpoints: they do, its own failsafe, or somebody else."""

from collections.abc import Mapping
from typing import Literal, TypeAlias

from faao_mav.autopilot.manners import SetpointRules
from faao_mav.fly.telemetry import Telemetry

Flier: TypeAlias = Literal["setpoints", "failsafe", "others", "unknown"]

_TOLD_BY = 3.0
"""Seconds after which, without a message about the mode that was asked for last, it counts as the
pilot who changed it: six of them. Chosen."""


class WhoFlies:
    """Tells from the modes that a vehicle is `seen` in who flies it.

    `guided` is the mode for setpoints, which it follows by `rules`. `unsure`: it is not known, and
    nothing that moves the vehicle may be sent.
    """

    def __init__(self, rules: SetpointRules, guided: int, seen: Telemetry) -> None:
        self._rules, self._guided, self._seen = rules, guided, seen
        self._unsure_since: float | None = None

    @property
    def unsure(self) -> bool:
        """Whether it is not known who flies it."""
        return self._unsure_since is not None

    def forget(self, now: float) -> None:
        """Know no more who flies it: it was silent, and may be in another mode since."""
        self._unsure_since, self._seen.wanted = now, None

    def see(self, mode: int, values: Mapping[str, float], now: float) -> Flier:
        """Return who flies a vehicle that is in `mode` now, `values` being its parameters.

        In the mode of its failsafe it is that, if the mode that was asked for last is still the one
        for setpoints.
        """
        wanted, since = self._seen.wanted, self._unsure_since
        flier: Flier = "others"
        if mode == self._guided:
            flier = "setpoints"
        elif not self._rules.comes_back_from(mode, values):
            flier = "others"
        elif wanted is not None:
            flier = "failsafe" if wanted.intended_custom_mode == self._guided else "others"
        elif since is None or now <= since + _TOLD_BY:
            flier = "unknown"
        if flier != "unknown":
            self._unsure_since = None
        elif since is None:
            self._unsure_since = now
        return flier
