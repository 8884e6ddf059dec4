"""What no single key can tell: whether the keys of a plan agree with each other."""

import math
from bisect import bisect_left
from collections.abc import Iterator
from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np

from faao_mav.autopilot import vehicle_type, vehicle_types
from faao_mav.errors import counted, quote
from faao_mav.files import table
from faao_mav.plan.fence import fence_problems
from faao_mav.plan.fields import MAX_LOCAL_DISTANCE, Problem, listed, wrong
from faao_mav.plan.model import PlanContents
from faao_mav.plan.radio import STATIONS, GainLaw
from faao_mav.plan.sections import Flight, Heights
from faao_mav.plan.station import FASTEST
from faao_mav.power import RotaryWing
from faao_mav.radio.gain_map import GainMap
from faao_mav.vector import chord

MAX_SLOTS = 100_000
"""Most time slots; chosen: the direct method solves 10,000 in 0.6 s; more is not measured."""

FEWEST_SLOTS = 3
"""Fewest time slots of a flight: start, end and one between."""

_SLACK = 1e-6
"""Metres that the reach may be short: a plan at the very limit is not refused for rounding."""


def problems(plan: PlanContents) -> Iterator[str]:
    """Yield what is wrong with `plan`, key first; each may rest on those before it being right.

    Which it is a check yields by its row of `problems.tsv`, with the values that are said there.
    """
    says = {row["problem"]: row["says"] for row in table("plan/problems.tsv")}
    checks = _vehicle, _together, _speeds, _gain, _rates, _steps, _stations, _distance
    for check in (*checks, _power, fence_problems):
        for problem, values in check(plan):
            yield says[problem].format(plan=plan, **values)


def _vehicle(plan: PlanContents) -> Iterator[Problem]:
    known = vehicle_types(plan.vehicle.type)
    planned = [each.family.key for each in known if each.flight_model]
    if plan.vehicle.autopilot not in planned:
        yield wrong("type-autopilot", planned=listed(planned, "and"))


def _together(plan: PlanContents) -> Iterator[Problem]:
    """Yield which keys do not go together, and which not without another."""
    radio, goal, vehicle, power = plan.radio, plan.goal, plan.vehicle, plan.vehicle.power
    paper, no_band = plan.optimizer.method == "algorithm1", radio.bandwidth_mhz is None
    rates, reliable, data = radio.rates, radio.reliability is not None, goal.maximise == "data"
    heights, plane = plan.flight.height, not vehicle_type(vehicle.autopilot, vehicle.type).hovers
    searched, amounts = goal.minimise is not None, (goal.deliver_mbytes, goal.rate)
    energy = goal.minimise == "energy" or data
    found = {
        "plane-hovers": plane and vehicle.min_speed == 0,
        "plane-lands": plane and plan.mission.on_finish == "land",
        "goal-megabytes": not searched and goal.deliver_mbytes is not None,
        "goal-rate": not searched and goal.rate is not None,
        "goal-both": searched and goal.maximise is not None,
        "goal-needs": searched and amounts == (None, None),
        "goal-needs-one": searched and None not in amounts,
        "heights": isinstance(heights, Heights) and heights.least >= heights.most,
        "least-speed": vehicle.min_speed > vehicle.max_speed,
        "buffer-bandwidth": radio.relay.buffer_mbytes is not None and no_band,
        "rates-both": rates is not None and rates.mbit_per_s and rates.bit_per_s_per_hz,
        "rates-none": rates is not None and not (rates.mbit_per_s or rates.bit_per_s_per_hz),
        "rates-bandwidth": rates is not None and rates.mbit_per_s and no_band,
        "reliability-spread": reliable and not any(radio.spreads),
        "algorithm1-causal": paper and radio.causal,
        "algorithm1-reliability": paper and reliable,
        "algorithm1-fence": paper and plan.geofence,
        "goal-energy": goal.energy_wh is not None and not data,
        "goal-data": data and goal.energy_wh is None,
        "goal-bandwidth": searched and goal.deliver_mbytes is not None and no_band,
        "goal-causal": goal.searches and not radio.causal,
        "goal-power": energy and power is None,
        "battery-power": vehicle.battery is not None and power is None,
        "power-plane": vehicle.type == "plane" and power is not None and power.hover_w is not None,
        "gusts": plan.max_airspeed <= vehicle.min_speed,
    }
    yield from (wrong(problem) for problem, there in found.items() if there)


def _speeds(plan: PlanContents) -> Iterator[Problem]:
    vehicle, flight = plan.vehicle, plan.flight
    for end, velocity in (("start", flight.start_velocity), ("end", flight.end_velocity)):
        if velocity is None:
            continue
        speed, airspeed = math.hypot(*velocity), math.dist(velocity, plan.wind)
        told: dict[str, Any] = {"end": end, "speed": speed, "airspeed": airspeed}
        told["given"] = quote(list(velocity)) if any(velocity) else "hover"
        told["air"] = " through the air" if any(plan.wind) else ""
        if speed > plan.max_ground_speed:
            yield wrong("end-fast", **told)
        if airspeed > plan.max_airspeed:
            default = "" if vehicle.max_airspeed else ", by default,"
            yield wrong("end-airspeed", default=default, **told)
        if airspeed < vehicle.min_speed:
            yield wrong("end-slow", **told)


