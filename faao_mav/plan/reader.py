"""`plan.yaml` -> `Plan`."""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml
from pydantic import ValidationError

from faao_mav.errors import PlanError
from faao_mav.files import read_text
from faao_mav.geodesy import LocalFrame
from faao_mav.plan import model, schema
from faao_mav.plan.autopilots import VEHICLES
from faao_mav.plan.keys import unknown_key, varied_twice
from faao_mav.plan.messages import describe, quote
from faao_mav.plan.reach import reach, shortest_duration
from faao_mav.plan.yaml_text import MAX_CHARACTERS, load_yaml


def read_plan(path: str | Path, *, method: str | None = None) -> model.Plan:
    """Read and validate the plan in the file `path`.

    `method`, where given, replaces `optimizer.method`. Raises `PlanError` that names the file,
    the key, the value and what would be accepted.
    """
    text = read_text(path, 4 * MAX_CHARACTERS, "a plan", PlanError).removeprefix("\ufeff")
    return parse_plan(text, str(path), method=method)


def parse_plan(text: str, source: str = "plan", *, method: str | None = None) -> model.Plan:
    """Validate the plan in `text`; `source` names it in messages. See `read_plan`."""
    data = load_yaml(text, source)
    if method is not None:
        section = data.setdefault("optimizer", {})
        if isinstance(section, dict):
            section["method"] = method
        text = yaml.safe_dump(data, sort_keys=False)
    try:
        section_tree = schema.PlanSection.model_validate(data)
    except ValidationError as error:
        raise PlanError(describe(error, schema.PlanSection, source)) from None
    _check_available(section_tree, source)
    return _Reader(section_tree, source, text).plan()


def _check_available(tree: schema.PlanSection, source: str) -> None:
    for path, value, advice in schema.NOT_YET:
        found: Any = tree
        for key in path.split("."):
            found = getattr(found, key)
        if found == value:
            shown = str(value).lower()
            raise PlanError(f"{source}: {path}: {shown} does not work yet; {advice}")
    if tree.fence is not None:
        raise PlanError(f"{source}: fence: does not work yet; leave it out")


def _count(number: float) -> str:
    return f"{number:,.0f}" if number < 1e9 else f"{number:.3g}"


def _watts(dbm: float) -> float:
    return float(10 ** ((dbm - 30) / 10))


