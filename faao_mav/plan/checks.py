"""What no single key can tell: whether the keys of a plan agree with each other."""

import math
from bisect import bisect_left
from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from faao_mav.autopilot import vehicle_types
from faao_mav.errors import quote
from faao_mav.plan.fence import fence_problems
from faao_mav.plan.fields import MAX_LOCAL_DISTANCE, listed
from faao_mav.plan.keys import unknown_key, varied_twice
from faao_mav.plan.model import PlanContents
from faao_mav.plan.radio import GainLaw
from faao_mav.plan.sections import Flight, Heights
from faao_mav.power import RotaryWing
from faao_mav.radio.gain_map import GainMap
from faao_mav.vector import chord

MAX_SLOTS = 100_000
"""Most time slots; chosen: the direct method solves 10,000 in 0.6 s; more is not measured."""

FEWEST_SLOTS = 3
"""Fewest time slots of a flight: start, end and one between."""

_SLACK = 1e-6
"""Metres that the reach may be short: a plan at the very limit is not refused for rounding."""

_NO_POWER = (
    "what the flight takes is missing; give vehicle.power, as {hover_w: 170, cruise_w: 130, at: 10}"
)


def problems(plan: PlanContents) -> Iterator[str]:
    """Yield what is wrong with `plan`, key first; each may rest on those before it being right."""
    yield from _vehicle(plan)
    yield from _speeds(plan)
    yield from _relay(plan)
    yield from _gain(plan)
    yield from _rates(plan)
    yield from _steps(plan.flight)
    yield from _stations(plan)
    yield from _distance(plan)
    yield from _goal(plan)
    yield from _power(plan)
    yield from fence_problems(plan)
    yield from _study(plan)


def _vehicle(plan: PlanContents) -> Iterator[str]:
    vehicle = plan.vehicle
    planned = {each.family.key: each for each in vehicle_types(vehicle.type) if each.flight_model}
    known = planned.get(vehicle.autopilot)
    if known is None:
        yield (
            f"vehicle.type: {vehicle.type}: missions for {vehicle.type}s are made for "
            f"{listed([*planned], 'and')}, not for {vehicle.autopilot} (vehicle.autopilot)"
        )
    elif known.hovers:
        return
    if vehicle.min_speed == 0:
        yield "vehicle.min_speed: 0 m/s: a plane cannot hover; give its slowest speed, m/s"
    if plan.mission.on_finish == "land":
        yield (
            "mission.on_finish: land: a plane needs an approach, which is not planned; give rtl "
            "or hover (it circles)"
        )


def _speeds(plan: PlanContents) -> Iterator[str]:
    vehicle, flight = plan.vehicle, plan.flight
    least, most = vehicle.min_speed, plan.max_ground_speed
    if least > vehicle.max_speed:
        yield (
            f"vehicle.min_speed: {least:g} m/s is above vehicle.max_speed "
            f"({vehicle.max_speed:g} m/s)"
        )
    if plan.max_airspeed <= least:
        yield (
            f"site.wind: {_wind(plan)}: the gusts leave {plan.max_airspeed:.4g} m/s of airspeed; "
            "give a wind that the aircraft can fly in, or its vehicle.max_airspeed"
        )
    for end, velocity in (("start", flight.start_velocity), ("end", flight.end_velocity)):
        if velocity is None:
            continue
        speed, airspeed = math.hypot(*velocity), math.dist(velocity, plan.wind)
        given = quote(list(velocity)) if any(velocity) else "hover"
        told = f"flight.{end}_velocity: {given} is {speed:.6g} m/s; vehicle."
        if speed > most:
            yield f"{told}max_speed allows {most:g} m/s"
        if any(plan.wind):
            told = f"flight.{end}_velocity: {given} is {airspeed:.6g} m/s through the air; vehicle."
        if airspeed > plan.max_airspeed:
            default = "" if vehicle.max_airspeed else ", by default,"
            limit = f"{plan.max_airspeed:.4g} m/s in a wind of {_wind(plan)}"
            yield f"{told}max_airspeed{default} allows {limit}"
        if airspeed < least:
            yield f"{told}min_speed asks for at least {least:g} m/s: give free or a velocity"


