"""Everything that (13) needs, as arrays."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TypeAlias, TypedDict, Unpack

import numpy as np

from faao_mav.arrays import Complex, Real, RealOrComplex
from faao_mav.mission.fence_area import FreeArea
from faao_mav.optimizer.fence_geometry import FenceGeometry, fence_geometry
from faao_mav.optimizer.interior.constraint import Constraint
from faao_mav.optimizer.interior.fence import fence_constraints
from faao_mav.optimizer.interior.limits import EnergyLimit
from faao_mav.optimizer.kinematics import Kinematics, Trajectory, kinematics
from faao_mav.optimizer.size import check_size
from faao_mav.plan import Plan
from faao_mav.plan.station import Station
from faao_mav.radio.best_precoder import best_precoders, has_closed_form
from faao_mav.radio.channel import (
    balanced_rayleigh,
    line_of_sight_ula,
    rayleigh,
    rician,
)
from faao_mav.radio.constellation import DifferenceClasses, difference_classes
from faao_mav.radio.gain import GainField, GainFunction
from faao_mav.radio.rate import Measure, draw_rates
from faao_mav.radio.rate_steps import StreamRate, one_stream
from faao_mav.radio.relay import RelayQueue

OwnPrecoder: TypeAlias = Callable[[RealOrComplex, float, float], Complex]
"""A precoder of one's own: from channels (..., N_r, N_t), the power W and the noise sigma², W, it
makes the P (..., N_t, N_t), tr(P P^H) = W, of each."""


@dataclass(frozen=True)
class Link:
    """One hop: (1) or (2) with its share of (13).

    `gains` is the path gain over the map, `power` W_B or W_U (W), `noise` sigma² (W); `receive` and
    `transmit` are the antenna counts. `nlos` is the Rayleigh part: a known draw per
    slot (N + 2, N_r, N_t), draws to be averaged over (S, 1, N_r, N_t), or None for the line of
    sight alone. `measure` is the rate that counts, `optimizer.rate`. With `steps` the rates are
    these, of one stream, whatever the alphabet.
    """

    gains: GainField
    to_relay: bool
    power: float
    noise: float
    receive: int
    transmit: int
    modulation: str
    rician_factor: float
    line_of_sight: str
    nlos: Complex | None
    measure: Measure = "cutoff"
    steps: StreamRate | None = None

    @cached_property
    def classes(self) -> DifferenceClasses:
        """The differences u_mk of this link's input vectors, merged up to a unit phase."""
        return difference_classes(self.modulation, self.transmit)

    @property
    def most(self) -> float:
        """The highest rate, bits: N log2(rho), or the highest step."""
        return float(self.classes.bits) if self.steps is None else self.steps.most

    @property
    def closed_form(self) -> bool:
        """Whether the precoder of highest rate for one channel has a closed form."""
        return self.steps is not None or has_closed_form(self.modulation, self.transmit)

    @property
    def follows_position(self) -> bool:
        """Whether H_r changes with w."""
        return self.line_of_sight == "ula"

    @property
    def averaged(self) -> bool:
        """Whether the fading is averaged over: channels then have a leading axis of draws."""
        return self.nlos is not None and self.nlos.ndim == 4

    @property
    def los_share(self) -> float:
        """The factor of H^LoS in H_r."""
        return (
            1.0 if self.nlos is None else math.sqrt(self.rician_factor / (1 + self.rician_factor))
        )

    def small_scale(self, w: Real) -> Complex:
        """Return H_r, the bracket of (1) or (2), at the positions w (N + 2, 2).

        (N + 2, N_r, N_t); with fading that is averaged over, a leading axis of draws.
        """
        away = self.gains.away(w.T)
        d = np.sqrt(self.gains.squared_distance(away))
        return self.fade(self.line_of_sight_at(away[0] / d))

    def line_of_sight_at(self, cosine: Real) -> Complex:
        """Return H^LoS (..., N_r, N_t) at direction cosines u = (x - x_j) / d (...)."""
        if not self.follows_position:
            ones = np.ones((self.receive, self.transmit), dtype=np.complex128)
            return np.broadcast_to(ones, (*cosine.shape, *ones.shape))
        across = np.sqrt(np.maximum(0.0, 1 - cosine**2))
        outward = np.stack([cosine, across, np.zeros_like(cosine)], axis=-1)
        wave = outward if self.to_relay else -outward
        return line_of_sight_ula(wave, self.receive, self.transmit)

    def fade(self, los: Complex) -> Complex:
        """Return H_r for line-of-sight parts `los` (N + 2, N_r, N_t).

        Draws that are averaged over turn with the line of sight. Their distribution does not
        change by that, and their mean rate depends on the distance alone.
        """
        if self.nlos is None:
            return los
        if self.averaged:
            return los * rician(np.ones_like(self.nlos), self.nlos, self.rician_factor)
        return rician(los, self.nlos, self.rician_factor)

    def channel(self, w: Real, H_r: Complex | None = None) -> Complex:
        """Return H = sqrt(gain) H_r, (1) or (2), at the positions w (N + 2, 2).

        H_r is that of `small_scale` where it is not given.
        """
        H_r = self.small_scale(w) if H_r is None else H_r
        return np.sqrt(self.gains.gain(w.T))[:, None, None] * H_r

    def mean_rates(self, H: Complex, P: Complex) -> Real:
        """Return the rates of `draw_rates`, bits (...), their mean where H has draws."""
        rates = self.draw_rates(H, P)
        return np.asarray(rates.mean(axis=0)) if self.averaged else rates

    def draw_rates(self, H: Complex, P: Complex) -> Real:
        """Return the rates of the channels H ((S,) ..., N_r, N_t), bits ((S,) ...).

        P is (..., N_t, N_t), or has the axis of the draws too. Of the mutual information the mean
        over the draws is accurate: see `radio.rate`.
        """
        if self.steps is not None:
            return self.steps.value(self.snr(H, P))
        if not self.averaged:
            H, P = H[..., None, :, :], P[..., None, :, :]
            return draw_rates(self.measure, H, P, self.modulation, self.noise)[..., 0]
        P = np.moveaxis(P, 0, -3) if P.ndim == H.ndim else P[..., None, :, :]
        H = np.moveaxis(H, 0, -3)
        rates = draw_rates(self.measure, H, P, self.modulation, self.noise)
        return np.ascontiguousarray(np.moveaxis(rates, -1, 0))

    def snr(self, H: Complex, P: Complex) -> Real:
        """Return ||H P||² / sigma², the SNR of one stream, linear, for H and P of `draw_rates`."""
        A = H @ P
        return np.asarray(np.sum(A.real**2 + A.imag**2, axis=(-2, -1)) / self.noise)

    def best(self, draws: Complex, start: Complex | None = None) -> Complex:
        """Return the precoder (..., N_t, N_t) of highest mean rate over draws (..., S, N_r, N_t).

        The search begins at `start` (..., N_t, N_t) where given.
        """
        if self.steps is not None:
            return one_stream(draws, self.power)
        return best_precoders(
            draws, self.power, self.modulation, self.noise, measure=self.measure, start=start
        )


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

    def constraints(self, kin: Kinematics) -> tuple[Constraint, ...]:
        """Return what flights of `kin` have to keep beside the limits of the aircraft."""
        energy = self.energy_limit(kin)
        return (*self.fenced(kin), *([] if energy is None else [energy]))

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
        """Return what `flight` and relay take, J, as sums over the slots; None without a model."""
        model, kin = self.plan.power_model, self.kinematics
        if model is None:
            return None
        level = ((0, 0), (0, 1))
        power = model(np.pad(flight.v - kin.wind, level), np.pad(flight.a, level))
        return kin.time_step * float(power.sum()) + self._radiated(kin)

    def energy_limit(self, kin: Kinematics) -> EnergyLimit | None:
        """Return the limit on the energy of flights of `kin`; None where there is none."""
        if self.energy == math.inf:
            return None
        model = self.plan.power_model
        assert model is not None  # plans that limit the energy have one
        return EnergyLimit(model, self.energy - self._radiated(kin), kin)

    def _radiated(self, kin: Kinematics) -> float:
        """Return what the relay's radio sends, J."""
        return self.plan.radio.relay.power * kin.slots * kin.time_step

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

    Raises `PlanError` when the plan is larger than ``size.check_size`` accepts.

    >>> from faao_mav import read_plan
    >>> build_problem(read_plan("missions/copter_relay.yaml"))
    <Problem of <Plan 'copter relay near Canberra': 120 s in slots of 0.5 s, ardupilot copter>>
    """
    check_size(plan)
    radio, own = plan.radio, "gain" in parts
    base, relay, user = radio.base_station, radio.relay, radio.ground_user
    rng = np.random.default_rng(radio.seed)
    links = []
    hops = (
        (base, relay.antennas, base.antennas, base.power, relay.noise),
        (user, user.antennas, relay.antennas, relay.power, user.noise),
    )
    for hop, (station, receive, transmit, power, noise) in enumerate(hops):
        match radio.fading:
            case "realization":
                nlos: Complex | None = rayleigh(rng, plan.flight.slots, receive, transmit)
            case "ergodic":
                nlos = balanced_rayleigh(rng, radio.fading_samples, receive, transmit)[:, None]
            case "none":
                nlos = None
        over = None if own else radio.gain_laws[hop].map
        gains = GainField(
            parts["gain"] if own else radio.path_gains[hop],
            _places(plan, station),
            plan.flight.altitude,
            None if over is None else over.at(plan.flight.altitude),
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
    return Problem(plan, kinematics(plan), bs_uav, uav_user, precoder=parts.get("precoder"))
