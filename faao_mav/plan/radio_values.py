"""Values of `radio` that no radio has, with the slip that they are likely to be."""

import math
from collections.abc import Iterator

from faao_mav.plan.fields import dbm
from faao_mav.plan.radio import Radio

_MOST_NOISE = -40.0
"""The noise power, dBm, above which no receiver works. Chosen: cities at HF have less in 1 MHz."""

_THERMAL = -174.0
"""Thermal noise at 290 K, dBm in 1 Hz: k T."""

_LEAST_BANDWIDTH_MHZ = 1e-3
"""The narrowest hop that is taken for granted without `bandwidth_mhz`: 1 kHz. Chosen."""

_MOST_POWER = 50.0
"""The transmit power, dBm, above which a station is asked about: 100 W. Chosen."""

_COOLED = 1.0
"""How far below thermal noise, dB, a receiver's may be told before it is doubted. Chosen."""


def doubtful_values(radio: Radio) -> Iterator[tuple[str, str]]:
    """Yield what is doubtful about a value of `radio`, and what it may be meant to be."""
    noises = {"relay": radio.relay.noise, "ground_user": radio.ground_user.noise}
    for station, watts in noises.items():
        yield from _doubtful_noise(f"radio.{station}.noise_dbm", dbm(watts), radio.bandwidth_mhz)
    powers = {"base_station": radio.base_station.power, "relay": radio.relay.power}
    for station, watts in powers.items():
        power, key = dbm(watts), f"radio.{station}.power_dbm"
        if power > _MOST_POWER:
            yield (
                f"{key}: {power:.4g} dBm is {watts:,.4g} W, more than relays transmit",
                f"if {power:.4g} mW are meant, give {10 * math.log10(power):.1f} (dBm)",
            )


def _doubtful_noise(
    key: str, noise: float, bandwidth_mhz: float | None
) -> Iterator[tuple[str, str]]:
    in_band = 60 + 10 * math.log10(bandwidth_mhz or _LEAST_BANDWIDTH_MHZ)  # dB over 1 Hz
    thermal = _THERMAL + in_band
    if noise > _MOST_NOISE:
        slip = f"did you mean {-noise:.4g}?" if noise > 0 else "receivers have -80 to -120 dBm"
        yield f"{key}: {noise:.4g} dBm is more noise than any receiver has", slip
    elif noise < thermal - _COOLED:
        wide = f"{bandwidth_mhz:g} MHz" if bandwidth_mhz else "even 1 kHz"
        given = f"give {noise + in_band:.1f}" if bandwidth_mhz else "add 10 log10 of the Hz"
        yield (
            f"{key}: {noise:.4g} dBm is less than thermal noise in {wide} ({thermal:.0f} dBm)",
            f"if it is a density (dBm/Hz), {given} for the band",
        )
