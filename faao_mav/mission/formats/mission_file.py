"""What a mission file tells."""

from dataclasses import dataclass
from typing import Protocol

from faao_mav.mission.item import Mission


class NamedVehicle(Protocol):
    """A vehicle as far as mission files name it."""

    @property
    def autopilot(self) -> str:
        """The name of its autopilot."""
        ...

    @property
    def kind(self) -> str:
        """The name of its type."""
        ...


@dataclass(frozen=True, slots=True)
class MissionFile:
    """A mission, and for whom it was made as far as the file says it."""

    mission: Mission
    autopilot: str | None = None
    kind: str | None = None
