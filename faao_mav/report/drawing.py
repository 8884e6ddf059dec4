"""A mission drawn for Google Earth, with its stations and its predicted flight over time."""

from datetime import UTC, datetime

from faao_mav.geodesy import LocalFrame
from faao_mav.mission.formats.kml import Station, TimedTrack, write_kml
from faao_mav.optimizer.solution import Solution
from faao_mav.schedule.conversion import Conversion
from faao_mav.vehicle.predict import predict

START = datetime(2000, 1, 1, tzinfo=UTC)
"""When the drawn flight begins: a plan says how long, not when."""

_STEP = 1.0  # s between the samples that are drawn


def draw_mission(solution: Solution, conversion: Conversion) -> str:
    """Return the KML document of a planned mission: route, stations, flight from `START` on."""
    plan = solution.plan
    frame = LocalFrame(plan.origin.latitude, plan.origin.longitude)
    ground = plan.origin.elevation
    radio = plan.radio
    latitudes, longitudes = frame.to_geodetic(
        [radio.base_station.position, radio.ground_user.position]
    )
    stations = [
        Station(name, float(latitude), float(longitude), ground)
        for name, latitude, longitude in zip(
            ("base station", "ground user"), latitudes, longitudes, strict=True
        )
    ]
    track = predict(conversion.mission, conversion.vehicle, frame, step=_STEP)
    spots_lat, spots_lon = frame.to_geodetic(track.position[:, :2])
    spots = [
        (float(latitude), float(longitude), float(up) + ground)
        for latitude, longitude, up in zip(spots_lat, spots_lon, track.position[:, 2], strict=True)
    ]
    flight = TimedTrack(START, [float(t) for t in track.t], spots)
    return write_kml(
        conversion.mission, name=plan.name or "relay flight", stations=stations, track=flight
    )