def _wind(plan: PlanContents) -> str:
    wind = plan.site.wind
    gusts = f", gusts of {wind.gust:g} m/s" if wind.gust > wind.speed else ""
    return f"{wind.speed:g} m/s from {wind.from_degrees:g} degrees{gusts}"


def _relay(plan: PlanContents) -> Iterator[str]:
    if plan.radio.relay.buffer_mbytes is not None and plan.radio.bandwidth_mhz is None:
        yield (
            f"radio.relay.buffer_mbytes: {plan.radio.relay.buffer_mbytes:g}: how long it takes to "
            "fill depends on the bandwidth; give radio.bandwidth_mhz too"
        )
    if plan.optimizer.method == "algorithm1" and plan.radio.causal:
        yield (
            "radio.causal: true: algorithm1 (optimizer.method) maximises R_avg, whatever of it is "
            "delivered; give radio.causal: false, or method direct"
        )


def _rates(plan: PlanContents) -> Iterator[str]:
    rates, optimizer = plan.radio.rates, plan.optimizer
    if rates is None:
        return
    given = [name for name in ("mbit_per_s", "bit_per_s_per_hz") if getattr(rates, name)]
    if len(given) != 1:
        told = "both are given" if given else "the rates are missing"
        yield f"radio.rates: {told}; give mbit_per_s or bit_per_s_per_hz"
        return
    values = getattr(rates, given[0])
    if len(values) != len(rates.snr_db):
        yield (
            f"radio.rates.{given[0]}: {len(values)} for {len(rates.snr_db)} of snr_db; give one "
            "for each"
        )
    if not any(values):
        yield f"radio.rates.{given[0]}: none is above 0; give what the radio carries"
    if given == ["mbit_per_s"] and plan.radio.bandwidth_mhz is None:
        yield "radio.rates.mbit_per_s: need the band that they are had in: give radio.bandwidth_mhz"
    for key, needed in (
        ("method", "direct"), ("precoder", "faao"), ("inputs", "alphabet"), ("rate", "cutoff")
    ):  # fmt: skip
        if (value := getattr(optimizer, key)) != needed:
            yield (
                f"optimizer.{key}: {value}: radio.rates has one stream along the best mode, with "
                f"rates of its own; leave {key} out"
            )


def _gain(plan: PlanContents) -> Iterator[str]:
    radio, asked = plan.radio, plan.flight.height
    heights = asked if isinstance(asked, Heights) else (asked,)
    if radio.reliability is not None:
        told = f"radio.reliability: {radio.reliability:g}: "
        if all(law.spread_db is None for law in radio.gain_laws):
            yield f"{told}how far gains are off their law is missing; give radio.gain.spread_db"
        if plan.optimizer.method == "algorithm1":
            yield f"{told}algorithm1 (optimizer.method) knows no shadowing; give method direct"
    stations = {"base_station": radio.base_station, "ground_user": radio.ground_user}
    hops = zip(stations.items(), radio.gain_laws, radio.path_gains, strict=True)
    for (name, station), given, law in hops:
        key = "radio.gain" if given is radio.gain else f"radio.{name}.gain"
        if given.map is not None and station.moves:
            yield f"radio.{name}: moves, and {key}.map is of a station that stands; leave one out"
        if given.map is not None and all(given.map.barred(height).all() for height in heights):
            yield f"{key}.map: no aircraft can be on it at {heights[-1]:g} m (flight.altitude)"
        if given.whole is not None:
            yield from _whole_map(plan.flight, given, given.whole, key)
            continue
        for height in heights:
            at = law.best_distance(2 * MAX_LOCAL_DISTANCE, height)
            gain = float(law.db(np.array(at), height))
            if gain > 0:
                yield (
                    f"{key}: {gain:.4g} dB at {math.hypot(at, height):.4g} m is more than was "
                    "sent; give what the link has, without the power"
                )


def _whole_map(flight: Flight, given: GainLaw, known: GainMap, key: str) -> Iterator[str]:
    for name, default in {"reference_gain_db": None, "exponent": 2.0, "elevation_db": ()}.items():
        if (value := getattr(given, name)) != default:
            yield (
                f"{key}.{name}: {quote(value)}: {key}.map is the gain itself; leave {name} out, or "
                "give a map above the law (above_law_db)"
            )
    if (most := float(np.nanmax(known.db))) > 0:
        yield f"{key}.map: {most:.4g} dB is more than was sent; give the gain without the power"
    for end, place in (("start", flight.start), ("end", flight.end)):
        if not known.covers(place):
            sides = (
                f"{side[0]:.6g} to {side[-1]:.6g} m {name}"
                for side, name in ((known.east, "east"), (known.north, "north"))
            )
            yield f"flight.{end}: {quote(list(place))} is off {key}.map: {', '.join(sides)}"