class _Reader:
    """One file on its way to a `Plan`."""

    def __init__(self, tree: schema.PlanSection, source: str, text: str) -> None:
        self.tree, self.source, self.text = tree, source, text

    def fail(self, key: str, problem: str) -> PlanError:
        return PlanError(f"{self.source}: {key}: {problem}")

    def plan(self) -> model.Plan:
        tree = self.tree
        origin = self.origin()
        vehicle = model.Vehicle(
            max_speed=tree.vehicle.max_speed,
            max_acceleration=tree.vehicle.max_acceleration,
            min_speed=tree.vehicle.min_speed,
            autopilot=tree.vehicle.autopilot,
            type=tree.vehicle.type,
            parameters=dict(tree.vehicle.parameters),
        )
        flight = self.flight()
        self.check_plane(vehicle)
        self.check_speeds(flight, vehicle)
        self.check_steps(flight)
        self.check_reach(flight, vehicle)
        return model.Plan(
            origin=origin,
            vehicle=vehicle,
            flight=flight,
            radio=self.radio(),
            optimizer=model.Optimizer(
                **dict(tree.optimizer) | {"starts": tuple(tree.optimizer.starts)}
            ),
            mission=model.MissionOptions(**dict(tree.mission)),
            study=self.study(),
            name=tree.name,
            text=self.text,
            source=self.source,
        )

    def origin(self) -> model.Origin:
        section = self.tree.site.origin
        try:
            schema.check_degrees(section.latitude, section.longitude)
        except ValueError as error:
            raise self.fail("site.origin", str(error)) from None
        return model.Origin(section.latitude, section.longitude, section.elevation)

    def position(self, key: str, value: model.Vector | schema.Degrees) -> model.Vector:
        if not isinstance(value, schema.Degrees):
            return value
        origin = self.tree.site.origin
        frame = LocalFrame(origin.latitude, origin.longitude)
        east, north = map(float, frame.to_local(value.latitude, value.longitude))
        distance = math.hypot(east, north)
        if distance <= schema.MAX_LOCAL_DISTANCE:
            return east, north
        raise self.fail(
            key,
            f"latitude {value.latitude}, longitude {value.longitude} lies {distance / 1000:,.0f} "
            f"km from site.origin ({origin.latitude}, {origin.longitude}), at most "
            f"{schema.MAX_LOCAL_DISTANCE / 1000:.0f} km is accepted{self.hint(value)}",
        )

    def hint(self, value: schema.Degrees) -> str:
        """Say what slip of the pen would explain a position far from the origin."""
        origin = self.tree.site.origin
        lat, lon = value.latitude, value.longitude
        near = schema.MAX_LOCAL_DISTANCE

        def close(a: tuple[float, float], b: tuple[float, float]) -> bool:
            if max(abs(a[0]), abs(b[0])) > 90:
                return False
            return math.hypot(*LocalFrame(*a).to_local(*b)) <= near

        here = (origin.latitude, origin.longitude)
        if close(here, (lon, lat)) or close((here[1], here[0]), (lat, lon)):
            return "; latitude and longitude look swapped in one of the two"
        if any(close(here, pair) for pair in ((-lat, lon), (lat, -lon), (-lat, -lon))):
            return "; a sign differs: south and west are negative"
        return ""

    def flight(self) -> model.Flight:
        section = self.tree.flight
        return model.Flight(
            start=self.position("flight.start", section.start),
            end=self.position("flight.end", section.end),
            altitude=section.altitude,
            duration=section.duration,
            time_step=section.time_step,
            start_velocity=_velocity(section.start_velocity),
            end_velocity=_velocity(section.end_velocity),
            bound_first_acceleration=section.bound_first_acceleration,
        )

    def radio(self) -> model.Radio:
        section = self.tree.radio
        station, relay, user = section.base_station, section.relay, section.ground_user
        return model.Radio(
            base_station=model.BaseStation(
                position=self.position("radio.base_station.position", station.position),
                antennas=station.antennas,
                power=_watts(station.power_dbm),
            ),
            relay=model.Relay(
                antennas=relay.antennas,
                power=_watts(relay.power_dbm),
                noise=_watts(relay.noise_dbm),
            ),
            ground_user=model.GroundUser(
                position=self.position("radio.ground_user.position", user.position),
                antennas=user.antennas,
                noise=_watts(user.noise_dbm),
            ),
            modulation=section.modulation,
            reference_gain=float(10 ** (section.reference_gain_db / 10)),
            rician_factor=section.rician_factor,
            line_of_sight=section.line_of_sight,
            fading=section.fading,
            fading_samples=section.fading_samples,
            csi=section.csi,
            seed=section.seed,
            causal=section.causal,
        )

    def study(self) -> model.Study | None:
        section = self.tree.study
        if section is None:
            return None
        for key in section.vary:
            if problem := unknown_key(key):
                raise self.fail(f"study.vary.{key}", problem)
        if both := varied_twice(section.vary):
            raise self.fail("study.vary", f"{both} vary the same value; leave one out")
        return model.Study(
            vary={key: tuple(values) for key, values in section.vary.items()},
            schemes=tuple(section.schemes),
            seeds=section.seeds,
            figure=section.figure,
        )

    def check_plane(self, vehicle: model.Vehicle) -> None:
        known = VEHICLES[vehicle.autopilot, vehicle.type]
        if known.hovers:
            return
        if not known.planned:
            others = [v.autopilot for v in VEHICLES.values() if v.type == known.type and v.planned]
            raise self.fail(
                "vehicle.type",
                f"{known.type}: missions for {known.type}s are made for {' and '.join(others)}, "
                f"not for {known.autopilot} (vehicle.autopilot)",
            )
        if vehicle.min_speed == 0:
            raise self.fail(
                "vehicle.min_speed", "0 m/s: a plane cannot hover; give its slowest speed, m/s"
            )
        if self.tree.mission.on_finish == "land":
            raise self.fail(
                "mission.on_finish",
                "land: a plane needs an approach, which is not planned; give rtl or hover "
                "(it circles)",
            )

    def check_speeds(self, flight: model.Flight, vehicle: model.Vehicle) -> None:
        if vehicle.min_speed > vehicle.max_speed:
            raise self.fail(
                "vehicle.min_speed",
                f"{vehicle.min_speed:g} m/s is above vehicle.max_speed ({vehicle.max_speed:g} m/s)",
            )
        velocities: Mapping[str, model.Vector | None] = {
            "flight.start_velocity": flight.start_velocity,
            "flight.end_velocity": flight.end_velocity,
        }
        for key, velocity in velocities.items():
            if velocity is not None and math.hypot(*velocity) > vehicle.max_speed:
                raise self.fail(
                    key,
                    f"{quote(list(velocity))} is {math.hypot(*velocity):.6g} m/s; "
                    f"vehicle.max_speed allows {vehicle.max_speed:g} m/s",
                )
            if velocity is not None and math.hypot(*velocity) < vehicle.min_speed:
                given = quote(list(velocity)) if any(velocity) else "hover"
                raise self.fail(
                    key,
                    f"{given} is {math.hypot(*velocity):.6g} m/s; vehicle.min_speed asks for at "
                    f"least {vehicle.min_speed:g} m/s: give free or a velocity",
                )

    def check_steps(self, flight: model.Flight) -> None:
        ratio = flight.duration / flight.time_step
        step = f"{flight.time_step:g} s"
        if ratio > schema.MAX_SLOTS + 0.5:
            raise self.fail(
                "flight.duration",
                f"{flight.duration:g} s is {_count(ratio)} steps of {step} (flight.time_step); at "
                f"most {schema.MAX_SLOTS:,} are accepted",
            )
        if abs(ratio - round(ratio)) > 1e-6 * max(1.0, ratio):
            low = math.floor(ratio) * flight.time_step
            high = math.ceil(ratio) * flight.time_step
            raise self.fail(
                "flight.duration",
                f"{flight.duration:g} s is not a whole number of steps of {step} "
                f"(flight.time_step); {low:.10g} or {high:.10g} would be",
            )
        if flight.slots < 3:
            raise self.fail(
                "flight.duration",
                f"{flight.duration:g} s is {flight.slots} step(s) of {step} (flight.time_step); "
                "give at least 3 steps",
            )

    def check_reach(self, flight: model.Flight, vehicle: model.Vehicle) -> None:
        distance = math.dist(flight.start, flight.end)
        # a metre's millionth of slack: a plan at the very limit is not refused for rounding
        if reach(flight.slots - 1, flight, vehicle) >= distance - 1e-6:
            return
        needed = shortest_duration(flight, vehicle, schema.MAX_SLOTS)
        takes = f"at least {needed:.10g} s" if needed else "longer than can be planned"
        raise self.fail(
            "flight.duration",
            f"{flight.duration:g} s is too short: from start to end is {distance:.6g} m, which "
            f"takes {takes} at {vehicle.max_speed:g} m/s and {vehicle.max_acceleration:g} m/s^2 "
            "with the given end velocities",
        )


def _velocity(value: model.Vector | str) -> model.Vector | None:
    if isinstance(value, str):
        return (0.0, 0.0) if value == "hover" else None
    return value
