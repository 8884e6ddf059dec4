"""What the plan says of both links: `radio`."""

from dataclasses import field
from typing import Literal, TypeAlias

from faao_mav.plan.fields import (
    Antennas,
    Flag,
    Gain,
    Noise,
    Number,
    Position,
    Power,
    Whole,
    key,
    linear,
    section,
    watts,
)

Modulation: TypeAlias = Literal["bpsk", "qpsk", "8psk", "16qam", "64qam"]
LineOfSight: TypeAlias = Literal["ula", "all_ones"]
Fading: TypeAlias = Literal["ergodic", "realization", "none"]
ChannelKnowledge: TypeAlias = Literal["statistical", "instantaneous"]
Duplex: TypeAlias = Literal["full", "half"]

_POWER, _NOISE, _GAIN = watts(20), watts(-80), linear(-50)


@section
class BaseStation:
    """The base station."""

    position: Position = key("Place p_B.", "m")
    antennas: Antennas = key("Antennas N_t.", default=2)
    power: Power = key("Transmit power W_B.", "dBm", name="power_dbm", default=_POWER)


@section
class Relay:
    """The radio aboard."""

    antennas: Antennas = key("Antennas N_u.", default=2)
    power: Power = key("Transmit power W_U.", "dBm", name="power_dbm", default=_POWER)
    noise: Noise = key("Noise power sigma_U^2.", "dBm", name="noise_dbm", default=_NOISE)
    buffer_mbytes: Number | None = key(
        "What the relay can hold (needs radio.bandwidth_mhz); null: any amount.",
        "(0, 1e9] megabytes",
        default=None,
    )


@section
class GroundUser:
    """The ground user."""

    position: Position = key("Place p_U.", "m")
    antennas: Antennas = key("Antennas N_r.", default=2)
    noise: Noise = key("Noise power sigma_G^2.", "dBm", name="noise_dbm", default=_NOISE)


@section
class Radio:
    """Both links."""

    base_station: BaseStation
    relay: Relay = field(default_factory=Relay)
    ground_user: GroundUser
    modulation: Modulation = key("The alphabet of both hops.", default="bpsk")
    reference_gain: Gain = key(
        "Power gain rho_0 at 1 m.", "dB", name="reference_gain_db", default=_GAIN
    )
    rician_factor: Number = key("Rician factor K, linear.", "[0, 1e6]", default=3.0)
    line_of_sight: LineOfSight = key(
        "ula: half-wavelength arrays along east, follows the aircraft; all_ones: ones.",
        default="ula",
    )
    fading: Fading = key(
        "ergodic: the mean over fading; realization: one known draw per slot, as in the paper; "
        "none: the line of sight alone.",
        default="ergodic",
    )
    fading_samples: Whole = key(
        "Draws that the mean over fading is taken over.", "[1, 10000]", default=32
    )
    csi: ChannelKnowledge = key(
        "Ergodic fading: one precoder per slot (statistical) or per draw (instantaneous).",
        default="statistical",
    )
    seed: Whole = key(
        "Seed of the draws.", accepted="a whole number from 0", ge=0, lt=2**63, default=0
    )
    causal: Flag = key(
        "true: plan for what is delivered by a relay that forwards only what it has received; "
        "false: for R_avg, as in the paper.",
        default=True,
    )
    duplex: Duplex = key(
        "full: two bands, one for each hop; half: both hops share the time of each slot.",
        default="full",
    )
    bandwidth_mhz: Number | None = key(
        "Bandwidth of a hop, to tell rates in Mbit/s and flights in megabytes; null: not told.",
        "(0, 100000] MHz",
        default=None,
    )

    @property
    def maximised(self) -> str:
        """The name of the rate that is maximised."""
        return "R_del" if self.causal else "R_avg"
