"""What is to be flown, and what a vehicle holds before: what the gate compares."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

from faao_mav.autopilot import Vehicle, VehicleType
from faao_mav.autopilot.files import MadeFor
from faao_mav.errors import InputError
from faao_mav.mission.item import Home, Mission
from faao_mav.wire.jobs import download_lists
from faao_mav.wire.machine import Talk
from faao_mav.wire.messages import HomePosition, WireItem
from faao_mav.wire.parameters import Reading, read_parameters
from faao_mav.wire.protocol import HOME_POSITION, MissionType
from faao_mav.wire.questions import ask_for
from faao_mav.wire.transfer import PartReport, Peer
from faao_mav.wire.verify import Difference, compare
from faao_mav.wire.whereabouts import home_in
from faao_mav.wire.wire_items import home_items, mission_of

if TYPE_CHECKING:
    from faao_mav.optimizer.solution import Solution
    from faao_mav.schedule.conversion import Conversion


@dataclass(frozen=True, slots=True, eq=False)
class Held:
    """What a vehicle holds: `lists` as downloaded, its home row included, `reading` of parameters.

    `missing` says why a list is not there; `home` is where it returns to, None where that is not
    known.
    """

    lists: Mapping[MissionType, tuple[WireItem, ...]]
    reading: Reading
    missing: Mapping[MissionType, PartReport] = field(default_factory=dict)
    home: Home | None = None

    def rows(self, part: MissionType, vehicle: VehicleType) -> tuple[WireItem, ...]:
        """Return the items of one list, without the home row; none where it was not read."""
        return tuple(self.lists.get(part, ()))[home_items(vehicle, part) :]

    def other_than(
        self, sent: Sequence[WireItem], part: MissionType, vehicle: VehicleType
    ) -> tuple[Difference, ...]:
        """Return where one list is not `sent`, home included, but for what storage loses."""
        found = compare(sent, self.lists.get(part, ()), part, vehicle)
        return tuple(each for each in found if each.kind == "wrong")

    def beside(self, mission: Mission, vehicle: VehicleType) -> Mission:
        """Return `mission` with the fence and the rally points that are held."""
        try:
            held = mission_of(self.lists, vehicle)
        except InputError:  # told as another list than the file's
            return mission
        return replace(mission, fence=held.fence, rally=held.rally)


def read_held(
    peer: Peer,
    parts: Sequence[MissionType] = tuple(MissionType),
    *,
    parameters: bool = True,
) -> Talk["Held"]:
    """Read what the vehicle of `peer`, which has to be one that is known, holds.

    That are the lists `parts`, and with `parameters` these and its home.
    """
    vehicle = peer.vehicle
    assert vehicle is not None
    lists = yield from download_lists(parts, peer)
    if MissionType.MISSION in lists.missing or not parameters:
        return Held(lists.items, Reading({}), lists.missing)
    names = [tuple(each.names) for each in vehicle.parameters.values()]
    names += [(name,) for each in vehicle.failsafes for name in each.defaults]
    if vehicle.modes.guided is not None:
        names += [(name,) for name in vehicle.family.setpoints.defaults]
    reading = yield from read_parameters(peer, names)
    told = yield from ask_for(peer.address, HOME_POSITION, HomePosition)
    try:
        home = None if told is None else home_in(told)
    except InputError:
        home = None
    return Held(lists.items, reading, lists.missing, home)


@dataclass(frozen=True, slots=True, eq=False)
class Flight:
    """What is to be flown: `mission`, or, `streamed`, the plan of `solution` by setpoints.

    `vehicle` has the parameters that the mission is timed for, whose `source` says where they come
    from; `made_for` says what is known of whom it was made for. A `solution` tells what the flight
    is to deliver, and may tell what it takes of the battery.

    >>> from faao_mav import Vehicle, read_mission
    >>> flight = Flight(read_mission("tests/data/missions/plain.waypoints"), Vehicle())
    >>> flight.streamed, flight.solution
    (False, None)
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
