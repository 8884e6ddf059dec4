"""Whether the mission delivers the link that was planned."""

import math
from collections.abc import Iterator

from faao_mav.plan import Radio
from faao_mav.plan.fields import dbm
from faao_mav.validate.context import ValidationContext
from faao_mav.validate.demands import LATE_START
from faao_mav.validate.rule import Hits, bound, checks, hit


@checks
def _link(context: ValidationContext) -> Hits:
    """What is wrong with the plan itself, and how the flight carries it out."""
    link = context.link
    if link is None:
        return
    if link.planned_delivered < bound.nothing:
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
    if percent < bound.good:
        yield hit("link-rate-reduced", percent=percent)
    for rule, holds in (
        ("link-path", link.path_error > link.path_tolerance + bound.path_allowance),
        ("link-late", link.late > max(bound.late, bound.late_share / 100 * link.planned_duration)),
        ("link-apart", link.rms_position_error > bound.apart),
        ("link-altitude", link.altitude_error > bound.altitude_error),
    ):
        if holds:
            yield hit(rule)
    yield hit("link-timing", percent=percent)
    if link.late_share is not None:
        yield hit("link-moving", late=LATE_START, percent=100 * link.late_share)


def _doubtful_values(radio: Radio) -> Iterator[tuple[str, str]]:
    """Yield what is doubtful about a value of `radio`, and what it may be meant to be."""
    band_mhz = radio.bandwidth_mhz or bound.least_bandwidth
    thermal = bound.thermal + 60 + 10 * math.log10(band_mhz)
    for station, watts in (("relay", radio.relay.noise), ("ground_user", radio.ground_user.noise)):
        noise, key = dbm(watts), f"radio.{station}.noise_dbm"
        if noise > bound.most_noise:
            told = f"{key}: {noise:.4g} dBm is more noise than any receiver has"
            minus = ": is a minus missing?" if noise > 0 else ""
            yield told, f"receivers have -80 to -120 dBm{minus}"
        elif noise < thermal - bound.cooled:
            wide = f"{band_mhz:g} MHz" if radio.bandwidth_mhz else "even 1 kHz"
            less = f"less than thermal noise in {wide} ({thermal:.0f} dBm)"
            density = "if it is a density (dBm/Hz), add 10 log10 of the bandwidth in Hz"
            yield f"{key}: {noise:.4g} dBm is {less}", density
    powers = {"base_station": radio.base_station.power, "relay": radio.relay.power}
    for station, watts in powers.items():
        power, key = dbm(watts), f"radio.{station}.power_dbm"
        if power > bound.most_power:
            yield (
                f"{key}: {power:.4g} dBm is {watts:,.4g} W, more than relays transmit",
                f"if {power:.4g} mW are meant, give {10 * math.log10(power):.1f} (dBm)",
            )
