"""What a mission file tells."""

from dataclasses import dataclass

from faao_mav.mission.item import Mission
from faao_mav.mission.vehicle import Autopilot, Kind, Vehicle


@dataclass(frozen=True, slots=True)
class MissionFile:
    """A mission, and for whom it was made as far as the file says it."""

    mission: Mission
    autopilot: Autopilot | None = None
    kind: Kind | None = None

    @property
    def vehicle(self) -> Vehicle | None:
        """The vehicle that the file names, a copter unless it says otherwise; None for no name."""
        if self.autopilot is None:
            return None
        return Vehicle(self.autopilot, self.kind or "copter")