def _steps(flight: Flight) -> Iterator[str]:
    ratio = flight.duration / flight.time_step
    given = f"flight.duration: {flight.duration:g} s is "
    step = f"of {flight.time_step:g} s (flight.time_step); "
    if ratio > MAX_SLOTS + 0.5:
        count = f"{ratio:,.0f}" if ratio < 1e9 else f"{ratio:.3g}"
        yield f"{given}{count} steps {step}at most {MAX_SLOTS:,} are accepted"
    if abs(ratio - round(ratio)) > 1e-6 * max(1.0, ratio):
        low, high = (whole(ratio) * flight.time_step for whole in (math.floor, math.ceil))
        yield f"{given}not a whole number of steps {step}{low:.10g} or {high:.10g} would be"
    if flight.slots < FEWEST_SLOTS:
        yield f"{given}{flight.slots} step(s) {step}give at least {FEWEST_SLOTS} steps"


def _stations(plan: PlanContents) -> Iterator[str]:
    lasts = plan.flight.duration
    for name, station in zip(("base_station", "ground_user"), plan.radio.stations, strict=True):
        given, key = quote(list(station.velocity)), f"radio.{name}."
        away = float(np.abs(station.at(np.array([lasts]))).max())
        if station.track is not None and any(station.velocity):
            yield f"{key}velocity: {given}: track is given too; leave one out"
        if station.track is not None and station.track.times[-1] < lasts:
            yield (
                f"{key}track: ends {station.track.times[-1]:.10g} s after it begins, and "
                f"flight.duration is {lasts:.10g} s; give a longer track or a shorter flight"
            )
        if away > MAX_LOCAL_DISTANCE:
            yield (
                f"{key}velocity: {given}: takes it to {away / 1000:,.0f} km from the origin in "
                f"{lasts:g} s (flight.duration); at most {MAX_LOCAL_DISTANCE / 1000:.0f} km"
            )
        if station.moves and plan.optimizer.method == "algorithm1":
            what = "velocity" if station.track is None else "track"
            yield f"{key}{what}: algorithm1 (optimizer.method) knows none; give method direct"


def _distance(plan: PlanContents) -> Iterator[str]:
    flight, vehicle = plan.flight, plan.vehicle
    distance = math.dist(flight.start, flight.end)
    if reach(flight.slots - 1, plan) >= distance - _SLACK:
        return
    needed = fewest_slots(plan) * flight.time_step
    takes = f"at least {needed:.10g} s" if needed else "longer than can be planned"
    most, limited = plan.max_airspeed, ""
    if most < math.inf:
        through = f"at most {most:.4g} m/s through the air (vehicle.max_airspeed)"
        limited = f" in a wind of {_wind(plan)} and {through}"
    yield (
        f"flight.duration: {flight.duration:g} s is too short: from start to end is "
        f"{distance:.6g} m, which takes {takes} at {vehicle.max_speed:g} m/s and "
        f"{vehicle.max_acceleration:g} m/s^2 with the given end velocities{limited}"
    )


def _goal(plan: PlanContents) -> Iterator[str]:
    goal = plan.goal
    amounts = [name for name in ("deliver_mbytes", "rate") if getattr(goal, name) is not None]
    if goal.minimise is None and amounts:
        yield f"goal.{amounts[0]}: is for a goal that minimises; give goal.minimise too"
    if goal.maximise != "data" and goal.energy_wh is not None:
        yield f"goal.energy_wh: {goal.energy_wh:g}: is for the most data; give maximise: data too"
    if goal.maximise == "data" and goal.energy_wh is None:
        yield "goal.maximise: data: give goal.energy_wh too, or maximise: rate"
    if goal.minimise is not None and goal.maximise is not None:
        yield f"goal.maximise: {goal.maximise}: goal.minimise is given too; leave one out"
    if goal.minimise is not None and len(amounts) != 1:
        given = "both are given" if amounts else "what has to be delivered is missing"
        yield f"goal.minimise: {goal.minimise}: {given}; give goal.deliver_mbytes or goal.rate"
    if goal.deliver_mbytes is not None and plan.radio.bandwidth_mhz is None:
        yield (
            f"goal.deliver_mbytes: {goal.deliver_mbytes:g}: what a rate carries depends on the "
            "bandwidth; give radio.bandwidth_mhz too, or goal.rate"
        )
    if goal.searches and not plan.radio.causal:
        yield (
            f"goal.{goal.searches}: counts what is delivered, which radio.causal: false "
            "does not plan for; give radio.causal: true"
        )
    if goal.searches in ("minimise: energy", "maximise: data") and plan.vehicle.power is None:
        yield f"goal.{goal.searches}: {_NO_POWER}"


