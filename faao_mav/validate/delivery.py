"""Whether the mission delivers the link that was planned."""

from collections.abc import Iterator

from faao_mav.plan.radio_values import doubtful_values
from faao_mav.validate.context import ValidationContext
from faao_mav.validate.demands import LinkCheck
from faao_mav.validate.rule import Issue, Rules

RULES = Rules()

GOOD_SHARE = 0.995
"""The share of what is planned below which something can be won back. Chosen."""

LATE, LATE_SHARE = 3.0, 0.05
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

_SOURCE = "the plan, and the rate along the predicted flight"


@RULES.error(
    "link-nothing",
    _SOURCE,
    summary=f"the plan delivers less than {NOTHING:g} bit/s/Hz",
)
def _nothing(context: ValidationContext) -> Iterator[Issue]:
    link = context.link
    if link is not None and link.planned_delivered < NOTHING:
        yield Issue(
            None,
            f"the plan delivers {link.planned_delivered:.2g} bit/s/Hz, next to nothing",
            "check powers, noise and gain in radio (dBm, dB), or fly nearer to the stations",
        )


@RULES.warning("radio-values", "thermal noise k T B; powers and noises that radios have")
def _radio_values(context: ValidationContext) -> Iterator[Issue]:
    """A power or a noise of the plan that no radio has."""
    if context.link is not None and context.link.radio is not None:
        for message, action in doubtful_values(context.link.radio):
            yield Issue(None, message, action)


@RULES.error("link-elsewhere", _SOURCE)
def _elsewhere(context: ValidationContext) -> Iterator[Issue]:
    """The mission is flown at another place than the plan."""
    link = context.link
    if link is not None and link.elsewhere:
        yield Issue(
            None,
            f"the mission comes no nearer than {link.away / 1000:,.1f} km to the plan's route",
            "give the plan that the mission was made for, or make the mission anew",
        )


def _there(context: ValidationContext) -> LinkCheck | None:
    """Return how the mission carries out the plan; None without one, or at another place."""
    return context.link if context.link is not None and not context.link.elsewhere else None


@RULES.warning(
    "link-rate-reduced",
    _SOURCE,
    summary=f"the flight is predicted to deliver less than {100 * GOOD_SHARE:g} % of what is "
    "planned",
)
def _reduced(context: ValidationContext) -> Iterator[Issue]:
    link = _there(context)
    if link is None or link.share >= GOOD_SHARE:
        return
    where = ""
    if link.worst is not None:
        where = (
            f"; {link.worst.rate_lost:.3g} of it between {link.worst.start:.0f} and "
            f"{link.worst.end:.0f} s"
        )
    yield Issue(
        None,
        f"predicted to deliver {link.predicted_delivered:.4f} bit/s/Hz of the planned "
        f"{link.planned_delivered:.4f} (R_avg {link.predicted_rate:.4f} of "
        f"{link.planned_rate:.4f}): {100 * link.share:.1f} %{where}",
        "make the mission anew for the parameters of this vehicle, or plan with a lower "
        "vehicle.max_speed or vehicle.max_acceleration",
    )


@RULES.warning("link-path", _SOURCE)
def _path(context: ValidationContext) -> Iterator[Issue]:
    """The predicted path leaves the planned one by more than the plan's path_tolerance."""
    link = _there(context)
    if link is not None and link.path_error > link.path_tolerance + PATH_ALLOWANCE:
        yield Issue(
            None,
            f"the predicted path is up to {link.path_error:.1f} m from the planned one, "
            f"mission.path_tolerance is {link.path_tolerance:g} m",
            "use shorter legs or slower corners, or raise mission.path_tolerance if that is "
            "acceptable",
        )


@RULES.warning(
    "link-late",
    _SOURCE,
    summary=f"the predicted flight ends later than planned by more than {100 * LATE_SHARE:g} % and "
    f"{LATE:g} s: what the plan has at its end is not done in its time",
)
def _late(context: ValidationContext) -> Iterator[Issue]:
    link = _there(context)
    if link is not None:
        late = link.predicted_duration - link.planned_duration
        if late > max(LATE, LATE_SHARE * link.planned_duration):
            yield Issue(
                None,
                f"predicted {link.predicted_duration:.1f} s of flight, {late:.1f} s more than "
                f"planned; position at equal times {link.rms_position_error:.1f} m rms",
                "load the parameters that the mission was made for, or make it anew for this "
                "vehicle's",
            )


@RULES.warning(
    "link-apart",
    _SOURCE,
    summary=f"the predicted aircraft is more than {APART:g} m rms from where the plan has it at "
    "the time",
)
def _apart(context: ValidationContext) -> Iterator[Issue]:
    link = _there(context)
    if link is not None and link.rms_position_error > APART:
        yield Issue(
            None,
            f"at equal times the predicted aircraft is {link.rms_position_error:.1f} m rms from "
            f"the plan, at most {link.max_position_error:.1f} m",
            "plan with a lower vehicle.max_speed or vehicle.max_acceleration: near its greatest "
            "speed a vehicle cannot make up for what corners cost",
        )


@RULES.warning(
    "link-altitude",
    _SOURCE,
    summary=f"the predicted flight is more than {ALTITUDE_ERROR:g} m above or below the planned "
    "altitude",
)
def _altitude(context: ValidationContext) -> Iterator[Issue]:
    link = _there(context)
    if link is not None and link.altitude_error > ALTITUDE_ERROR:
        yield Issue(
            None,
            f"the predicted flight is up to {link.altitude_error:.0f} m above or below the plan's "
            "flight.altitude; the rate is that of the planned altitude",
            "set the items' altitude to flight.altitude, or plan for theirs",
        )


@RULES.note("link-timing", _SOURCE)
def _timing(context: ValidationContext) -> Iterator[Issue]:
    """Where the aircraft is predicted to be, beside where the plan has it at the same time."""
    link = _there(context)
    if link is not None:
        late = link.predicted_duration - link.planned_duration
        yield Issue(
            None,
            f"predicted {link.predicted_duration:.1f} s of flight ({late:+.1f} s against the "
            f"plan); position at equal times {link.rms_position_error:.1f} m rms, at most "
            f"{link.max_position_error:.1f} m; rate {100 * link.share:.1f} % of the plan",
            "",
        )
