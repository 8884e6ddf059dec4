"""What is to be flown, and what is seen of the vehicle before: what the gate compares."""

from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from faao_mav.mavlink.flying.held import Held
from faao_mav.mission.item import Home, Mission
from faao_mav.vehicle import Vehicle, VehicleType
from faao_mav.vehicle.files import MadeFor

if TYPE_CHECKING:
    from faao_mav.optimizer.solution import Solution
    from faao_mav.schedule.conversion import Conversion


@dataclass(frozen=True, slots=True, eq=False)
class Flight:
    """What is to be flown: `mission`, or, `streamed`, the plan of `solution` by setpoints.

    `vehicle` has the parameters that the mission is timed for, whose `source` says where they come
    from; `made_for` says what is known of whom it was made for. A `solution` tells what the flight
    is to deliver, and may tell what it takes of the battery.
    """

    mission: Mission
    vehicle: Vehicle = field(default_factory=Vehicle)
    made_for: MadeFor = field(default_factory=MadeFor)
    solution: "Solution | None" = None
    streamed: bool = False

    @classmethod
    def planned(
        cls, conversion: "Conversion", solution: "Solution", *, streamed: bool = False
    ) -> "Flight":
        """Return the flight of the mission that `solution` was made into."""
        vehicle = conversion.vehicle
        made_for = MadeFor(vehicle.autopilot, vehicle.kind, "as the plan says")
        return cls(conversion.mission, vehicle, made_for, solution, streamed)

    @property
    def placed(self) -> Mission:
        """The mission with the home that its flight counts from: of a stream, its plan's."""
        if not self.streamed or self.solution is None:
            return self.mission
        origin = self.solution.plan.origin
        home = Home(origin.latitude, origin.longitude, origin.elevation)
        return replace(self.mission, home=home)


@dataclass(frozen=True, slots=True, eq=False)
class Seen:
    """What was seen of a vehicle before its flight.

    `place` is where it stands, metres above mean sea level; `battery` is in percent. None: not
    known. `stations` are other ground stations on the link.
    """

    vehicle: VehicleType
    held: Held
    place: Home | None = None
    battery: int | None = None
    armed: bool = False
    mode: int = -1
    mode_name: str = "unknown"
    stations: tuple[str, ...] = ()
