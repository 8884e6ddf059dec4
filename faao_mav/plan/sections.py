"""What the plan says of site, flight, optimiser, goal, fence, mission and study."""

import math
from collections.abc import Mapping
from typing import Annotated, Any, Literal, NamedTuple, TypeAlias

from pydantic import (
    AfterValidator,
    Discriminator,
    Field,
    Tag,
    ValidationInfo,
)

from faao_mav.geodesy import LocalFrame
from faao_mav.plan.fields import (
    MAX_LOCAL_DISTANCE,
    Flag,
    Number,
    Position,
    Text,
    Velocity,
    Whole,
    check_degrees,
    key,
    section,
    told,
)
from faao_mav.vector import Vector

StudyScheme: TypeAlias = Literal[
    "faao", "algorithm1", "mmse", "mrt", "zf", "waterfilling", "gaussian"
]

_HOVER = (0.0, 0.0)


@section
class Origin:
    """The point of local [0, 0], WGS84."""

    latitude: Number = key("Latitude.", "degrees", "degrees, -90 to 90, south negative")
    longitude: Number = key("Longitude.", "degrees", "degrees, -180 to 180, west negative")
    elevation: Number = key("Height above mean sea level.", "[-500, 9000] m", default=0.0)

    @property
    def frame(self) -> LocalFrame:
        """The local frame about it."""
        return LocalFrame(self.latitude, self.longitude)


def _keep(origin: Origin, info: ValidationInfo) -> Origin:
    """Check the origin, and keep it for the positions in degrees, which are read after it."""
    try:
        check_degrees(origin.latitude, origin.longitude)
    except ValueError as error:
        raise told(str(error)) from None
    context: Any = info.context
    context["origin"] = (origin.latitude, origin.longitude)
    context["elevation"] = origin.elevation
    return origin


@section
class Wind:
    """The steady wind of the flight, everywhere the same.

    >>> west = Wind(speed=5.0, from_degrees=270.0)
    >>> tuple(round(each, 6) for each in west.velocity)
    (5.0, 0.0)
    """

    speed: Number = key("Mean speed of the wind.", "[0, 50] m/s")
    from_degrees: Number = key(
        "Where it comes from, clockwise from north: 270 is west.", "[0, 360] degrees", name="from"
    )
    gust: Number = key("Speed in gusts; below `speed`: no gusts.", "[0, 100] m/s", default=0.0)

    @property
    def velocity(self) -> Vector:
        """The velocity of the air over the ground, [east, north] m/s."""
        angle = math.radians(self.from_degrees)
        return 0.0 - self.speed * math.sin(angle), 0.0 - self.speed * math.cos(angle)


@section
class Site:
    """Where the plan is flown."""

    origin: Annotated[Origin, AfterValidator(_keep)]
    wind: Wind = Wind(speed=0.0, from_degrees=0.0)


_Height: TypeAlias = Annotated[Number, Field(ge=1, le=20000)]


class Heights(NamedTuple):
    """Heights above the origin of which the best is to be found, from `least` to `most`, m."""

    least: _Height
    most: _Height


def _rising(height: float | Heights) -> float | Heights:
    if isinstance(height, Heights) and height.least >= height.most:
        raise ValueError("the least is not below the most")
    return height


@section
class Flight:
    """The flight that is optimised.

    A velocity of None is free.
    """

    start: Position = key("Where the flight starts, w_I.", "m")
    end: Position = key("Where the flight ends, w_F.", "m")
    height: Annotated[
        Annotated[_Height, Tag("<height>")] | Annotated[Heights, Tag("<heights>")],
        Discriminator(lambda value: "<heights>" if isinstance(value, dict) else "<height>"),
        AfterValidator(_rising),
    ] = key(
        "Height H above the origin, or those of which the best is to be found.",
        "m",
        "a height above the origin in metres, 1 (an aircraft that is lower has hardly left the "
        "ground) to 20000, or {least: metres, most: metres}",
        name="altitude",
    )
    duration: Number = key(
        "Duration T, in whole time steps; w_F is reached one step before its end.", "(0, 1e7] s"
    )
    time_step: Number = key("Length delta_t of a time slot.", "(0, 1e6] s", default=0.2)
    start_velocity: Velocity = key("Velocity at the start; the paper: free.", "m/s", default=_HOVER)
    end_velocity: Velocity = key("Velocity at the end; the paper: free.", "m/s", default=_HOVER)
    bound_first_acceleration: Flag = key(
        "Whether a_max bounds a(0) too, which the paper leaves unbounded.", default=True
    )

    @property
    def altitude(self) -> float:
        """The height H above the origin, m: the greatest until the best is found."""
        return self.height.most if isinstance(self.height, Heights) else self.height

    @property
    def slots(self) -> int:
        """Number of time slots, N + 2 = T / delta_t."""
        return round(self.duration / self.time_step)


@section
class Optimizer:
    """How the plan is optimised."""

    method: Literal["direct", "algorithm1"] = key(
        "The direct method, or the paper's Algorithm 1.", default="direct"
    )
    precoder: Literal["faao", "mmse", "mrt", "zf", "waterfilling"] = key(
        "The precoders that the route is for.", default="faao"
    )
    inputs: Literal["alphabet", "gaussian"] = key(
        "Inputs that the design is for; what is told is the alphabet's rate.", default="alphabet"
    )
    rate: Literal["cutoff", "mutual_information"] = key(
        "The rate that counts: what any code carries, or what the best approach.", default="cutoff"
    )
    starts: tuple[Literal["straight", "global", "bs", "user", "bs-user", "user-bs"], ...] = key(
        "Routes that the direct method starts from.",
        min_length=1,
        default=("straight", "bs", "user", "bs-user", "user-bs"),
    )
    tolerance: Number = key(
        "Algorithm 1: change of R_avg at which it ends; direct: largest residual.",
        "(0, 10] bit/s/Hz",
        default=1e-4,
    )
    max_iterations: Whole = key(
        "Iterations of Algorithm 1; Newton steps per start of the direct method, which takes "
        "six times as many at most for a queue with a buffer, half duplex or a least speed.",
        "[1, 10000]",
        default=50,
    )


