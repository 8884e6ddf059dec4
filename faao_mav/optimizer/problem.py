"""Everything that (13) needs, as arrays."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TypedDict, Unpack

import numpy as np

from faao_mav.arrays import Complex, Real
from faao_mav.errors import InputError, PlanError, quote
from faao_mav.mission.fence_area import FreeArea
from faao_mav.optimizer.design import Link, OwnPrecoder
from faao_mav.optimizer.fence_geometry import FenceGeometry, fence_geometry
from faao_mav.optimizer.interior.constraint import Constraint
from faao_mav.optimizer.interior.limits import EnergyLimit, fence_constraints
from faao_mav.optimizer.interior.maximize import LocalOptimum, constraints_of, maximize, objective
from faao_mav.optimizer.interior.rewards import Stage
from faao_mav.optimizer.kinematics import Kinematics, Trajectory, kinematics
from faao_mav.plan import Plan
from faao_mav.plan.station import Station
from faao_mav.radio.channel import balanced_rayleigh, rayleigh
from faao_mav.radio.constellation import constellation, difference_vector_count
from faao_mav.radio.gain import GainField, GainFunction
from faao_mav.radio.rate_steps import StreamRate
from faao_mav.radio.relay import RelayQueue

MAX_INPUTS = 4096
"""The most vectors of symbols that a station may send: 64-QAM on two antennas, QPSK on six.

Chosen: their differences, of which there are up to the square, fill gigabytes beyond."""

MAX_CHANNELS = 10**8
"""The most numbers in the channels of all slots and draws. Chosen: some 6 GB."""

MAX_TERMS = 8 * 10**11
"""The most terms of all sums over differences of vectors of symbols, with their derivatives.

