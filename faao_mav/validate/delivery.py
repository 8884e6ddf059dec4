"""Whether the mission delivers the link that was planned."""

import math
from collections.abc import Iterator

from faao_mav.plan import Radio
from faao_mav.plan.fields import dbm
from faao_mav.validate.context import ValidationContext
from faao_mav.validate.demands import LATE_START
from faao_mav.validate.rule import Hits, checks, hit, threshold


@checks
def _link(context: ValidationContext) -> Hits:
    """What is wrong with the plan itself, and how the flight carries it out."""
    link = context.link
    if context.unpredicted:
        yield hit("link-not-predicted", why=context.unpredicted)
    if link is None:
        return
    if link.planned_delivered < threshold.nothing:
        yield hit("link-nothing")
    for told in _doubtful_values(link.radio) if link.radio else ():
        yield hit("radio-values", told=told)
    for told in link.unmeasured:
        yield hit("link-unmeasured", told=told)
    if link.off_map:
        yield hit("link-off-map")
    if link.elsewhere:  # and nothing is said of the flight
        yield hit("link-elsewhere", away=link.away / 1000)
        return
    percent = 100 * link.share
    if percent < threshold.good:
        yield hit("link-rate-reduced", percent=percent)
    late = max(threshold.late, threshold.late_share / 100 * link.planned_duration)
    for rule, holds in (
        ("link-path", link.path_error > link.path_tolerance + threshold.path_allowance),
        ("link-late", link.late > late),
        ("link-apart", link.rms_position_error > threshold.apart),
        ("link-altitude", link.altitude_error > threshold.altitude_error),
    ):
        if holds:
            yield hit(rule)
    yield hit("link-timing", percent=percent)
    if link.late_share is not None:
        yield hit("link-moving", late=LATE_START, percent=100 * link.late_share)


def _doubtful_values(radio: Radio) -> Iterator[str]:
    """Yield what is doubtful about a value of `radio`."""
    band_mhz = radio.bandwidth_mhz or threshold.least_bandwidth
    thermal = threshold.thermal + 60 + 10 * math.log10(band_mhz)
    for station, watts in (("relay", radio.relay.noise), ("ground_user", radio.ground_user.noise)):
        told = f"radio.{station}.noise_dbm: {dbm(watts):.4g} dBm is"
        if dbm(watts) > threshold.most_noise:
            yield f"{told} more noise than any receiver has"
        elif dbm(watts) < thermal - threshold.cooled:
            yield f"{told} less than thermal noise in {band_mhz:g} MHz ({thermal:.0f} dBm)"
    powers = {"base_station": radio.base_station.power, "relay": radio.relay.power}
    for station, watts in powers.items():
        if (power := dbm(watts)) > threshold.most_power:
            told = f"radio.{station}.power_dbm: {power:.4g} dBm is {watts:,.4g} W"
            yield f"{told}, more than relays transmit"