@section
class Goal:
    """What the plan is for; by default the highest rate. Duration and powers are upper limits."""

    maximise: Literal["rate", "data"] | None = key(
        "What is maximised: the rate, or the data within energy_wh.", default=None
    )
    energy_wh: Number | None = key(
        "Energy of the flight and its relay (needs vehicle.power).", "(0, 1e6] Wh", default=None
    )
    minimise: Literal["duration", "power", "energy"] | None = key(
        "What is minimised: the duration in whole time steps, both powers by the same dB, or "
        "the energy of the planned flight and its relay (needs vehicle.power).",
        default=None,
    )
    deliver_mbytes: Number | None = key(
        "What has to be delivered (needs radio.bandwidth_mhz).", "(0, 1e9] megabytes", default=None
    )
    rate: Number | None = key(
        "Instead: the delivered rate R_del that is needed.", "(0, 10000] bit/s/Hz", default=None
    )

    @property
    def searches(self) -> str:
        """The key and its value where a duration or powers are looked for; else empty."""
        if self.minimise is not None:
            return f"minimise: {self.minimise}"
        return "maximise: data" if self.maximise == "data" else ""


@section
class CircleZone:
    """A circle of the fence."""

    center: Position = key("Centre of the circle.", "m")
    radius: Number = key("Radius of the circle.", "m", gt=0, le=MAX_LOCAL_DISTANCE)


@section
class PolygonZone:
    """A polygon of the fence."""

    polygon: tuple[Position, ...] = key("Corners.", "m", "three corners or more", min_length=3)


CHOICES = ("<height>", "<heights>", "<circle>", "<polygon>", "<corners>", "<zones>")
"""What pydantic puts into the place of an error for the choice among several types."""


def _zone(value: object) -> str:
    return "<polygon>" if isinstance(value, dict) and "polygon" in value else "<circle>"


def _corners_or_zones(value: object) -> str:
    zones = isinstance(value, list | tuple) and any(
        isinstance(each, dict) and not {"latitude", "longitude"} & set(each) for each in value
    )
    return "<zones>" if zones else "<corners>"


def _one_polygon(corners: tuple[Vector, ...]) -> tuple[PolygonZone, ...]:
    return (PolygonZone(polygon=corners),) if corners else ()


Zone: TypeAlias = Annotated[
    Annotated[CircleZone, Tag("<circle>")] | Annotated[PolygonZone, Tag("<polygon>")],
    Discriminator(_zone),
]
Zones: TypeAlias = tuple[Zone, ...]
_OnePolygon: TypeAlias = Annotated[
    tuple[Position, ...], Field(min_length=3), AfterValidator(_one_polygon)
]


@section
class FenceOptions:
    """Where the aircraft may be: it stays inside the inclusions and out of the exclusions."""

    inclusion: Annotated[
        Annotated[_OnePolygon, Tag("<corners>")] | Annotated[Zones, Tag("<zones>")],
        Discriminator(_corners_or_zones),
    ] = key(
        "Area to stay in; of several zones PX4 asks for any, ArduPilot for all.",
        "m",
        "three corners or more, or a list of {center, radius} and {polygon}",
        default=(),
    )
    exclusion: Zones = key(
        "Zones to stay out of.", accepted="a list of {center, radius} and {polygon}", default=()
    )
    file: Text | None = key(
        "File with more zones, beside the plan's file or by its whole path.",
        accepted="the name of a .plan, .kml or .geojson file",
        default=None,
    )
    margin: Number = key("Distance that the plan keeps from the edge.", "[0, 10000] m", default=5.0)


@section
class MissionOptions:
    """How the trajectory becomes a mission."""

    takeoff: Flag = key("Whether the mission begins with a take-off.", default=True)
    on_finish: Literal["rtl", "land", "hover"] = key("What is done at the end.", default="rtl")
    path_tolerance: Number = key(
        "Largest distance of the predicted flight from the path.", "[0.1, 1000] m", default=2.0
    )
    max_items: Whole = key("Most mission items, the home row included.", "[2, 65535]", default=600)
    parameters: Literal["recommend", "keep"] = key(
        "recommend: time the mission for limits that suit it, and write them beside it; "
        "keep: fit it to the vehicle's.",
        default="recommend",
    )


@section
class Study:
    """What `faao-mission study` varies; the main job takes no notice of it."""

    vary: Mapping[str, Annotated[tuple[Any, ...], Field(min_length=1)]] = key(
        "Values by dotted key; power_dbm stands for both powers.",
        accepted="lists of values by dotted key",
        default_factory=dict,
    )
    schemes: tuple[StudyScheme, ...] = key("Designs to compare.", min_length=1, default=("faao",))
    seeds: Whole = key("Draws of the fading, from radio.seed on.", "[1, 10000]", default=1)
    figure: Literal["delivered", "rate", "trajectories"] = key(
        "What the figure shows: the delivered rate, R_avg, or the routes.", default="delivered"
    )
