"""What the rest of the package asks about an autopilot and a type of vehicle."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal, Protocol, TypeAlias

from faao_mav.arrays import Flags, Real
from faao_mav.autopilot.body import Body
from faao_mav.autopilot.dialect import Dialect
from faao_mav.autopilot.failsafe import Failsafe
from faao_mav.autopilot.flight_path import FlightModel, VerticalProfile
from faao_mav.autopilot.manners import FenceAction, Frame, Manners, Modes, SetpointRules
from faao_mav.autopilot.orbit import Orbits, RallyRule, no_orbit
from faao_mav.autopilot.parameter import ParameterTable, ParameterValues
from faao_mav.geodesy import LocalFrame
from faao_mav.power import GRAVITY

Autopilot: TypeAlias = str
"""The name of an autopilot, as `vehicle.autopilot` of a plan has it."""

Kind: TypeAlias = str
"""The name of a type of vehicle, as `vehicle.type` of a plan has it."""

OVERSPEED = 1.1
"""The greatest speed that a mission may command, as a multiple of the plan's max_speed: it makes up
for corners. Chosen; what a change costs is not measured."""


def lean_acceleration(angle: float) -> float:
    """Return the level acceleration at the lean or bank `angle`, rad, at constant height, m/s²."""
    return GRAVITY * math.tan(angle)


def custom_mode(mode: int) -> tuple[float, float, float]:
    """Return the first parameters of DO_SET_MODE for a custom `mode`: that it is one, and which.

    >>> custom_mode(17)
    (1.0, 17.0, 0.0)
    """
    return 1.0, float(mode), 0.0


@dataclass(frozen=True, slots=True, eq=False)
class AutopilotFamily:
    """An autopilot, whatever it flies.

    Attributes:
        key: its name in plans and options.
        name: the name that is shown.
        mav_autopilot: its MAV_AUTOPILOT number on the wire and in `.plan` files.
        parameter_suffix: what its parameter files end in.
        parameter_style: "list" has lines of NAME,VALUE, "qgroundcontrol" five fields between tabs.
        parameter_prefixes: parameters whose names begin with one of these are its own.
        manners: how it takes and gives lists; those of one that is not known by default.
        mode_parameters: the first three parameters of DO_SET_MODE for one of its custom modes.
        setpoints: how it is flown by setpoints.
        local_frame: the frame in which it takes them, about its origin in degrees.
        whole_as_bits: whole numbers among its parameters are sent as their 32 bits, and only what
            is sent with the right type is set.
        mavlink_2: the parameter and its value with which a port speaks MAVLink 2.
        only_one_station: what may be why it does not answer, and what to do; "": nothing is known.
    """

    key: Autopilot
    name: str
    mav_autopilot: int
    parameter_suffix: str
    parameter_style: Literal["list", "qgroundcontrol"]
    parameter_prefixes: tuple[str, ...]
    manners: Manners = field(default_factory=Manners)
    mode_parameters: Callable[[int], tuple[float, float, float]] = custom_mode
    setpoints: SetpointRules = field(default_factory=SetpointRules)
    local_frame: Callable[[float, float], Frame] = LocalFrame
    whole_as_bits: bool = False
    mavlink_2: str = ""
    only_one_station: str = ""


@dataclass(frozen=True, slots=True)
class Ceiling:
    """How far a plan's `key`, "max_speed" or "max_acceleration", may go for a vehicle to keep it.

    `value` is in m/s or m/s²; `parameter` is the key of the vehicle's parameter that sets it, ""
    for what the vehicle can be told at most.
    """

    key: Literal["max_speed", "max_acceleration"]
    value: float
    parameter: str = ""


@dataclass(frozen=True, slots=True)
class SpeedRates:
    """How fast a vehicle's true airspeed V is made to change at most.

    It falls by at most `fall`, m/s², and rises by `power` / V, with the `power` in m²/s³: W per kg.
    Its guidance follows turns of at most `turn`, rad/s.
    """

    fall: float = math.inf
    power: float = math.inf
    turn: float = math.inf


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


class LegDurations(Protocol):
    """How long the legs (m - 1,) of a route take, from passing one end to passing the other."""

    @property
    def most(self) -> Real:
        """The greatest commands that make a difference, (m - 1,), m/s."""

    def flown(self, speeds: Real) -> tuple[Real, Real]:
        """Return the speeds, m/s, that legs come to at the commands `speeds`, and durations, s.

        Both have the shape of `speeds` (..., m - 1), m/s.
        """


class LegLimits(Protocol):
    """How a vehicle with given parameters flies a leg between two waypoints."""

    @property
    def least(self) -> float:
        """Shorter legs, m, are not flown: both their ends count as reached at once."""

    @property
    def run_in(self) -> float:
        """The leg before a start at speed, as a multiple of the shortest leg for that speed."""

    def shortest_leg(self, speed: Real) -> Real:
        """Return the least length of a leg on which `speed`, m/s, is reached, m; same shape."""

    def reachable_speed(self, length: Real) -> Real:
        """Return the greatest speed reached on legs of `length`, m, in m/s; same shape."""

    @property
    def slowest(self) -> float:
        """The least speed that is commanded for a leg, m/s: who has more time waits at its end."""

    def radii(self, room: Real, turn: Real, stops: Flags) -> Real:
        """Return acceptance radii, m, that suit waypoints; 0 leaves them to the autopilot.

        `room` (n,), m, is the shorter of the legs at each waypoint that do not end at a stop,
        `turn` (n,) the angle between them, rad; `stops` (n,) marks the waypoints at which it waits.
        """


@dataclass(frozen=True, slots=True, eq=False)
class VehicleType:
    """One autopilot flying one type of vehicle: what is true of all of them.

    Attributes:
        family: the autopilot.
        kind: the type of vehicle as plans and options name it.
        name: the name that is shown, as "ArduCopter".
        mav_types: its MAV_TYPE numbers; the first is written into `.plan` files and heartbeats.
        modes: its flight modes.
        hovers: it can stand still in the air; else it circles to wait.
        whole_second_holds: the hold of a waypoint loses its fraction of a second.
        parameters: its parameters by key.
        dialect: what it does with the items of a mission.
        fastest: the greatest speed that it can be told, m/s.
        vertical: its take-off, climb, return and landing.
        fence_needs_one_inclusion: being inside one of several inclusion areas is enough; else the
            vehicle has to be inside all.
        home_outside_fence: what it does with a mission where home lies outside the fence.
        at_fence: what it does when it leaves the areas of its fence.
        fence_ahead: how far ahead, m, it looks for its fence at a speed, m/s; 0: it acts when it is
            outside.
        legs: how it flies a leg; None if missions are not made for it.
        flight_model: how it flies a mission, with the latitude in degrees if that is known; None if
            `unmodelled` says why there is no model.
        recommended: the sets of parameters to try for a plan's greatest speed, m/s, and
            acceleration, m/s², the gentlest first; one empty set: it flies with its own.
        ceilings: how far a plan may go for the vehicle to keep it, beside `fastest`; the least of
            those with one key counts.
        body: the airframe of the autopilot's simulator, fitted to recorded flights; None where the
            model is compared with none.
        models_wind: its flight model flies in wind: what hovers in more than it can hold as well.
        true_over_commanded: true airspeed over the one that a mission commands, at a height in m
            above sea level; 1 where missions command ground speeds.
        speed_rates: how fast its airspeed changes; infinitely if that is its acceleration's.
        leg_durations: how long straight legs of given lengths, m, take, of which those are marked
            that follow one without a stop; None if only a flight tells.
        orbits: how it circles at an item.
        rally: where a return goes when there are rally points.
        failsafes: what it does by itself on a loss.
        corner_speed: the speed, m/s, at which it passes a waypoint where it turns by an angle in
            radians; None if no such law is known.
    """

    family: AutopilotFamily
    kind: Kind
    name: str
    mav_types: tuple[int, ...]
    modes: Modes
    hovers: bool
    parameters: ParameterTable
    dialect: Dialect
    vertical: Callable[[ParameterValues], VerticalProfile]
    whole_second_holds: bool = False
    fastest: float = 20.0
    fence_needs_one_inclusion: Callable[[ParameterValues], bool] = lambda _: True
    home_outside_fence: str = ""
    at_fence: Callable[[ParameterValues], FenceResponse] = lambda _: FenceResponse("nothing", "")
    fence_ahead: Callable[[ParameterValues, Real], Real] = lambda _, speed: 0 * speed
    legs: Callable[[ParameterValues], LegLimits] | None = None
    flight_model: Callable[[ParameterValues, float | None], FlightModel] | None = None
    unmodelled: str = ""
    recommended: Callable[[float, float], Sequence[Mapping[str, float]]] = lambda *_: ({},)
    ceilings: Callable[[ParameterValues], Sequence[Ceiling]] = lambda _: ()
    body: Body | None = None
    models_wind: bool = False
    true_over_commanded: Callable[[ParameterValues, float], float] = lambda *_: 1.0
    speed_rates: Callable[[ParameterValues], SpeedRates] = lambda _: SpeedRates()
    leg_durations: Callable[[ParameterValues, Real, Flags], LegDurations] | None = None
    failsafes: tuple[Failsafe, ...] = ()
    corner_speed: Callable[[ParameterValues, float], float] | None = None
    orbits: Orbits = no_orbit
    rally: Callable[[ParameterValues], RallyRule] = lambda _: RallyRule()

    @property
    def planned(self) -> bool:
        """Whether missions are made for it; those of others can be validated and uploaded."""
        return self.legs is not None and self.flight_model is not None

    def defaults(self) -> dict[str, float]:
        """Return the defaults by the autopilot's oldest names, in the autopilot's own units.

        Those of switches and bits are integers.
        """
        return {
            p.oldest_name: type(p.default)(p.written(p.default, p.oldest_name))
            for p in self.parameters.values()
        }