Chosen: some ten minutes with QPSK on six antennas, 32 draws and 240 slots."""

_TABLE, _SEARCH = 1000, 2500
"""Sums for each draw in the table of a link's rate, and for each slot whose draw is known: about as
many as there are."""

_PROBES, _ROUNDED = 99, 1 + 1e-9
"""Distances at which gains and rates of one's own are looked at, and by what rounding may raise
these. Chosen."""


@dataclass(frozen=True)
class Problem:
    """Problem (13) of `plan`: the feasible flights, the two links and the relay's queue.

    `energy` is what flight and relay may take, J. A `precoder` of one's own takes the place of the
    plan's.

    >>> from faao_mav import read_plan
    >>> problem = build_problem(read_plan("missions/copter_relay.yaml"))
    >>> problem.bs_uav.most, problem.plan.flight.slots
    (4.0, 240)
    """

    plan: Plan
    kinematics: Kinematics
    bs_uav: Link
    uav_user: Link
    energy: float = math.inf
    precoder: OwnPrecoder | None = None

    def __repr__(self) -> str:
        """Say whose problem it is, in a line."""
        return f"<Problem of {self.plan!r}>"

    @cached_property
    def free_area(self) -> FreeArea | None:
        """Where fence, ground, maps and margin let the path be, local metres; None: anywhere."""
        area = self.plan.keep_in
        return None if area is None else area.inside(self.plan.margin)

    @cached_property
    def fence(self) -> FenceGeometry | None:
        """What the path keeps its distance from; None where it may be anywhere."""
        return fence_geometry(self.plan)

    def value(self, rates: Real, shares: Real | None = None) -> float:
        """Return what is maximised of the rates (2, n) of both hops: R_del, or R_avg, bit/s/Hz.

        In half duplex with these `shares` (n,), or the best ones.
        """
        return objective(rates, self.kinematics, self.maximised_queue, shares)

    def constraints(self, kin: Kinematics) -> tuple[Constraint, ...]:
        """Return what flights of `kin` have to keep beside the limits of the aircraft."""
        return (*self.fenced(kin), *self.energy_limits(kin))

    def limits(self, kin: Kinematics) -> tuple[Constraint, ...]:
        """Return all that flights of `kin` have to keep."""
        return (*constraints_of(kin), *self.constraints(kin))

    def fenced(
        self, kin: Kinematics, near: tuple[Real, float] | None = None
    ) -> tuple[Constraint, ...]:
        """Return what flights of `kin` have to keep of the fence.

        With `near` that is what matters to flights within so many m of a path (n, 2).
        """
        if self.fence is None:
            return ()
        return fence_constraints(self.fence if near is None else self.fence.near(*near), kin)

    def energy_of(self, flight: Trajectory) -> float | None:
        """Return what `flight` and relay take, J; None without a model."""
        model, kin = self.plan.power_model, self.kinematics
        if model is None:
            return None
        level = ((0, 0), (0, 1))
        power = model(np.pad(flight.v - kin.wind, level), np.pad(flight.a, level))
        return kin.time_step * float(power.sum()) + self._radiated(kin)

    def energy_limits(self, kin: Kinematics) -> tuple[EnergyLimit, ...]:
        """Return the limit on the energy of flights of `kin`, if there is one."""
        model = self.plan.power_model
        if model is None or self.energy == math.inf:
            return ()
        return (EnergyLimit(model, self.energy - self._radiated(kin), kin),)

    def _radiated(self, kin: Kinematics) -> float:
        """Return what the relay's radio sends, J."""
        return self.plan.radio.relay.power * kin.slots * kin.time_step

    def improved(
        self,
        stage: Stage,
        start: Trajectory,
        tolerance: float,
        steps: int,
        *,
        kin: Kinematics | None = None,
        warm: bool = False,
    ) -> LocalOptimum:
        """Return the local optimum near `start`, a flight of `kin`, by `stage`: see `maximize`."""
        kin = kin or self.kinematics
        return maximize(
            kin,
            stage,
            start,
            constraints=self.constraints(kin),
            tolerance=tolerance,
            max_iterations=steps,
            warm=warm,
            relay=self.maximised_queue,
        )

    @property
    def maximised_queue(self) -> RelayQueue | None:
        """The queue whose delivered rate is maximised; None with `radio.causal: false`."""
        return self.relay if self.plan.radio.causal else None

    @property
    def relay(self) -> RelayQueue:
        """How the relay forwards; its buffer is unlimited where the plan has no bandwidth."""
        radio = self.plan.radio
        room, bandwidth = radio.relay.buffer_mbytes, radio.bandwidth_mhz
        buffer = math.inf if room is None or bandwidth is None else 8 * room / bandwidth
        return RelayQueue(half=radio.duplex == "half", buffer=buffer)

    def farthest(self, link: Link) -> float:
        """Return how far from the station of `link` a flight can come at most, on the ground, m."""
        kin = self.kinematics
        away = np.hypot(*(np.stack([kin.start, kin.end])[:, None] - link.gains.station).T)
        return float(away.max()) + kin.max_speed * kin.time_step * (kin.slots - 1) / 2

    @property
    def mapped(self) -> bool:
        """Whether the gain of a link has a map."""
        return any(link.gains.above is not None for link in self.links)

    @property
    def links(self) -> tuple[Link, Link]:
        """BS to UAV, UAV to user."""
        return self.bs_uav, self.uav_user

    def rates(self, w: Real, precoders: Sequence[Complex]) -> Real:
        """Return the rates (2, n), bits, at w (n, 2) with the precoders of both hops."""
        hops = zip(self.links, precoders, strict=True)
        return np.stack([link.mean_rates(link.channel(w), P) for link, P in hops])

    def begun(self, late: float) -> "Problem":
        """Return the problem of a flight that begins `late`, s, to stations that move."""
        first, second = (
            replace(link, gains=replace(link.gains, station=_places(self.plan, station, late)))
            for link, station in zip(self.links, self.plan.radio.stations, strict=True)
        )
        return replace(self, bs_uav=first, uav_user=second)


def _places(plan: Plan, station: Station, late: float = 0.0) -> Real:
    """Return where `station` is in slots that are `late`, s: (2,), or (N + 2, 2) where it moves."""
    t = late + plan.flight.time_step * np.arange(float(plan.flight.slots))
    return station.at(t) if station.moves else np.array(station.position)


def counted_as_cutoff(problem: Problem) -> Problem:
    """Return `problem` with the cutoff rate as the rate that counts."""
    first, second = (replace(link, measure="cutoff") for link in problem.links)
    plan = problem.plan.changed({"optimizer.rate": "cutoff"})
    return replace(problem, plan=plan, bs_uav=first, uav_user=second)


class OwnParts(TypedDict, total=False):
    """Parts of the radio that are one's own, in place of the plan's.

    `gain` is the law of both hops, `rate` that of one stream over its SNR, `precoder` a function
    as `OwnPrecoder` says. A saved result does not have them.

    >>> from faao_mav import StreamRate, optimize, read_plan
    >>> class Capacity(StreamRate):
    ...     most = 20.0
    ...     def value(self, snr):
    ...         return np.log2(1 + snr)
    >>> solution = optimize(read_plan("missions/copter_relay.yaml"), rate=Capacity())
    >>> solution.converged
    True
    """

    gain: GainFunction
    rate: StreamRate
    precoder: OwnPrecoder


