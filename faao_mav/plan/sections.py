"""What the plan says of site, vehicle, flight, optimiser, goal, mission and study."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Annotated, Any, Literal, TypeAlias

from pydantic import AfterValidator, PlainValidator, ValidationInfo

from faao_mav.autopilot.body import Body
from faao_mav.plan.autopilots import AutopilotName, KindName, body_of
from faao_mav.plan.energy import Battery, PowerOptions
from faao_mav.plan.fields import (
    Flag,
    Number,
    Position,
    Section,
    Velocity,
    Whole,
    check_degrees,
    key,
    told,
)
from faao_mav.vector import Vector

Method: TypeAlias = Literal["direct", "algorithm1"]
PrecoderScheme: TypeAlias = Literal["faao", "mmse", "mrt", "zf", "waterfilling"]
Inputs: TypeAlias = Literal["alphabet", "gaussian"]
Rate: TypeAlias = Literal["cutoff", "mutual_information"]
Start: TypeAlias = Literal["straight", "global", "bs", "user", "bs-user", "user-bs"]
OnFinish: TypeAlias = Literal["rtl", "land", "hover"]
MissionParameters: TypeAlias = Literal["recommend", "keep"]
StudyScheme: TypeAlias = Literal[
    "faao", "algorithm1", "mmse", "mrt", "zf", "waterfilling", "gaussian"
]
StudyFigure: TypeAlias = Literal["delivered", "rate", "trajectories"]
Maximised: TypeAlias = Literal["rate", "data"]
Minimised: TypeAlias = Literal["duration", "power", "energy"]

_HOVER = (0.0, 0.0)


@dataclass(frozen=True, slots=True)
class Origin(Section):
    """The point of local [0, 0], WGS84."""

    latitude: Annotated[Number, key("Latitude.", "degrees", "degrees, -90 to 90, south negative")]
    longitude: Annotated[
        Number, key("Longitude.", "degrees", "degrees, -180 to 180, west negative")
    ]
    elevation: Annotated[Number, key("Height above mean sea level.", "m", ge=-500, le=9000)] = 0.0


def _keep(origin: Origin, info: ValidationInfo) -> Origin:
    """Check the origin, and keep it for the positions in degrees, which are read after it."""
    try:
        check_degrees(origin.latitude, origin.longitude)
    except ValueError as error:
        raise told(str(error)) from None
    context: Any = info.context
    context["origin"] = (origin.latitude, origin.longitude)
    return origin


@dataclass(frozen=True, slots=True)
class Wind(Section):
    """The steady wind of the flight, everywhere the same.

    >>> tuple(round(each, 6) for each in Wind(5.0, 270.0).velocity)  # a west wind
    (5.0, 0.0)
    """

    speed: Annotated[Number, key("Mean speed of the wind.", "m/s", ge=0, le=50)]
    from_degrees: Annotated[
        Number,
        key(
            "Where the wind comes from, clockwise from north: 270 is a west wind.",
            "degrees",
            name="from",
            ge=0,
            le=360,
        ),
    ]
    gust: Annotated[
        Number, key("Speed of the wind in gusts; below `speed`: no gusts.", "m/s", ge=0, le=100)
    ] = 0.0

    @property
    def velocity(self) -> Vector:
        """The velocity of the air over the ground, [east, north] m/s."""
        angle = math.radians(self.from_degrees)
        return 0.0 - self.speed * math.sin(angle), 0.0 - self.speed * math.cos(angle)


@dataclass(frozen=True, slots=True)
class Site(Section):
    """Where the plan is flown."""

    origin: Annotated[Origin, AfterValidator(_keep)]
    wind: Wind = Wind(0.0, 0.0)


@dataclass(frozen=True, slots=True, kw_only=True)
class VehicleOptions(Section):
    """The aircraft and its limits."""

    autopilot: Annotated[AutopilotName, key("The autopilot that the mission is for.")] = "ardupilot"
    type: Annotated[KindName, key("The kind of aircraft; a plane with ArduPilot.")] = "copter"
    max_speed: Annotated[
        Number,
        key(
            "Largest speed v_max, over the ground; of a plane, through the air.",
            "m/s",
            gt=0,
            le=1000,
        ),
    ]
    max_acceleration: Annotated[Number, key("Largest acceleration a_max.", "m/s^2", gt=0, le=1000)]
    min_speed: Annotated[
        Number,
        key(
            "Least speed v_min through the air: above 0 both ends are free or velocities.",
            "m/s",
            "a speed from 0 m/s, below max_speed",
            ge=0,
            le=1000,
        ),
    ] = 0.0
    max_airspeed: Annotated[
        Number | None,
        key(
            "Largest airspeed of a plan with a wind; null: what the vehicle holds, for a plane "
            "max_speed.",
            "m/s",
            gt=0,
            le=1000,
        ),
    ] = None
    parameters: Annotated[
        Mapping[str, Number],
        key(
            "Parameters of the autopilot, in its own units, that the flight is predicted with.",
            accepted="autopilot parameters as NAME: number",
        ),
    ] = field(default_factory=dict)
    body: Annotated[
        Body | None,
        PlainValidator(body_of),
        key(
            "The airframe that flights are predicted with: numbers over those of the simulator's.",
            accepted="sitl, the airframe of the autopilot's simulator, or a mapping of its numbers",
        ),
    ] = None
    power: PowerOptions | None = None
    battery: Battery | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Flight(Section):
    """The flight that is optimised.

    A velocity of None is free.
    """

    start: Annotated[Position, key("Where the flight starts, w_I.", "m")]
    end: Annotated[Position, key("Where the flight ends, w_F.", "m")]
    altitude: Annotated[
        Number,
        key(
            "Height H above the origin.",
            "m",
            "a height above the origin in metres, 1 (an aircraft that is lower has hardly left the "
            "ground) to 20000",
            ge=1,
            le=20_000,
        ),
    ]
    duration: Annotated[
        Number,
        key(
            "Duration T, a whole number of time steps; w_F is reached one step before its end.",
            "s",
            gt=0,
            le=1e7,
        ),
    ]
    time_step: Annotated[Number, key("Length delta_t of a time slot.", "s", gt=0, le=1e6)] = 0.2
    start_velocity: Annotated[Velocity, key("Velocity at the start; the paper: free.", "m/s")] = (
        _HOVER
    )
    end_velocity: Annotated[Velocity, key("Velocity at the end; the paper: free.", "m/s")] = _HOVER
    bound_first_acceleration: Annotated[
        Flag, key("Whether a_max bounds a(0) too, which the paper leaves unbounded.")
    ] = True

    @property
    def slots(self) -> int:
        """Number of time slots, N + 2 = T / delta_t."""
        return round(self.duration / self.time_step)


@dataclass(frozen=True, slots=True, kw_only=True)
class Optimizer(Section):
    """How the plan is optimised."""

    method: Annotated[Method, key("The direct method, or the paper's Algorithm 1.")] = "direct"
    precoder: Annotated[PrecoderScheme, key("The precoders that the route is for.")] = "faao"
    inputs: Annotated[
        Inputs, key("Inputs that the design is for; what is reported is the alphabet's rate.")
    ] = "alphabet"
    rate: Annotated[
        Rate, key("The rate that counts: what every code carries, or what the best come near to.")
    ] = "cutoff"
    starts: Annotated[
        tuple[Start, ...], key("Routes that the direct method starts from.", min_length=1)
    ] = ("straight", "bs", "user", "bs-user", "user-bs")
    tolerance: Annotated[
        Number,
        key(
            "Algorithm 1: change of R_avg at which it ends; direct: largest residual.",
            "bit/s/Hz",
            gt=0,
            le=10,
        ),
    ] = 1e-4
    max_iterations: Annotated[
        Whole,
        key(
            "Iterations of Algorithm 1; Newton steps per start of the direct method, which takes "
            "six times as many at most for a queue with a buffer, half duplex or a least speed.",
            ge=1,
            le=10_000,
        ),
    ] = 50


@dataclass(frozen=True, slots=True, kw_only=True)
class Goal(Section):
    """What the plan is for; by default the highest rate. Duration and powers are upper limits."""

    maximise: Annotated[
        Maximised | None,
        key("What is maximised: the rate, or the data within energy_wh.", accepted="rate or data"),
    ] = None
    energy_wh: Annotated[
        Number | None,
        key(
            "Energy of the planned flight and its relay (needs vehicle.power).", "Wh", gt=0, le=1e6
        ),
    ] = None
    minimise: Annotated[
        Minimised | None,
        key(
            "What is minimised: the duration in whole time steps, both powers by the same dB, or "
            "the energy of the planned flight and its relay (needs vehicle.power).",
            accepted="duration, power or energy",
        ),
    ] = None
    deliver_mbytes: Annotated[
        Number | None,
        key("What has to be delivered (needs radio.bandwidth_mhz).", "megabytes", gt=0, le=1e9),
    ] = None
    rate: Annotated[
        Number | None,
        key("Instead: the delivered rate R_del that is needed.", "bit/s/Hz", gt=0, le=1e4),
    ] = None

    @property
    def searches(self) -> str:
        """The key and its value where a duration or powers are looked for; else empty."""
        if self.minimise is not None:
            return f"minimise: {self.minimise}"
        return "maximise: data" if self.maximise == "data" else ""

    @property
    def counts_energy(self) -> bool:
        """Whether the energy of the flight has a part in the goal."""
        return self.minimise == "energy" or self.maximise == "data"


@dataclass(frozen=True, slots=True, kw_only=True)
class MissionOptions(Section):
    """How the trajectory becomes a mission."""

    takeoff: Annotated[Flag, key("Whether the mission begins with a take-off.")] = True
    on_finish: Annotated[OnFinish, key("What the aircraft does at the end.")] = "rtl"
    path_tolerance: Annotated[
        Number, key("Largest distance of the predicted flight from the path.", "m", ge=0.1, le=1000)
    ] = 2.0
    max_items: Annotated[
        Whole, key("Most items of the mission, the home row included.", ge=2, le=65_535)
    ] = 600
    parameters: Annotated[
        MissionParameters,
        key(
            "recommend: time the mission for limits that suit it, and write them beside it; "
            "keep: fit it to the vehicle's."
        ),
    ] = "recommend"


@dataclass(frozen=True, slots=True, kw_only=True)
class Study(Section):
    """What `faao-mission study` varies; the main job takes no notice of it."""

    vary: Annotated[
        Mapping[
            str, Annotated[tuple[Any, ...], key("", accepted="a list of values", min_length=1)]
        ],
        key(
            "Values by dotted key; power_dbm stands for both powers.",
            accepted="lists of values by dotted key",
        ),
    ] = field(default_factory=dict)
    schemes: Annotated[tuple[StudyScheme, ...], key("Designs to compare.", min_length=1)] = (
        "faao",
    )
    seeds: Annotated[Whole, key("Draws of the fading, from radio.seed on.", ge=1, le=10_000)] = 1
    figure: Annotated[
        StudyFigure, key("What the figure shows: the delivered rate, R_avg, or the routes.")
    ] = "delivered"
