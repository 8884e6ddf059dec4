"""What the plan says of both links: `radio`."""

from dataclasses import field
from typing import Annotated, Any, Literal, TypeAlias

from pydantic import AfterValidator, Field, PlainValidator, ValidationInfo

from faao_mav.errors import InputError
from faao_mav.plan.fields import (
    DEFAULTS,
    Antennas,
    Flag,
    Gain,
    Noise,
    Number,
    Power,
    Text,
    Whole,
    linear,
    section,
    told,
)
from faao_mav.plan.station import Station
from faao_mav.radio.gain import PathGain
from faao_mav.radio.gain_map import GainMap
from faao_mav.radio.map_file import WORD, map_of_word
from faao_mav.radio.rate_steps import RateSteps

_Rate: TypeAlias = Annotated[Number, Field(ge=0, le=1e6)]
_Angle: TypeAlias = Annotated[Number, Field(ge=0, le=90)]
_Distance: TypeAlias = Annotated[Number, Field(gt=0)]


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

    reference_gain_db: Number | None = None
    exponent: Number = 2.0
    elevation_db: Annotated[tuple[Number, ...], Field(max_length=3)] = ()
    spread_db: Number | None = None
    correlation_m: Number = 50.0
    elevation_deg: Annotated[tuple[_Angle, _Angle], AfterValidator(_in_order)] | None = None
    distance_m: Annotated[tuple[_Distance, _Distance], AfterValidator(_in_order)] | None = None
    map: Annotated[GainMap, PlainValidator(_map)] | None = None
    about: Text = ""

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

    snr_db: Annotated[tuple[Number, ...], Field(max_length=1000)]
    mbit_per_s: tuple[_Rate, ...] = ()
    bit_per_s_per_hz: tuple[_Rate, ...] = ()


@section
class BaseStation(Station):
    """The base station, at p_B."""

    antennas: Antennas = 2
    power: Power = 20
    gain: GainLaw | None = None


@section
class Relay:
    """The radio aboard."""

    antennas: Antennas = 2
    power: Power = 20
    noise: Noise = -80
    buffer_mbytes: Number | None = None


@section
class GroundUser(Station):
    """The ground user, at p_U."""

    antennas: Antennas = 2
    noise: Noise = -80
    gain: GainLaw | None = None


STATIONS = ("base_station", "ground_user")
"""The keys of the stations, in the order of `Radio.stations`."""


@section
class Radio:
    """Both links."""

    base_station: BaseStation
    relay: Relay = field(default_factory=DEFAULTS)
    ground_user: GroundUser
    modulation: Literal["bpsk", "qpsk", "8psk", "16qam", "64qam"] = "bpsk"
    rates: RadioRates | None = None
    reference_gain: Gain = -50
    gain: GainLaw = field(default_factory=DEFAULTS)
    reliability: Number | None = None
    rician_factor: Number = 3.0
    line_of_sight: Literal["ula", "all_ones"] = "ula"
    fading: Literal["ergodic", "realization", "none"] = "ergodic"
    fading_samples: Whole = 32
    csi: Literal["statistical", "instantaneous"] = "statistical"
    seed: Annotated[Whole, Field(ge=0, lt=2**63)] = 0
    causal: Flag = True
    duplex: Literal["full", "half"] = "full"
    bandwidth_mhz: Number | None = None

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
