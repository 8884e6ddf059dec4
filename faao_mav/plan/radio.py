"""What the plan says of both links: `radio`."""

from dataclasses import dataclass, field
from typing import Annotated, Literal, TypeAlias

from faao_mav.plan.fields import (
    Antennas,
    Flag,
    Gain,
    Noise,
    Number,
    Position,
    Power,
    Section,
    Whole,
    key,
    linear,
    watts,
)

Modulation: TypeAlias = Literal["bpsk", "qpsk", "8psk", "16qam", "64qam"]
LineOfSight: TypeAlias = Literal["ula", "all_ones"]
Fading: TypeAlias = Literal["ergodic", "realization", "none"]
ChannelKnowledge: TypeAlias = Literal["statistical", "instantaneous"]
Duplex: TypeAlias = Literal["full", "half"]

_POWER, _NOISE, _GAIN = watts(20), watts(-80), linear(-50)


@dataclass(frozen=True, slots=True, kw_only=True)
class BaseStation(Section):
    """The base station."""

    position: Annotated[Position, key("Place p_B.", "m")]
    antennas: Annotated[Antennas, key("Antennas N_t.")] = 2
    power: Annotated[Power, key("Transmit power W_B.", "dBm", name="power_dbm")] = _POWER


@dataclass(frozen=True, slots=True, kw_only=True)
class Relay(Section):
    """The radio aboard."""

    antennas: Annotated[Antennas, key("Antennas N_u.")] = 2
    power: Annotated[Power, key("Transmit power W_U.", "dBm", name="power_dbm")] = _POWER
    noise: Annotated[Noise, key("Noise power sigma_U^2.", "dBm", name="noise_dbm")] = _NOISE
    buffer_mbytes: Annotated[
        Number | None,
        key(
            "What the relay can hold (needs radio.bandwidth_mhz); null: any amount.",
            "megabytes",
            gt=0,
            le=1e9,
        ),
    ] = None


@dataclass(frozen=True, slots=True, kw_only=True)
class GroundUser(Section):
    """The ground user."""

    position: Annotated[Position, key("Place p_U.", "m")]
    antennas: Annotated[Antennas, key("Antennas N_r.")] = 2
    noise: Annotated[Noise, key("Noise power sigma_G^2.", "dBm", name="noise_dbm")] = _NOISE


@dataclass(frozen=True, slots=True, kw_only=True)
class Radio(Section):
    """Both links."""

    base_station: BaseStation
    relay: Relay = field(default_factory=Relay)
    ground_user: GroundUser
    modulation: Annotated[Modulation, key("The alphabet of both hops.")] = "bpsk"
    reference_gain: Annotated[
        Gain, key("Power gain rho_0 at 1 m.", "dB", name="reference_gain_db")
    ] = _GAIN
    rician_factor: Annotated[Number, key("Rician factor K, linear.", ge=0, le=1e6)] = 3.0
    line_of_sight: Annotated[
        LineOfSight,
        key("ula: half-wavelength arrays along east, follows the aircraft; all_ones: ones."),
    ] = "ula"
    fading: Annotated[
        Fading,
        key(
            "ergodic: the mean over fading; realization: one known draw per slot, as in the paper; "
            "none: the line of sight alone."
        ),
    ] = "ergodic"
    fading_samples: Annotated[
        Whole, key("Draws that the mean over fading is taken over.", ge=1, le=10_000)
    ] = 32
    csi: Annotated[
        ChannelKnowledge,
        key("Ergodic fading: one precoder per slot (statistical) or per draw (instantaneous)."),
    ] = "statistical"
    seed: Annotated[
        Whole, key("Seed of the draws.", accepted="a whole number from 0", ge=0, lt=2**63)
    ] = 0
    causal: Annotated[
        Flag,
        key(
            "true: plan for what is delivered by a relay that forwards only what it has received; "
            "false: for R_avg, as in the paper."
        ),
    ] = True
    duplex: Annotated[
        Duplex,
        key("full: two bands, one for each hop; half: both hops share the time of each slot."),
    ] = "full"
    bandwidth_mhz: Annotated[
        Number | None,
        key(
            "Bandwidth of a hop, to tell rates in Mbit/s and flights in megabytes; null: not told.",
            "MHz",
            gt=0,
            le=1e5,
        ),
    ] = None

    @property
    def maximised(self) -> str:
        """The name of the rate that is maximised."""
        return "R_del" if self.causal else "R_avg"