def _power(plan: PlanContents) -> Iterator[str]:
    power, copter = plan.vehicle.power, plan.vehicle.type == "copter"
    if power is None:
        if plan.vehicle.battery is not None:
            yield f"vehicle.battery: {_NO_POWER}"
        return
    measured = ("hover_w", "cruise_w", "at") if copter else ("cruise_w", "at")
    missing = [name for name in measured if getattr(power, name) is None]
    if missing and len(missing) < len(measured):
        yield f"vehicle.power.{missing[0]}: missing; give {listed(measured, 'and')}, or none"
    if not copter and power.hover_w is not None:
        yield f"vehicle.power.hover_w: {power.hover_w:g}: a plane does not hover; leave it out"
    model = plan.power_model
    if isinstance(model, RotaryWing) and model.parasite < 0 and power.at:
        least = replace(model, parasite=0.0).level(np.array(power.at))
        yield (
            f"vehicle.power.cruise_w: {power.cruise_w:g} W at {power.at:g} m/s: rotors that take "
            f"{power.hover_w:g} W in hover take at least {least:.4g} W there"
        )


def _study(plan: PlanContents) -> Iterator[str]:
    varied = plan.study.vary if plan.study else ()
    for key in varied:
        if problem := unknown_key(key):
            yield f"study.vary.{key}: {problem}"
    if both := varied_twice(varied):
        yield f"study.vary: {both} vary the same value; leave one out"


def reach(steps: int, plan: PlanContents) -> float:
    """Return the farthest w(N+1) - w(0) along the line from start to end, m.

    Under (11)-(13f) the component of v(n) along any direction is at most
    min(v_0 + n a dt, v_end + (steps - n) a dt, v_max), and a straight flight attains that bound
    when the end velocities are zero or free. With end velocities across the line, or in wind, the
    result is only an upper bound. `steps` is N + 1; a displacement is the trapezoid sum of v. In
    wind the mean velocity, along the line, keeps the limit on the airspeed too.
    """
    flight = plan.flight
    dt, limit = flight.time_step, plan.max_ground_speed
    gain = plan.vehicle.max_acceleration * dt
    way = np.subtract(flight.end, flight.start)
    direction = way / (math.hypot(*way) or 1.0)
    n = np.arange(steps + 1, dtype=float)
    speed = np.full(steps + 1, limit)
    if flight.start_velocity is not None:
        first = float(np.dot(flight.start_velocity, direction))
        if flight.bound_first_acceleration:
            np.minimum(speed, first + n * gain, out=speed)
        speed[0] = min(first, limit)
    if flight.end_velocity is not None:
        last = float(np.dot(flight.end_velocity, direction))
        np.minimum(speed, last + n[::-1] * gain, out=speed)
    farthest = float(dt * (speed[:-1] + speed[1:]).sum() / 2)
    return min(farthest, dt * steps * chord(plan.wind, plan.max_airspeed, direction)[1])


def fewest_slots(plan: PlanContents) -> int:
    """Return the least number of slots whose `reach` covers the distance; 0 for too many to plan.

    It is at most `plan.flight.slots` for a plan that has been checked.
    """
    sizes = range(FEWEST_SLOTS, 2 * MAX_SLOTS)
    distance = math.dist(plan.flight.start, plan.flight.end)
    at = bisect_left(sizes, True, key=lambda slots: reach(slots - 1, plan) >= distance - _SLACK)
    return sizes[at] if at < len(sizes) else 0
