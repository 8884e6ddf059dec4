"""What the rest of the package asks about an autopilot and a type of vehicle."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import Literal, NamedTuple

from faao_mav.arrays import Real
from faao_mav.autopilot.body import Body
from faao_mav.autopilot.dialect import Dialect, uint8, uint16
from faao_mav.autopilot.manners import Failsafe, FenceAction, Manners, Modes, SetpointRules
from faao_mav.autopilot.model import Model, Orbit
from faao_mav.autopilot.parameter import ParameterTable, ParameterValues, Recommended
from faao_mav.geodesy import LocalFrame
from faao_mav.mission.command import ABOVE_SEA, Command, Frame
from faao_mav.mission.item import Mission, MissionItem
from faao_mav.power import GRAVITY

OVERSPEED = 1.1
"""The greatest speed that a mission may command, as a multiple of the plan's max_speed: it makes up
for corners. Chosen; what a change costs is not measured."""


def lean_acceleration(angle: float) -> float:
    """Return the level acceleration at the lean or bank `angle`, rad, at constant height, m/s²."""
    return GRAVITY * math.tan(angle)


def orbit_at(
    vehicle: ParameterValues, item: MissionItem, density: float = 1.0, sided: int | None = None
) -> Orbit | None:
    """Return how `item` is circled at, None where it is not.

    The radius is the item's, param3 or of a LOITER_TO_ALT param2, over the `density`; below 1 m,
    and of the command `sided`, it is the vehicle's `loiter_radius`. Negative ones turn left.
    """
    own = item.params[1 if item.command == Command.NAV_LOITER_TO_ALT else 2]
    if item.command == sided or not 1 <= abs(own) < math.inf:
        general = vehicle.value("loiter_radius")
        own = math.copysign(general, -1 if min(general, own) < 0 else 1)
    orbit = partial(Orbit, abs(own) / density, own > 0, tangent=item.params[3] > 0)
    match item.command:
        case Command.NAV_LOITER_TURNS:
            return orbit(turns=uint8(item.params[0]) or max(0.0, item.params[0]))
        case Command.NAV_LOITER_TIME:
            return orbit(seconds=uint16(item.params[0]))
        case Command.NAV_LOITER_TO_ALT:
            return orbit(climbs=True)
        case Command.NAV_LOITER_UNLIM:
            return orbit(turns=1.0, endless=True)
    return None


class RallyRule(NamedTuple):
    """Where a return goes: to the nearest rally point within `limit`, m, else home.

    With `home` that is one of the places to choose from, the nearest of which is it.
    """

    limit: float = math.inf
    home: bool = True


def height_above_home(item: MissionItem, mission: Mission) -> float:
    """Return the height of `item` above home, m; NaN where that needs home's and it is not told.

    Heights above terrain count as if the ground were as high as home.
    """
    if item.frame not in ABOVE_SEA and item.frame != Frame.MISSION:
        return item.z
    return item.z - mission.home.altitude if mission.home is not None else math.nan


@dataclass(frozen=True, slots=True, eq=False)
class AutopilotFamily:
    """An autopilot, whatever it flies."""

    key: str  # Its name in plans and options
    name: str  # The name that is shown
    mav_autopilot: int  # Its MAV_AUTOPILOT number on the wire and in `.plan` files
    parameter_suffix: str  # What its parameter files end in
    # "list" has lines of NAME,VALUE, "qgroundcontrol" five fields between tabs
    parameter_style: Literal["list", "qgroundcontrol"]
    # Parameters whose names begin with one of these are its own
    parameter_prefixes: tuple[str, ...]
    # How it takes and gives lists; those of one that is not known by default
    manners: Manners = field(default_factory=Manners)
    has_submodes: bool = False  # Its custom modes are told as main and sub mode, bytes 2 and 3
    setpoints: SetpointRules = field(default_factory=SetpointRules)  # How it is flown by setpoints
    # The frame in which it takes them, about its origin in degrees
    local_frame: Callable[[float, float], LocalFrame] = LocalFrame
    # Whole numbers among its parameters are sent as their 32 bits, and only what is sent with the
    # right type is set
    whole_as_bits: bool = False
    mavlink_2: str = ""  # The parameter and its value with which a port speaks MAVLink 2
    # What may be why it does not answer, and what to do; "": nothing is known
    only_one_station: str = ""

    def mode_parameters(self, mode: int) -> tuple[float, float, float]:
        """Return the first parameters of DO_SET_MODE for a custom `mode`: that it is one, which.

        >>> AutopilotFamily("a", "A", 3, "", "list", ()).mode_parameters(17)
        (1.0, 17.0, 0.0)
        """
        main, sub = (mode >> 16 & 255, mode >> 24) if self.has_submodes else (mode, 0)
        return 1.0, float(main), float(sub)


@dataclass(frozen=True, slots=True)
class FenceResponse:
    """What a vehicle does that leaves the areas of its fence, and the parameter that decides.

    `parameter` is the key of its table, `set_to` what would make it keep the fence, "" if it does.
    """

    action: FenceAction
    parameter: str
    set_to: str = ""

    @property
    def keeps(self) -> bool:
        """Whether it does anything about it."""
        return self.action not in ("nothing", "report")


@dataclass(frozen=True, slots=True, eq=False)
class VehicleType:
    """One autopilot flying one type of vehicle: what is true of all of them."""

    family: AutopilotFamily  # The autopilot
    kind: str  # The type of vehicle as plans and options name it
    name: str  # The name that is shown, as "ArduCopter"
    # Its MAV_TYPE numbers; the first is written into `.plan` files and heartbeats
    mav_types: tuple[int, ...]
    modes: Modes  # Its flight modes
    hovers: bool  # It can stand still in the air; else it circles to wait
    parameters: ParameterTable  # Its parameters by key
    dialect: Dialect  # What it does with the items of a mission
    spool: float = 2.0  # How long a take-off takes before it climbs, s
    returns_at_least: bool = True  # A return never descends for the height of returns
    whole_second_holds: bool = False  # The hold of a waypoint loses its fraction of a second
    # The greatest speed that it can be told, m/s: WPNAV_SPEED's and MPC_XY_CRUISE's documented one
    fastest: float = 20.0
    # Being inside one of several inclusion areas is enough; else the vehicle has to be inside all
    fence_needs_one_inclusion: Callable[[ParameterValues], bool] = lambda _: True
    home_outside_fence: str = ""  # What it does with a mission where home lies outside the fence
    # What it does when it leaves the areas of its fence
    at_fence: Callable[[ParameterValues], FenceResponse] = lambda _: FenceResponse("nothing", "")
    # How far ahead, m, it looks for its fence at a speed, m/s; 0: it acts when it is outside
    fence_ahead: Callable[[ParameterValues, Real], Real] = lambda _, speed: 0 * speed
    # How it flies, with the latitude in degrees if that is known; None: there is no model, and no
    # missions are made for it
    flight_model: Callable[[ParameterValues, float | None], Model] | None = None
    # The parameters that suit plans; None: it flies with its own
    recommendation: Recommended | None = None
    # Parameters that a plan's "max_speed" or "max_acceleration" may not exceed for the vehicle to
    # keep it, beside `fastest`; of angles what they give
    ceilings: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    # The airframe of the autopilot's simulator, fitted to recorded flights; None where the model is
    # compared with none
    body: Body | None = None
    # Its flight model flies in wind: what hovers in more than it can hold as well
    models_wind: bool = False
    failsafes: tuple[Failsafe, ...] = ()  # What it does by itself on a loss
    # How it circles at an item in air of such a density over the sea's, None where it does not
    orbits: Callable[[ParameterValues, MissionItem, float], Orbit | None] = lambda *_: None
    # Where a return goes when there are rally points
    rally: Callable[[ParameterValues], RallyRule] = lambda _: RallyRule()

    def recommended(
        self, max_speed: float, max_acceleration: float
    ) -> tuple[Mapping[str, float], ...]:
        """Return the sets of parameters to try for a plan's limits, m/s and m/s²."""
        if self.recommendation is None:
            return ({},)
        speed = min(max_speed, self.fastest)
        speeds = speed, round(min(OVERSPEED * speed, self.fastest), 2)
        return self.recommendation.sets(self.parameters, speeds, max_acceleration)

    def defaults(self) -> dict[str, float]:
        """Return the defaults by the autopilot's oldest names, in the autopilot's own units.

        Those of switches and bits are integers.
        """
        return {
            p.oldest_name: type(p.default)(p.written(p.default, p.oldest_name))
            for p in self.parameters.values()
        }
