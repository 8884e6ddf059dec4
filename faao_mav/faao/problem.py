"""Everything that (13) needs, as arrays."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from faao_mav.arrays import Complex, Real
from faao_mav.errors import PlanError
from faao_mav.faao.kinematics import Kinematics, kinematics
from faao_mav.plan import Plan, Vector
from faao_mav.radio.channel import (
    displacement,
    line_of_sight_all_ones,
    line_of_sight_ula,
    path_gain,
    rayleigh,
    rician,
)
from faao_mav.radio.constellation import (
    DifferenceClasses,
    difference_classes,
    difference_vector_count,
)
from faao_mav.radio.rate import cutoff_rate

MAX_DIFFERENCE_VECTORS = 5_000_000


@dataclass(frozen=True)
class Link:
    """One hop: (1) or (2) with its share of (13).

    `station` is p_B or p_U (2,), `altitude` H, `power` W_B or W_U (W), `noise` sigma² (W);
    `receive` and `transmit` are the antenna counts, and `nlos` (N + 2, N_r, N_t) the Rayleigh
    draw, or None for the line of sight alone.
    """

    name: str
    station: Real
    altitude: float
    to_relay: bool
    power: float
    noise: float
    receive: int
    transmit: int
    modulation: str
    reference_gain: float
    rician_factor: float
    line_of_sight: str
    nlos: Complex | None

    @cached_property
    def classes(self) -> DifferenceClasses:
        """The differences u_mk of this link's input vectors, merged up to a unit phase."""
        return difference_classes(self.modulation, self.transmit)

    @property
    def follows_position(self) -> bool:
        """Whether H_r changes with w."""
        return self.line_of_sight == "ula"

    def gain(self, w: Real) -> Real:
        """Return rho_0 d^-2 (N + 2,) at the positions w (N + 2, 2)."""
        return path_gain(w, self.station, self.altitude, self.reference_gain)

    def small_scale(self, w: Real) -> Complex:
        """Return H_r (N + 2, N_r, N_t), the bracket of (1) or (2), at the positions w."""
        if self.follows_position:
            outward = displacement(w, self.station, self.altitude)
            wave = outward if self.to_relay else -outward
            los = line_of_sight_ula(wave, self.receive, self.transmit)
        else:
            ones = line_of_sight_all_ones(self.receive, self.transmit)
            los = np.broadcast_to(ones, (len(w), *ones.shape))
        if self.nlos is None:
            return los
        return rician(los, self.nlos, self.rician_factor)

    def channel(self, w: Real, H_r: Complex) -> Complex:
        """Return H = sqrt(rho_0 d^-2) H_r, (1) or (2)."""
        return np.sqrt(self.gain(w))[:, None, None] * H_r

    def rates(self, w: Real, H_r: Complex, P: Complex) -> Real:
        """Return (7) or (8) for every slot, bits (N + 2,)."""
        return cutoff_rate(self.channel(w, H_r), P, self.classes, self.noise)


@dataclass(frozen=True)
class Problem:
    """Problem (13) of `plan`: the feasible flights and the two links."""

    plan: Plan
    kinematics: Kinematics
    bs_uav: Link
    uav_user: Link

    @property
    def links(self) -> tuple[Link, Link]:
        """BS to UAV, UAV to user."""
        return self.bs_uav, self.uav_user


def build_problem(plan: Plan) -> Problem:
    """Turn `plan` into arrays; the fading is drawn from its seed.

    Raises `PlanError` when alphabet and antennas make more differences than can be handled.
    """
    radio, slots = plan.radio, plan.flight.slots
    base, relay, user = radio.base_station, radio.relay, radio.ground_user
    for key, antennas in (("base_station", base.antennas), ("relay", relay.antennas)):
        _check_size(plan, f"radio.{key}.antennas", antennas)
    rng = np.random.default_rng(radio.seed)

    def link(
        name: str, position: Vector, receive: int, transmit: int, power: float, noise: float
    ) -> Link:
        drawn = radio.fading == "realization"
        return Link(
            name=name,
            station=np.array(position),
            altitude=plan.flight.altitude,
            to_relay=position is base.position,
            power=power,
            noise=noise,
            receive=receive,
            transmit=transmit,
            modulation=radio.modulation,
            reference_gain=radio.reference_gain,
            rician_factor=radio.rician_factor,
            line_of_sight=radio.line_of_sight,
            nlos=rayleigh(rng, slots, receive, transmit) if drawn else None,
        )

    return Problem(
        plan=plan,
        kinematics=kinematics(plan),
        bs_uav=link(
            "base station to UAV",
            base.position,
            relay.antennas,
            base.antennas,
            base.power,
            relay.noise,
        ),
        uav_user=link(
            "UAV to ground user",
            user.position,
            user.antennas,
            relay.antennas,
            relay.power,
            user.noise,
        ),
    )


def _check_size(plan: Plan, key: str, antennas: int) -> None:
    count = difference_vector_count(plan.radio.modulation, antennas)
    if count > MAX_DIFFERENCE_VECTORS:
        raise PlanError(
            f"{plan.source}: {key}: {antennas} antennas with {plan.radio.modulation} make "
            f"{count:,} difference vectors; at most {MAX_DIFFERENCE_VECTORS:,} are accepted: "
            "use fewer antennas or a smaller alphabet"
        )