def build_problem(plan: Plan, **parts: Unpack[OwnParts]) -> Problem:
    """Turn `plan` into arrays; the fading is drawn from its seed. `parts` are one's own.

    Raises `PlanError` for a plan beyond `MAX_INPUTS`, `MAX_CHANNELS` or `MAX_TERMS`.

    >>> from faao_mav import read_plan
    >>> build_problem(read_plan("missions/copter_relay.yaml"))
    <Problem of <Plan 'copter relay near Canberra': 120 s in slots of 0.5 s, ardupilot copter>>
    """
    _check_size(plan)
    radio, altitude = plan.radio, plan.flight.altitude
    base, relay, user = radio.base_station, radio.relay, radio.ground_user
    rng = np.random.default_rng(radio.seed)
    links = []
    for hop, (station, receive, transmit, power, noise) in enumerate(
        (
            (base, relay.antennas, base.antennas, base.power, relay.noise),
            (user, user.antennas, relay.antennas, relay.power, user.noise),
        )
    ):
        nlos: Complex | None = None
        if radio.fading == "realization":
            nlos = rayleigh(rng, plan.flight.slots, receive, transmit)
        elif radio.fading == "ergodic":
            nlos = balanced_rayleigh(rng, radio.fading_samples, receive, transmit)[:, None]
        over = None if "gain" in parts else radio.gain_laws[hop].map
        gains = GainField(
            parts.get("gain", radio.path_gains[hop]),
            _places(plan, station),
            altitude,
            None if over is None else over.at(altitude),
        )
        links.append(
            Link(
                gains=gains,
                to_relay=hop == 0,
                power=power,
                noise=noise,
                receive=receive,
                transmit=transmit,
                modulation=radio.modulation,
                rician_factor=radio.rician_factor,
                line_of_sight=radio.line_of_sight,
                nlos=nlos,
                measure=plan.optimizer.rate,
                steps=parts.get("rate", radio.rate_steps),
            )
        )
    bs_uav, uav_user = links
    problem = Problem(plan, kinematics(plan), bs_uav, uav_user, precoder=parts.get("precoder"))
    _check_parts(problem, parts)
    return problem


def _check_parts(problem: Problem, parts: OwnParts) -> None:
    """Raise `InputError` for unknown parts, and for impossible gains and rates within reach."""
    if unknown := ", ".join(sorted(parts.keys() - OwnParts.__annotations__.keys())):
        raise InputError(f"{unknown}: no such part; give gain, rate or precoder")
    for link in problem.links:
        H, law, rate = link.gains.height, link.gains.law, parts.get("rate")
        squared = np.linspace(0.0, problem.farthest(link), _PROBES) ** 2 + H**2
        gain, told = law.log(squared, H), list[tuple[str, Real, float, float]]()
        if "gain" in parts:
            told.append(("gain: log", gain, -math.inf, 0.0))
        if rate is not None:
            snr = link.power * link.receive * link.transmit / link.noise * np.exp(gain)
            told.append(("rate: value", rate.value(snr), 0.0, rate.most))
        for name, found, least, most in told:
            real = np.shape(found) == squared.shape and np.isrealobj(found)
            sound = real and np.isfinite(found) & (found >= least) & (found <= most * _ROUNDED)
            if not np.all(sound):
                expected = f"expected numbers from {least:g} to {most:g}, one for each distance"
                raise InputError(f"{name}: {expected} within reach; it gives {quote(found)}")


def _check_size(plan: Plan) -> None:
    """Raise `PlanError` where `plan` is beyond a cap; the error names its keys and the cap."""
    radio, slots = plan.radio, plan.flight.slots
    base, relay, user = (
        each.antennas for each in (radio.base_station, radio.relay, radio.ground_user)
    )
    draws = radio.fading_samples if radio.fading == "ergodic" else 1
    sums = _SEARCH * slots if radio.fading == "realization" else draws * (_TABLE + slots)
    most = max(base, relay)
    inputs, differences = 1, 1
    if radio.rates is None:
        inputs = len(constellation(radio.modulation)) ** most
        differences = difference_vector_count(radio.modulation, most)
    for what, number, cap in (
        ("vectors of symbols", inputs, MAX_INPUTS),
        ("numbers in its channels", slots * draws * relay * (base + user), MAX_CHANNELS),
        ("terms in its sums", sums * differences * most**2, MAX_TERMS),
    ):
        if number > cap:
            many = f", {draws:,} draws (radio.fading_samples)" if draws > 1 else ""
            raise PlanError(
                f"{plan.source}: radio.modulation: {radio.modulation} with {base}, {relay} and "
                f"{user} antennas (radio.*.antennas) in {slots:,} slots{many} has {number:.4g} "
                f"{what}, at most {cap:,} are accepted; ask for fewer antennas or draws, a "
                "smaller alphabet or a longer flight.time_step"
            )
