"""Whether the mission delivers the link that was planned."""

import math
from collections.abc import Iterator

from faao_mav.plan import Radio
from faao_mav.plan.fields import dbm
from faao_mav.validate.context import ValidationContext
from faao_mav.validate.demands import LATE_START
from faao_mav.validate.rule import Hits, checks, hit

# The share of what is planned, %, below which something can be won back. Chosen.
GOOD_PERCENT = 99.5
# By how many seconds, and by which share of the planned duration, a flight ends late that does not
# keep its plan: both are exceeded. Chosen.
LATE, LATE_PERCENT = 3.0, 5.0
# The rms distance from the plan at equal times that is reported, m: the missions of the sample
# plans are predicted within 2.9 m.
APART = 3.0
# How far beyond the plan's path_tolerance the predicted path may lie, m: predictions are no better.
PATH_ALLOWANCE = 0.2
# The error of the altitude that is reported, m: from 100 m up it changes the rate by a tenth of a
# decibel.
ALTITUDE_ERROR = 2.0
# The delivered rate, bit/s/Hz, below which a flight delivers next to nothing. Chosen: 20 kbit/s in
# 20 MHz.
NOTHING = 1e-3
# The noise power, dBm, above which no receiver works. Chosen: cities at HF have less in 1 MHz.
_MOST_NOISE = -40.0
_THERMAL = -174.0  # Thermal noise at 290 K, dBm in 1 Hz: k T.
# The narrowest hop that is taken for granted without `bandwidth_mhz`: 1 kHz. Chosen.
_LEAST_BANDWIDTH_MHZ = 1e-3
_MOST_POWER = 50.0  # The transmit power, dBm, above which a station is asked about: 100 W. Chosen.
# How far below thermal noise, dB, a receiver's may be told before it is doubted. Chosen.
_COOLED = 1.0


@checks
def _link(context: ValidationContext) -> Hits:
    """What is wrong with the plan itself, and how the flight carries it out."""
    link = context.link
    if link is None:
        return
    if link.planned_delivered < NOTHING:
        yield hit("link-nothing")
    for told, instead in _doubtful_values(link.radio) if link.radio else ():
        yield hit("radio-values", told=told, instead=instead)
    for told in link.unmeasured:
        yield hit("link-unmeasured", told=told)
    if link.off_map:
        yield hit("link-off-map")
    if link.elsewhere:  # and nothing is said of the flight
        yield hit("link-elsewhere", away=link.away / 1000)
        return
    percent = 100 * link.share
    if percent < GOOD_PERCENT:
        yield hit("link-rate-reduced", percent=percent)
    for rule, holds in (
        ("link-path", link.path_error > link.path_tolerance + PATH_ALLOWANCE),
        ("link-late", link.late > max(LATE, LATE_PERCENT / 100 * link.planned_duration)),
        ("link-apart", link.rms_position_error > APART),
        ("link-altitude", link.altitude_error > ALTITUDE_ERROR),
    ):
        if holds:
            yield hit(rule)
    yield hit("link-timing", percent=percent)
    if link.late_share is not None:
        yield hit("link-moving", late=LATE_START, percent=100 * link.late_share)


def _doubtful_values(radio: Radio) -> Iterator[tuple[str, str]]:
    """Yield what is doubtful about a value of `radio`, and what it may be meant to be."""
    band_mhz = radio.bandwidth_mhz or _LEAST_BANDWIDTH_MHZ
    thermal = _THERMAL + 60 + 10 * math.log10(band_mhz)
    for station, watts in (("relay", radio.relay.noise), ("ground_user", radio.ground_user.noise)):
        noise, key = dbm(watts), f"radio.{station}.noise_dbm"
        if noise > _MOST_NOISE:
            told = f"{key}: {noise:.4g} dBm is more noise than any receiver has"
            minus = ": is a minus missing?" if noise > 0 else ""
            yield told, f"receivers have -80 to -120 dBm{minus}"
        elif noise < thermal - _COOLED:
            wide = f"{band_mhz:g} MHz" if radio.bandwidth_mhz else "even 1 kHz"
            less = f"less than thermal noise in {wide} ({thermal:.0f} dBm)"
            density = "if it is a density (dBm/Hz), add 10 log10 of the bandwidth in Hz"
            yield f"{key}: {noise:.4g} dBm is {less}", density
    powers = {"base_station": radio.base_station.power, "relay": radio.relay.power}
    for station, watts in powers.items():
        power, key = dbm(watts), f"radio.{station}.power_dbm"
        if power > _MOST_POWER:
            yield (
                f"{key}: {power:.4g} dBm is {watts:,.4g} W, more than relays transmit",
                f"if {power:.4g} mW are meant, give {10 * math.log10(power):.1f} (dBm)",
            )
