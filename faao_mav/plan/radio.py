"""What the plan says of both links: `radio`."""

from dataclasses import field
from typing import Annotated, Any, Literal, TypeAlias

from pydantic import AfterValidator, Field, PlainValidator, ValidationInfo

from faao_mav.errors import InputError
from faao_mav.plan.fields import (
    Antennas,
    Flag,
    Gain,
    Noise,
    Number,
    Power,
    Text,
    Whole,
    key,
    linear,
    section,
    told,
    watts,
)
from faao_mav.plan.station import Station
from faao_mav.radio.gain import PathGain
from faao_mav.radio.gain_map import GainMap
from faao_mav.radio.map_file import WORD, map_of_word
from faao_mav.radio.rate_steps import RateSteps

_Rate: TypeAlias = Annotated[Number, Field(ge=0, le=1e6)]
_Angle: TypeAlias = Annotated[Number, Field(ge=0, le=90)]
_Distance: TypeAlias = Annotated[Number, Field(gt=0)]

_POWER, _NOISE = watts(20), watts(-80)


def _map(value: object, info: ValidationInfo) -> GainMap:
    """Return the map that a plan's text holds, about the origin of the plan."""
    context: Any = info.context
    if not (isinstance(value, str) and value.startswith(WORD)):
        raise ValueError("no map")
    origin = (*context["origin"], context["elevation"]) if "origin" in context else None
    try:
        return map_of_word(value, origin)
    except InputError as error:
        raise told(str(error)) from None


def _in_order(ends: tuple[float, float]) -> tuple[float, float]:
    if ends[0] > ends[1]:
        raise ValueError("the least is above the most")
    return ends


@section
class GainLaw:
    """The law of the path gain: reference_gain_db - 10 n log10(d) + c1 s + c2 s^2 + c3 s^3, dB.

    With s = H / d, the sine of the elevation. It may stand in a file of its own.
    """

    reference_gain_db: Number | None = key(
        "Power gain at 1 m; null: radio.reference_gain_db.", "[-300, 100] dB", default=None
    )
    exponent: Number = key("Exponent n of the distance d.", "[0, 10]", default=2.0)
    elevation_db: tuple[Number, ...] = key(
        "Terms over s.", "dB", "at most three numbers [c1, c2, c3]", max_length=3, default=()
    )
    spread_db: Number | None = key(
        "Standard deviation of shadowing about the law; null: unknown.", "(0, 30] dB", default=None
    )
    correlation_m: Number = key(
        "Distance at which shadowing is correlated by 1/e.", "(0, 10000] m", default=50.0
    )
    elevation_deg: Annotated[tuple[_Angle, _Angle], AfterValidator(_in_order)] | None = key(
        "Least and greatest elevation at which it was measured; null: unknown.",
        "degrees",
        "two numbers [least, most], 0 to 90",
        default=None,
    )
    distance_m: Annotated[tuple[_Distance, _Distance], AfterValidator(_in_order)] | None = key(
        "Least and greatest distance d at which it was measured; null: unknown.",
        "m",
        "two numbers [least, most] above 0",
        default=None,
    )
    map: Annotated[GainMap, PlainValidator(_map)] | None = key(
        "Gain over the map, in dB, or what it is above the law; null: the law alone.",
        accepted="the name of a .npz, .csv, .tif or .tiff",
        default=None,
    )
    about: Text = key("What it was found from.", accepted="one line of text", default="")

    @property
    def whole(self) -> GainMap | None:
        """The map where it is the gain itself, without a law; None otherwise."""
        return None if self.map is None or self.map.above_law else self.map

    def path_gain(self, reference: float) -> PathGain:
        """Return the law, of a linear gain `reference` at 1 m unless it has its own."""
        if self.whole:
            return PathGain(1.0, exponent=0.0)
        own = reference if self.reference_gain_db is None else linear(self.reference_gain_db)
        return PathGain(own, self.exponent, self.elevation_db)


@section
class RadioRates:
    """The rates that the radio has, in place of the alphabet's, by the least SNR of each."""

    snr_db: tuple[Number, ...] = key("Least SNR.", "dB", "a list of numbers", max_length=1000)
    mbit_per_s: tuple[_Rate, ...] = key(
        "Rates in the band of radio.bandwidth_mhz.", "Mbit/s", "a list of numbers", default=()
    )
    bit_per_s_per_hz: tuple[_Rate, ...] = key(
        "Rates, instead of mbit_per_s.", "bit/s/Hz", "a list of numbers", default=()
    )


_GAIN_FILE = "a mapping with reference_gain_db, exponent, elevation_db, map, or the name of a file"


