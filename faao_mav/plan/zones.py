"""What the plan says of where the aircraft may be: `fence`."""

from typing import Annotated, TypeAlias

from pydantic import AfterValidator, Discriminator, Field, Tag

from faao_mav.plan.fields import MAX_LOCAL_DISTANCE, Number, Position, Text, key, section
from faao_mav.vector import Vector


@section
class CircleZone:
    """A circle of the fence."""

    center: Position = key("Centre of the circle.", "m")
    radius: Number = key("Radius of the circle.", "m", gt=0, le=MAX_LOCAL_DISTANCE)


@section
class PolygonZone:
    """A polygon of the fence."""

    polygon: tuple[Position, ...] = key("Corners.", "m", "three corners or more", min_length=3)


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
