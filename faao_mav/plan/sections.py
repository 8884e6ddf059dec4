"""A mission plan: what is flown, where, and over which radio link.

`Plan` is what the rest of the program sees: validated, SI and linear units, frozen. The same
declarations say what `plan.yaml` may hold: each field is a key, with what it means, its unit and
its limits. `fields` says how, `keys.reference` lists them all.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Annotated, Any, Literal, TypeAlias

from pydantic import (
    AfterValidator,
    Discriminator,
    Field,
    Tag,
    ValidationInfo,
)

from faao_mav.geodesy import LocalFrame
from faao_mav.mission.fence import Fence
from faao_mav.mission.fence_area import Area, FreeArea, areas_of
from faao_mav.plan.autopilots import VEHICLES, PlannedVehicle
from faao_mav.plan.energy import Battery, PowerOptions
from faao_mav.plan.fields import (
    MAX_LOCAL_DISTANCE,
    Antennas,
    AutopilotName,
    Flag,
    Gain,
    Noise,
    Number,
    Position,
    Power,
    Section,
    Text,
    TypeName,
    Vector,
    Velocity,
    Whole,
    check_degrees,
    key,
    linear,
    told,
    watts,
)
from faao_mav.power import PowerModel

Modulation: TypeAlias = Literal["bpsk", "qpsk", "8psk", "16qam", "64qam"]
LineOfSight: TypeAlias = Literal["ula", "all_ones"]
Fading: TypeAlias = Literal["ergodic", "realization", "none"]
ChannelKnowledge: TypeAlias = Literal["statistical", "instantaneous"]
Duplex: TypeAlias = Literal["full", "half"]
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
Maximised: TypeAlias = Literal["rate"]
Minimised: TypeAlias = Literal["duration", "power"]

_HOVER = (0.0, 0.0)
_POWER, _NOISE, _GAIN = watts(20), watts(-80), linear(-50)


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
    type: Annotated[TypeName, key("The kind of aircraft; a plane with ArduPilot.")] = "copter"
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
            "a height above the origin in metres, above 0 (at 0 the path gain rho_0 d^-2 has no "
            "bound), at most 20000",
            gt=0,
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
class BaseStation(Section):
    """The base station."""

    position: Annotated[Position, key("Place p_B.", "m")]
    antennas: Annotated[Antennas, key("Antennas N_t.")] = 2
    power: Annotated[Power, key("Transmit power W_B.", "dBm", name="power_dbm")] = _POWER


@dataclass(frozen=True, slots=True, kw_only=True)
class Relay(Section):
    """The radio aboard."""

    antennas: Annotated[Antennas, key("Antennas N_u.")] = 2
    power: Annotated[Power, key("Transmit power W_U.", "dBm", name="power_dbm")] = _POWER
    noise: Annotated[Noise, key("Noise power sigma_U^2.", "dBm", name="noise_dbm")] = _NOISE
    buffer_mbytes: Annotated[
        Number | None,
        key(
            "What the relay can hold (needs radio.bandwidth_mhz); null: any amount.",
            "megabytes",
            gt=0,
            le=1e9,
        ),
    ] = None


@dataclass(frozen=True, slots=True, kw_only=True)
class GroundUser(Section):
    """The ground user."""

    position: Annotated[Position, key("Place p_U.", "m")]
    antennas: Annotated[Antennas, key("Antennas N_r.")] = 2
    noise: Annotated[Noise, key("Noise power sigma_G^2.", "dBm", name="noise_dbm")] = _NOISE


@dataclass(frozen=True, slots=True, kw_only=True)
class Radio(Section):
    """Both links."""

    base_station: BaseStation
    relay: Relay = field(default_factory=Relay)
    ground_user: GroundUser
    modulation: Annotated[Modulation, key("The alphabet of both hops.")] = "bpsk"
    reference_gain: Annotated[
        Gain, key("Power gain rho_0 at 1 m.", "dB", name="reference_gain_db")
    ] = _GAIN
    rician_factor: Annotated[Number, key("Rician factor K, linear.", ge=0, le=1e6)] = 3.0
    line_of_sight: Annotated[
        LineOfSight,
        key("ula: half-wavelength arrays along east, follows the aircraft; all_ones: ones."),
    ] = "ula"
    fading: Annotated[
        Fading,
        key(
            "ergodic: the mean over fading; realization: one known draw per slot, as in the paper; "
            "none: the line of sight alone."
        ),
    ] = "ergodic"
    fading_samples: Annotated[
        Whole, key("Draws that the mean over fading is taken over.", ge=1, le=10_000)
    ] = 32
    csi: Annotated[
        ChannelKnowledge,
        key("Ergodic fading: one precoder per slot (statistical) or per draw (instantaneous)."),
    ] = "statistical"
    seed: Annotated[
        Whole, key("Seed of the draws.", accepted="a whole number from 0", ge=0, lt=2**63)
    ] = 0
    causal: Annotated[
        Flag,
        key(
            "true: plan for what is delivered by a relay that forwards only what it has received; "
            "false: for R_avg, as in the paper."
        ),
    ] = True
    duplex: Annotated[
        Duplex,
        key("full: two bands, one for each hop; half: both hops share the time of each slot."),
    ] = "full"
    bandwidth_mhz: Annotated[
        Number | None,
        key(
            "Bandwidth of a hop, to tell rates in Mbit/s and flights in megabytes; null: not told.",
            "MHz",
            gt=0,
            le=1e5,
        ),
    ] = None

    @property
    def maximised(self) -> str:
        """The name of the rate that is maximised."""
        return "R_del" if self.causal else "R_avg"


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
    ] = ("straight", "bs", "user", "bs-user", "user-bs", "global")
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

    maximise: Annotated[Maximised | None, key("What is maximised.", accepted="rate")] = None
    minimise: Annotated[
        Minimised | None,
        key(
            "What is minimised: the duration in whole time steps, or both powers by the same dB.",
            accepted="duration or power",
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


@dataclass(frozen=True, slots=True)
class CircleZone(Section):
    """A circle of the fence."""

    center: Annotated[Position, key("Centre of the circle.", "m")]
    radius: Annotated[Number, key("Radius of the circle.", "m", gt=0, le=MAX_LOCAL_DISTANCE)]


@dataclass(frozen=True, slots=True)
class PolygonZone(Section):
    """A polygon of the fence."""

    polygon: Annotated[
        tuple[Position, ...], key("Corners.", "m", "three corners or more", min_length=3)
    ]


CHOICES = ("<circle>", "<polygon>", "<corners>", "<zones>")
"""What pydantic puts into the place of an error for the choice among several types."""


def _zone(value: object) -> str:
    return "<polygon>" if isinstance(value, dict) and "polygon" in value else "<circle>"


def _corners_or_zones(value: object) -> str:
    zones = isinstance(value, list | tuple) and any(
        isinstance(each, dict) and not {"latitude", "longitude"} & set(each) for each in value
    )
    return "<zones>" if zones else "<corners>"


def _one_polygon(corners: tuple[Vector, ...]) -> tuple[PolygonZone, ...]:
    return (PolygonZone(corners),) if corners else ()


Zone: TypeAlias = Annotated[
    Annotated[CircleZone, Tag("<circle>")] | Annotated[PolygonZone, Tag("<polygon>")],
    Discriminator(_zone),
]
Zones: TypeAlias = tuple[Zone, ...]
_OnePolygon: TypeAlias = Annotated[
    tuple[Position, ...], Field(min_length=3), AfterValidator(_one_polygon)
]


@dataclass(frozen=True, slots=True)
class FenceOptions(Section):
    """Where the aircraft may be: it stays inside the inclusions and out of the exclusions."""

    inclusion: Annotated[
        Annotated[_OnePolygon, Tag("<corners>")] | Annotated[Zones, Tag("<zones>")],
        Discriminator(_corners_or_zones),
        key(
            "Area to stay in; of several zones PX4 asks for any, ArduPilot for all.",
            "m",
            "three corners or more, or a list of {center, radius} and {polygon}",
        ),
    ] = ()
    exclusion: Annotated[
        Zones,
        key("Zones to stay out of.", accepted="a list of {center, radius} and {polygon}"),
    ] = ()
    file: Annotated[
        Text | None,
        key(
            "File with more zones, beside the plan's file or by its whole path.",
            accepted="the name of a .plan, .kml or .geojson file",
        ),
    ] = None
    margin: Annotated[
        Number, key("Distance from the edge that the planned path keeps.", "m", ge=0, le=10_000)
    ] = 5.0


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


@dataclass(frozen=True, slots=True, kw_only=True)
class PlanFile(Section):
    """What the file of a plan holds."""

    name: Annotated[
        Text,
        key(
            "Name, for the summary.",
            "",
            "one line of at most 200 printable characters",
            max_length=200,
        ),
    ] = ""
    site: Site
    vehicle: VehicleOptions
    flight: Flight
    radio: Radio
    optimizer: Optimizer = field(default_factory=Optimizer)
    goal: Goal = field(default_factory=Goal)
    fence: FenceOptions | None = None
    mission: MissionOptions = field(default_factory=MissionOptions)
    study: Study | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Plan(PlanFile):
    """A validated plan; `text` is the YAML that it was read from, `source` the name of its file.

    `geofence` has the zones of `fence` and of its file, in degrees.
    """

    text: str = ""
    source: str = "plan"
    geofence: Fence = field(default_factory=Fence)

    @property
    def origin(self) -> Origin:
        """The point of local [0, 0]."""
        return self.site.origin

    @property
    def power_model(self) -> PowerModel | None:
        """What flight takes; None where the plan does not say."""
        asked = self.vehicle.power
        return None if asked is None else asked.model(hovers=self._known.hovers)

    @property
    def powers(self) -> tuple[float, float]:
        """W_B and W_U, W."""
        return self.radio.base_station.power, self.radio.relay.power

    @property
    def wind(self) -> Vector:
        """The velocity of the air over the ground, [east, north] m/s."""
        return self.site.wind.velocity

    @property
    def max_ground_speed(self) -> float:
        """The greatest speed over the ground, m/s: a plane's may be above `vehicle.max_speed`."""
        most = self.vehicle.max_speed
        return most if self._known.hovers else most + self.site.wind.speed

    @property
    def max_airspeed(self) -> float:
        """The greatest airspeed in the mean wind, m/s, with what gusts take off.

        Infinite where the limit on the speed over the ground is enough.
        """
        wind, most = self.site.wind, self.vehicle.max_airspeed
        gusts = max(0.0, wind.gust - wind.speed)
        if most is None:
            most = self._known.max_airspeed if wind.speed or gusts else math.inf
        if not self._known.hovers:
            most = min(most, self.vehicle.max_speed)
        return most - gusts if most - gusts < self.max_ground_speed + wind.speed else math.inf

    @property
    def _known(self) -> PlannedVehicle:
        return VEHICLES[self.vehicle.autopilot, self.vehicle.type]

    @property
    def zones(self) -> tuple[Area, ...]:
        """The zones of `geofence` in local metres."""
        return _zones(self.geofence, LocalFrame(self.origin.latitude, self.origin.longitude))

    @property
    def any_inclusion(self) -> bool:
        """Whether the vehicle's fence asks for one of several inclusions, not for all of them."""
        return self._known.any_inclusion

    @property
    def keep_in(self) -> FreeArea | None:
        """Where `geofence` lets the aircraft be, local metres; None without a fence.

        `fence.margin` is not taken off.
        """
        if not self.geofence:
            return None
        return _free_area(self.zones, self.any_inclusion)

    def megabits(self, rate: float) -> float | None:
        """Return `rate`, bit/s/Hz, in Mbit/s; None without `radio.bandwidth_mhz`."""
        bandwidth = self.radio.bandwidth_mhz
        return None if bandwidth is None else rate * bandwidth

    def megabytes(self, rate: float) -> float | None:
        """Return what `rate`, bit/s/Hz, carries in the duration T, 10^6 bytes, as `megabits`."""
        megabits = self.megabits(rate)
        return None if megabits is None else megabits * self.flight.duration / 8

    @property
    def needed_rate(self) -> float:
        """The delivered rate that `goal` asks for in the duration T, bit/s/Hz; 0 if for none."""
        asked, bandwidth = self.goal.deliver_mbytes, self.radio.bandwidth_mhz
        if asked is None or bandwidth is None:
            return self.goal.rate or 0.0
        return 8 * asked / (bandwidth * self.flight.duration)


@lru_cache(maxsize=16)
def _zones(fence: Fence, frame: LocalFrame) -> tuple[Area, ...]:
    return areas_of(fence, frame)


@lru_cache(maxsize=16)
def _free_area(zones: tuple[Area, ...], any_inclusion: bool) -> FreeArea:
    return FreeArea.of(zones, any_inclusion=any_inclusion)