@section
class BaseStation(Station):
    """The base station, at p_B."""

    antennas: Antennas = key("Antennas N_t.", default=2)
    power: Power = key("Transmit power W_B.", "dBm", name="power_dbm", default=_POWER)
    gain: GainLaw | None = key("Own path gain of this hop.", accepted=_GAIN_FILE, default=None)


@section
class Relay:
    """The radio aboard."""

    antennas: Antennas = key("Antennas N_u.", default=2)
    power: Power = key("Transmit power W_U.", "dBm", name="power_dbm", default=_POWER)
    noise: Noise = key("Noise power sigma_U^2.", "dBm", name="noise_dbm", default=_NOISE)
    buffer_mbytes: Number | None = key(
        "What it holds (needs radio.bandwidth_mhz); null: any.", "(0, 1e9] megabytes", default=None
    )


@section
class GroundUser(Station):
    """The ground user, at p_U."""

    antennas: Antennas = key("Antennas N_r.", default=2)
    noise: Noise = key("Noise power sigma_G^2.", "dBm", name="noise_dbm", default=_NOISE)
    gain: GainLaw | None = key("Own path gain of this hop.", accepted=_GAIN_FILE, default=None)


STATIONS = ("base_station", "ground_user")
"""The keys of the stations, in the order of `Radio.stations`."""


@section
class Radio:
    """Both links."""

    base_station: BaseStation
    relay: Relay = field(default_factory=Relay)
    ground_user: GroundUser
    modulation: Literal["bpsk", "qpsk", "8psk", "16qam", "64qam"] = key(
        "The alphabet of both hops.", default="bpsk"
    )
    rates: RadioRates | None = key(
        "The radio's own rates, of one stream, in place of the alphabet's.",
        accepted="a mapping with snr_db and mbit_per_s or bit_per_s_per_hz, or the name of a .csv",
        default=None,
    )
    reference_gain: Gain = key(
        "Power gain rho_0 at 1 m.", "dB", name="reference_gain_db", default=linear(-50)
    )
    gain: GainLaw = key(
        "Path gain of both hops, in dB by place.", accepted=_GAIN_FILE, default_factory=GainLaw
    )
    reliability: Number | None = key(
        "Share of shadowings in which at least what is maximised arrives; null: plan for the mean.",
        "[0.5, 0.99]",
        default=None,
    )
    rician_factor: Number = key("Rician factor K, linear.", "[0, 1e6]", default=3.0)
    line_of_sight: Literal["ula", "all_ones"] = key(
        "ula: half-wavelength arrays along east, follows the UAV; all_ones: ones.", default="ula"
    )
    fading: Literal["ergodic", "realization", "none"] = key(
        "ergodic: the mean over fading; realization: one known draw per slot, as in the paper; "
        "none: the line of sight alone.",
        default="ergodic",
    )
    fading_samples: Whole = key("Draws of the mean over fading.", "[1, 10000]", default=32)
    csi: Literal["statistical", "instantaneous"] = key(
        "Ergodic: a precoder per slot (statistical) or draw (instantaneous).", default="statistical"
    )
    seed: Whole = key("Seed of draws.", accepted="a whole number from 0", ge=0, lt=2**63, default=0)
    causal: Flag = key(
        "true: plan for what is delivered by a relay that forwards only what it has received; "
        "false: for R_avg, as in the paper.",
        default=True,
    )
    duplex: Literal["full", "half"] = key(
        "full: a band for each hop; half: both hops share the time of each slot.", default="full"
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

    @property
    def rate_steps(self) -> RateSteps | None:
        """The radio's own rates, bit/s/Hz; None where they are the alphabet's."""
        if self.rates is None:
            return None
        megabits = [rate / (self.bandwidth_mhz or 1.0) for rate in self.rates.mbit_per_s]
        return RateSteps.of(self.rates.snr_db, self.rates.bit_per_s_per_hz or megabits)

    @property
    def stations(self) -> tuple[Station, Station]:
        """The base station and the ground user."""
        return self.base_station, self.ground_user

    @property
    def gain_laws(self) -> tuple[GainLaw, GainLaw]:
        """What the plan says of the path gain of each hop, BS to UAV and UAV to user."""
        return self.base_station.gain or self.gain, self.ground_user.gain or self.gain

    @property
    def spreads(self) -> tuple[float, float]:
        """The standard deviation of shadowing about the law of each hop, dB; 0: unknown."""
        first, second = self.gain_laws
        return first.spread_db or 0.0, second.spread_db or 0.0

    @property
    def path_gains(self) -> tuple[PathGain, PathGain]:
        """The law of each hop's path gain: 0 dB under a map of the gain itself."""
        first, second = self.gain_laws
        return first.path_gain(self.reference_gain), second.path_gain(self.reference_gain)