def _rates(plan: PlanContents) -> Iterator[Problem]:
    rates = plan.radio.rates
    if rates is None:
        return
    key = "mbit_per_s" if rates.mbit_per_s else "bit_per_s_per_hz"
    values = getattr(rates, key)
    if len(values) != len(rates.snr_db):
        yield wrong("rates-count", key=key, rates=len(values), ratios=len(rates.snr_db))
    if not any(values):
        yield wrong("rates-zero", key=key)
    for (low, more), (high, less) in pairwise(sorted(zip(rates.snr_db, values, strict=False))):
        if less < more:
            yield wrong("rates-fall", key=key, low=low, more=more, high=high, less=less)
    for key, needed in (
        ("method", "direct"), ("precoder", "faao"), ("inputs", "alphabet"), ("rate", "cutoff")
    ):  # fmt: skip
        if (value := getattr(plan.optimizer, key)) != needed:
            yield wrong("rates-optimizer", key=key, value=value)


def _gain(plan: PlanContents) -> Iterator[Problem]:
    radio, asked = plan.radio, plan.flight.height
    heights = asked if isinstance(asked, Heights) else (asked,)
    hops = zip(STATIONS, radio.stations, radio.gain_laws, radio.path_gains, strict=True)
    for name, station, given, law in hops:
        key = "radio.gain" if given is radio.gain else f"radio.{name}.gain"
        if given.map is not None and station.moves:
            yield wrong("map-moves", name=name, key=key)
        if given.map is not None and all(given.map.barred(height).all() for height in heights):
            yield wrong("map-ground", key=key, height=heights[-1])
        if given.whole is not None:
            yield from _whole_map(plan.flight, given, given.whole, key)
            continue
        for height in heights:
            turns = law.turns(2 * MAX_LOCAL_DISTANCE, height)
            gain, at = max(zip(law.db(turns, height), turns, strict=True))
            if gain > 0:
                yield wrong("gain-above-0", key=key, gain=gain, distance=math.hypot(at, height))


def _whole_map(flight: Flight, given: GainLaw, known: GainMap, key: str) -> Iterator[Problem]:
    for name, default in {"reference_gain_db": None, "exponent": 2.0, "elevation_db": ()}.items():
        if (value := getattr(given, name)) != default:
            yield wrong("map-law", key=key, name=name, value=quote(value))
    if (most := float(np.nanmax(known.db))) > 0:
        yield wrong("map-above-0", key=key, most=most)
    for end, place in (("start", flight.start), ("end", flight.end)):
        if not known.covers(place):
            east, north = (f"{side[0]:.6g} to {side[-1]:.6g}" for side in (known.east, known.north))
            told = {"place": quote(list(place)), "east": east, "north": north}
            yield wrong("map-end", end=end, key=key, **told)


def _steps(plan: PlanContents) -> Iterator[Problem]:
    step = plan.flight.time_step
    ratio = plan.flight.duration / step
    if ratio > MAX_SLOTS + 0.5:
        count = f"{ratio:,.0f}" if ratio < 1e9 else f"{ratio:.3g}"
        yield wrong("steps-many", count=count, most=MAX_SLOTS)
    if abs(ratio - round(ratio)) > 1e-6 * max(1.0, ratio):
        yield wrong("steps-whole", low=math.floor(ratio) * step, high=math.ceil(ratio) * step)
    if plan.flight.slots < FEWEST_SLOTS:
        yield wrong("steps-few", steps=counted(plan.flight.slots, "step"), least=FEWEST_SLOTS)


def _stations(plan: PlanContents) -> Iterator[Problem]:
    lasts, farthest = plan.flight.duration, MAX_LOCAL_DISTANCE / 1000
    for name, station in zip(STATIONS, plan.radio.stations, strict=True):
        given, track = quote(list(station.velocity)), station.track
        if math.hypot(*station.velocity) > FASTEST:
            yield wrong("station-fast", name=name, given=given, fastest=FASTEST)
        away = float(np.abs(station.at(np.array([lasts]))).max()) / 1000
        if track is not None and any(station.velocity):
            yield wrong("track-velocity", name=name, given=given)
        if track is not None and track.times[-1] < lasts:
            yield wrong("track-short", name=name, ends=track.times[-1])
        if away > farthest:
            yield wrong("station-far", name=name, given=given, away=away, most=farthest)
        if station.moves and plan.optimizer.method == "algorithm1":
            yield wrong("algorithm1-moves", name=name, key="track" if track else "velocity")


def _distance(plan: PlanContents) -> Iterator[Problem]:
    distance = math.dist(plan.flight.start, plan.flight.end)
    if reach(plan.flight.slots - 1, plan) >= distance - _SLACK:
        return
    needed = fewest_slots(plan) * plan.flight.time_step
    takes = f"at least {needed:.10g} s" if needed else "longer than can be planned"
    most, limited = plan.max_airspeed, ""
    if most < math.inf:
        through = f"at most {most:.4g} m/s through the air (vehicle.max_airspeed)"
        limited = f" in a wind of {plan.site.wind} and {through}"
    yield wrong("too-short", distance=distance, takes=takes, limited=limited)


def _power(plan: PlanContents) -> Iterator[Problem]:
    power = plan.vehicle.power
    if power is None:
        return
    measured = ("hover_w", "cruise_w", "at")[plan.vehicle.type == "plane" :]
    missing = [name for name in measured if getattr(power, name) is None]
    if missing and len(missing) < len(measured):
        yield wrong("power-measured", key=missing[0], measured=listed(measured, "and"))
    model = plan.power_model
    if isinstance(model, RotaryWing) and model.parasite < 0 and power.at:
        least = replace(model, parasite=0.0).level(np.array(power.at))
        yield wrong("power-rotors", least=least)


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
