"""Whether the mission delivers the link that was planned."""

from faao_mav.plan.radio_values import doubtful_values
from faao_mav.validate.context import ValidationContext
from faao_mav.validate.demands import LinkCheck
from faao_mav.validate.rule import Checks, Hits, at

checks = Checks()

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


@checks("link-nothing")
def _(context: ValidationContext) -> Hits:
    link = context.link
    if link is not None and link.planned_delivered < NOTHING:
        yield at(rate=link.planned_delivered)


@checks("radio-values")
def _(context: ValidationContext) -> Hits:
    if context.link is not None and context.link.radio is not None:
        for told, instead in doubtful_values(context.link.radio):
            yield at(told=told, instead=instead)


@checks("link-elsewhere")
def _(context: ValidationContext) -> Hits:
    if context.link is not None and context.link.elsewhere:
        yield at(away=context.link.away / 1000)


def _links(context: ValidationContext) -> tuple[LinkCheck, ...]:
    """Return how the mission carries out the plan; nothing without one, or at another place."""
    return () if context.link is None or context.link.elsewhere else (context.link,)


@checks("link-rate-reduced")
def _(context: ValidationContext) -> Hits:
    for link in _links(context):
        where = ""
        if (worst := link.worst) is not None:
            where = f"; {worst.rate_lost:.3g} of it between {worst.start:.0f} and {worst.end:.0f} s"
        if 100 * link.share < GOOD_PERCENT:
            yield at(link=link, percent=100 * link.share, where=where)


@checks("link-path")
def _(context: ValidationContext) -> Hits:
    for link in _links(context):
        if link.path_error > link.path_tolerance + PATH_ALLOWANCE:
            yield at(link=link)


@checks("link-late")
def _(context: ValidationContext) -> Hits:
    for link in _links(context):
        if link.late > max(LATE, LATE_PERCENT / 100 * link.planned_duration):
            yield at(link=link)


@checks("link-apart")
def _(context: ValidationContext) -> Hits:
    return (at(link=link) for link in _links(context) if link.rms_position_error > APART)


@checks("link-altitude")
def _(context: ValidationContext) -> Hits:
    return (at(link=link) for link in _links(context) if link.altitude_error > ALTITUDE_ERROR)


@checks("link-timing")
def _(context: ValidationContext) -> Hits:
    return (at(link=link, percent=100 * link.share) for link in _links(context))
