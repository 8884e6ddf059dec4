"""What the plan says of site, flight, optimiser, goal, fence, mission and study."""

import math
from collections.abc import Mapping
from dataclasses import field
from typing import Annotated, Any, Literal, NamedTuple, TypeAlias

from pydantic import AfterValidator, Discriminator, Field, Tag, ValidationInfo

from faao_mav.geodesy import LocalFrame
from faao_mav.plan.fields import (
    DEFAULTS,
    Flag,
    Number,
    Position,
    Text,
    Velocity,
    Whole,
    check_degrees,
    section,
    told,
)
from faao_mav.vector import Vector

StudyScheme: TypeAlias = Literal[
    "faao", "algorithm1", "mmse", "mrt", "zf", "waterfilling", "gaussian"
]

_HOVER: Any = "hover"


@section
class Origin:
    """The point of local [0, 0], WGS84."""

    latitude: Number
    longitude: Number
    elevation: Number = 0.0

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

    speed: Number
    from_degrees: Number
    gust: Number = 0.0

    @property
    def velocity(self) -> Vector:
        """The velocity of the air over the ground, [east, north] m/s."""
        angle = math.radians(self.from_degrees)
        return 0.0 - self.speed * math.sin(angle), 0.0 - self.speed * math.cos(angle)

    def __str__(self) -> str:
        gusts = f", gusts of {self.gust:g} m/s" if self.gust > self.speed else ""
        return f"{self.speed:g} m/s from {self.from_degrees:g} degrees{gusts}"


@section
class Site:
    """Where the plan is flown."""

    origin: Annotated[Origin, AfterValidator(_keep)]
    wind: Wind = Wind(speed=0.0, from_degrees=0.0)


HIGHEST = 20_000.0
"""The greatest height, m, that is planned for, or mapped: no vehicle here flies as high. Chosen."""

_Height: TypeAlias = Annotated[Number, Field(ge=1, le=HIGHEST)]


class Heights(NamedTuple):
    """Heights above the origin of which the best is to be found, from `least` to `most`, m."""

    least: _Height
    most: _Height


@section
class Flight:
    """The flight that is optimised.

    A velocity of None is free.
    """

    start: Position
    end: Position
    height: Annotated[
        Annotated[_Height, Tag("<height>")] | Annotated[Heights, Tag("<heights>")],
        Discriminator(lambda value: "<heights>" if isinstance(value, dict) else "<height>"),
    ]
    duration: Number
    time_step: Number = 0.2
    start_velocity: Velocity = _HOVER
    end_velocity: Velocity = _HOVER
    bound_first_acceleration: Flag = True

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

    method: Literal["direct", "algorithm1"] = "direct"
    precoder: Literal["faao", "mmse", "mrt", "zf", "waterfilling"] = "faao"
    inputs: Literal["alphabet", "gaussian"] = "alphabet"
    rate: Literal["cutoff", "mutual_information"] = "cutoff"
    starts: Annotated[
        tuple[Literal["straight", "global", "bs", "user", "bs-user", "user-bs"], ...],
        Field(min_length=1),
    ] = ("global",)
    tolerance: Number = 1e-4
    max_iterations: Whole = 50


@section
class Goal:
    """What the plan is for; by default the highest rate. Duration and powers are upper limits."""

    maximise: Literal["rate", "data"] | None = None
    energy_wh: Number | None = None
    minimise: Literal["duration", "power", "energy"] | None = None
    deliver_mbytes: Number | None = None
    rate: Number | None = None

    @property
    def searches(self) -> str:
        """The key and its value where a duration or powers are looked for; else empty."""
        if self.minimise is not None:
            return f"minimise: {self.minimise}"
        return "maximise: data" if self.maximise == "data" else ""


@section
class CircleZone:
    """A circle of the fence."""

    center: Position
    radius: Number


@section
class PolygonZone:
    """A polygon of the fence."""

    polygon: Annotated[tuple[Position, ...], Field(min_length=3)]


CHOICES = ("<height>", "<heights>", "<circle>", "<polygon>", "<corners>", "<zones>")
"""What pydantic puts into the place of an error for the choice among several types."""


def _zone(value: object) -> str:
    return "<polygon>" if isinstance(value, dict) and "polygon" in value else "<circle>"


def _corners_or_zones(value: object) -> str:
    zones = isinstance(value, list) and any(
        isinstance(each, dict) and not {"latitude", "longitude"} & set(each) for each in value
    )
    return "<zones>" if zones or value == () else "<corners>"


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
    ] = ()
    exclusion: Zones = ()
    file: Text | None = None
    margin: Number = 5.0


@section
class MissionOptions:
    """How the trajectory becomes a mission."""

    takeoff: Flag = True
    on_finish: Literal["rtl", "land", "hover"] = "rtl"
    path_tolerance: Number = 2.0
    max_items: Whole = 600
    parameters: Literal["recommend", "keep"] = "recommend"


@section
class Study:
    """What `faao-mission study` varies; the main job takes no notice of it."""

    vary: Mapping[str, Annotated[tuple[Any, ...], Field(min_length=1)]] = field(
        default_factory=DEFAULTS
    )
    schemes: Annotated[tuple[StudyScheme, ...], Field(min_length=1)] = ("faao",)
    seeds: Whole = 1
    figure: Literal["delivered", "rate", "data", "trajectories"] = "delivered"
