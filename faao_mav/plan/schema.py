"""What stands in `plan.yaml`: keys, units, ranges, defaults.

Decibels and degrees as people write them; `reader` turns them into the SI units of `model`.
Each field's description says what is accepted and is what an error message quotes.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Any, TypeAlias

from pydantic import BaseModel, BeforeValidator, ConfigDict, Discriminator, Field, Tag
from pydantic_core import PydanticCustomError

from faao_mav.plan.autopilots import autopilots, types
from faao_mav.plan.model import (
    ChannelKnowledge,
    Fading,
    Inputs,
    LineOfSight,
    Method,
    MissionParameters,
    Modulation,
    OnFinish,
    PrecoderScheme,
    Start,
    StudyFigure,
    StudyScheme,
    Vector,
)

MAX_LOCAL_DISTANCE = 100_000.0
"""Farthest point from the origin, m: the local frame is flat to 0.01 % out to there."""
MAX_SLOTS = 100_000


@dataclass(frozen=True, slots=True)
class Degrees:
    """A position as latitude and longitude, WGS84 degrees."""

    latitude: float
    longitude: float


def _one_of(names: Callable[[], tuple[str, ...]]) -> Callable[[object], object]:
    """Return a check that a value is one of the `names` known when it is read."""

    def check(value: object) -> object:
        if value not in names():
            raise PydanticCustomError("unknown_name", "is none of the names")
        return value

    return check


def _is_number(value: object) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool)


def _finite_pair(value: object, unit: str) -> Vector:
    """Check `[east, north]`."""
    if not (isinstance(value, list) and len(value) == 2 and all(map(_is_number, value))):
        raise ValueError(f"not two numbers [east, north] in {unit}")
    east, north = map(_to_float, value)
    for component in (east, north):
        if not abs(component) < float("inf"):
            raise ValueError(f"{component} is not a finite number of {unit}")
    return east, north


def _to_float(value: float) -> float:
    try:
        return float(value)
    except OverflowError:
        return float("inf")


def _degrees(value: dict[Any, Any]) -> Degrees:
    if set(value) != {"latitude", "longitude"} or not all(map(_is_number, value.values())):
        raise ValueError("not {latitude: degrees, longitude: degrees}")
    latitude, longitude = _to_float(value["latitude"]), _to_float(value["longitude"])
    check_degrees(latitude, longitude)
    return Degrees(latitude, longitude)


def check_degrees(latitude: float, longitude: float) -> None:
    """Raise ValueError unless both are on the globe; say so when they look swapped."""
    if not abs(latitude) <= 90:
        swapped = abs(longitude) <= 90 and abs(latitude) <= 180
        hint = "; latitude and longitude look swapped" if swapped else ""
        raise ValueError(f"latitude {latitude} is outside -90..90 degrees{hint}")
    if not abs(longitude) <= 180:
        raise ValueError(f"longitude {longitude} is outside -180..180 degrees")


def _position(value: object) -> Vector | Degrees:
    if isinstance(value, dict):
        return _degrees(value)
    east, north = _finite_pair(value, "metres")
    if max(abs(east), abs(north)) > MAX_LOCAL_DISTANCE:
        raise ValueError(f"farther than {MAX_LOCAL_DISTANCE / 1000:.0f} km from the origin")
    return east, north


def _velocity(value: object) -> Vector | str:
    if isinstance(value, str) and value in ("hover", "free"):
        return value
    if isinstance(value, str):
        raise ValueError("not hover, free or a velocity")
    return _finite_pair(value, "m/s")


_POSITION = "[east, north] in metres or {latitude: degrees, longitude: degrees}"
_VELOCITY = "hover, free or [east, north] in m/s"
Position: TypeAlias = Annotated[Any, BeforeValidator(_position), Field(description=_POSITION)]
Velocity: TypeAlias = Annotated[Any, BeforeValidator(_velocity), Field(description=_VELOCITY)]

PowerDbm: TypeAlias = Annotated[
    float, Field(ge=-200, le=100, description="a power from -200 to 100 dBm")
]
NoiseDbm: TypeAlias = Annotated[
    float, Field(ge=-250, le=100, description="a noise power from -250 to 100 dBm")
]
Antennas: TypeAlias = Annotated[
    int, Field(ge=1, le=64, description="a whole number of antennas, 1 to 64")
]


class Section(BaseModel):
    """A mapping of known keys: no others, no guessing of types, no NaN or infinity."""

    model_config = ConfigDict(extra="forbid", strict=True, frozen=True, allow_inf_nan=False)


class OriginSection(Section):
    """`site.origin`."""

    latitude: float = Field(description="degrees, -90 to 90, south negative")
    longitude: float = Field(description="degrees, -180 to 180, west negative")
    elevation: float = Field(
        0.0, ge=-500, le=9000, description="metres above mean sea level, -500 to 9000"
    )


class SiteSection(Section):
    """`site`."""

    origin: OriginSection


class VehicleSection(Section):
    """`vehicle`."""

    autopilot: Annotated[str, BeforeValidator(_one_of(autopilots))] = Field(
        "ardupilot", description="ardupilot or px4"
    )
    type: Annotated[str, BeforeValidator(_one_of(types))] = Field(
        "copter", description="copter or plane"
    )
    max_speed: float = Field(gt=0, le=1000, description="a speed above 0, at most 1000 m/s")
    max_acceleration: float = Field(
        gt=0, le=1000, description="an acceleration above 0, at most 1000 m/s^2"
    )
    min_speed: float = Field(0.0, ge=0, le=1000, description="a speed from 0 m/s, below max_speed")
    parameters: dict[str, float] = Field(
        default_factory=dict, description="autopilot parameters as NAME: number"
    )


class FlightSection(Section):
    """`flight`."""

    start: Position
    end: Position
    altitude: float = Field(
        gt=0,
        le=20_000,
        description="a height above the origin in metres, above 0 (at 0 the path gain rho_0 d^-2 "
        "has no bound), at most 20000",
    )
    duration: float = Field(gt=0, le=1e7, description="a number of seconds above 0, at most 1e7")
    time_step: float = Field(
        0.2, gt=0, le=1e6, description="a number of seconds above 0, at most 1e6"
    )
    start_velocity: Velocity = "hover"
    end_velocity: Velocity = "hover"
    bound_first_acceleration: bool = Field(True, description="true or false")


class BaseStationSection(Section):
    """`radio.base_station`."""

    position: Position
    antennas: Antennas = 2
    power_dbm: PowerDbm = 20.0


class RelaySection(Section):
    """`radio.relay`."""

    antennas: Antennas = 2
    power_dbm: PowerDbm = 20.0
    noise_dbm: NoiseDbm = -80.0


class GroundUserSection(Section):
    """`radio.ground_user`."""

    position: Position
    antennas: Antennas = 2
    noise_dbm: NoiseDbm = -80.0


class RadioSection(Section):
    """`radio`."""

    base_station: BaseStationSection
    relay: RelaySection = RelaySection()
    ground_user: GroundUserSection
    modulation: Modulation = Field("bpsk", description="bpsk, qpsk, 8psk, 16qam or 64qam")
    reference_gain_db: float = Field(
        -50.0, ge=-200, le=200, description="the gain at 1 m, -200 to 200 dB"
    )
    rician_factor: float = Field(
        3.0, ge=0, le=1e6, description="the Rician factor K, linear, 0 to 1e6"
    )
    line_of_sight: LineOfSight = Field("ula", description="ula or all_ones")
    fading: Fading = Field("ergodic", description="ergodic, realization or none")
    fading_samples: int = Field(32, ge=1, le=10_000, description="a whole number, 1 to 10000")
    csi: ChannelKnowledge = Field("statistical", description="statistical or instantaneous")
    seed: int = Field(0, ge=0, lt=2**63, description="a whole number from 0")
    causal: bool = Field(False, description="true or false")


class OptimizerSection(Section):
    """`optimizer`."""

    method: Method = Field("direct", description="direct or algorithm1")
    precoder: PrecoderScheme = Field("faao", description="faao, mmse, mrt, zf or waterfilling")
    inputs: Inputs = Field("alphabet", description="alphabet or gaussian")
    starts: list[Start] = Field(
        ["straight", "bs", "user", "bs-user", "user-bs"],
        min_length=1,
        description="a list of straight, bs, user, bs-user and user-bs",
    )
    tolerance: float = Field(
        1e-4, gt=0, le=10, description="a number of bit/s/Hz above 0, at most 10"
    )
    max_iterations: int = Field(50, ge=1, le=10_000, description="a whole number, 1 to 10000")


class CircleSection(Section):
    """A circular exclusion zone of the fence."""

    center: Position
    radius: float = Field(gt=0, le=MAX_LOCAL_DISTANCE, description="a number of metres above 0")


class PolygonSection(Section):
    """A polygonal exclusion zone of the fence."""

    polygon: list[Position] = Field(min_length=3, description="three corners or more")


def _zone_kind(value: object) -> str:
    polygon = isinstance(value, dict) and "polygon" in value
    return (PolygonSection if polygon else CircleSection).__name__


Zone: TypeAlias = Annotated[
    Annotated[CircleSection, Tag(CircleSection.__name__)]
    | Annotated[PolygonSection, Tag(PolygonSection.__name__)],
    Discriminator(_zone_kind),
]


class FenceSection(Section):
    """`fence`."""

    inclusion: list[Position] | None = Field(
        None, min_length=3, description="three corners or more"
    )
    exclusion: list[Zone] = Field(
        default_factory=list, description="a list of {center, radius} and {polygon}"
    )


class MissionSection(Section):
    """`mission`."""

    takeoff: bool = Field(True, description="true or false")
    on_finish: OnFinish = Field("rtl", description="rtl, land or hover")
    path_tolerance: float = Field(
        2.0, ge=0.1, le=1000, description="a number of metres, 0.1 to 1000"
    )
    max_items: int = Field(600, ge=2, le=65_535, description="a whole number, 2 to 65535")
    parameters: MissionParameters = Field("recommend", description="recommend or keep")


class StudySection(Section):
    """`study`."""

    vary: dict[str, Annotated[list[Any], Field(min_length=1, description="a list of values")]] = (
        Field(default_factory=dict, description="lists of values by dotted key")
    )
    schemes: list[StudyScheme] = Field(
        ["faao"],
        min_length=1,
        description="a list of faao, algorithm1, mmse, mrt, zf, waterfilling and gaussian",
    )
    seeds: int = Field(1, ge=1, le=10_000, description="a whole number, 1 to 10000")
    figure: StudyFigure = Field("rate", description="rate or trajectories")


class PlanSection(Section):
    """The whole file."""

    name: str = Field("", max_length=200, description="text of at most 200 characters")
    site: SiteSection
    vehicle: VehicleSection
    flight: FlightSection
    radio: RadioSection
    optimizer: OptimizerSection = OptimizerSection()
    fence: FenceSection | None = None
    mission: MissionSection = MissionSection()
    study: StudySection | None = None


NOT_YET: tuple[tuple[str, object, str], ...] = (("radio.causal", True, "leave it false"),)
"""Values that the schema knows and the program does not, with what to write instead."""
