"""Whether the mission delivers the link that was planned."""

from faao_mav.plan.radio_values import doubtful_values
from faao_mav.validate.context import ValidationContext
from faao_mav.validate.demands import LATE_START
from faao_mav.validate.rule import Hits, checks, hit

GOOD_PERCENT = 99.5
"""The share of what is planned, %, below which something can be won back. Chosen."""

LATE, LATE_PERCENT = 3.0, 5.0
"""By how many seconds, and by which share of the planned duration, a flight ends late that does not
keep its plan: both are exceeded. Chosen."""

APART = 3.0
"""The rms distance from the plan at equal times that is reported, m: the missions of the sample
plans are predicted within 2.9 m."""

PATH_ALLOWANCE = 0.2
"""How far beyond the plan's path_tolerance the predicted path may lie, m: predictions are no
better."""

ALTITUDE_ERROR = 2.0
"""The error of the altitude that is reported, m: from 100 m up it changes the rate by a tenth of a
decibel."""

NOTHING = 1e-3
"""The delivered rate, bit/s/Hz, below which a flight delivers next to nothing. Chosen: 20 kbit/s in
20 MHz."""


@checks()
def _link(context: ValidationContext) -> Hits:
    """What is wrong with the plan itself, and how the flight carries it out."""
    link = context.link
    if link is None:
        return
    if link.planned_delivered < NOTHING:
        yield hit("link-nothing")
    for told, instead in doubtful_values(link.radio) if link.radio else ():
        yield hit("radio-values", told=told, instead=instead)
    for told in link.unmeasured:
        yield hit("link-unmeasured", told=told)
    if link.off_map:
        yield hit("link-off-map")
    if link.elsewhere:  # and nothing is said of the flight
        yield hit("link-elsewhere", away=link.away / 1000)
        return
    percent, worst, where = 100 * link.share, link.worst, ""
    if worst is not None:
        where = f"; {worst.rate_lost:.3g} of it between {worst.start:.0f} and {worst.end:.0f} s"
    if percent < GOOD_PERCENT:
        yield hit("link-rate-reduced", percent=percent, where=where)
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
