"""Plans too large are refused before the work: three caps on what a plan sums over and holds."""

from faao_mav.errors import PlanError
from faao_mav.plan import Plan
from faao_mav.radio.constellation import constellation, difference_vector_count

MAX_INPUTS = 4096
"""The most vectors of symbols that a station may send: 64-QAM on two antennas, QPSK on six.

Chosen: their differences, of which there are up to the square, fill gigabytes beyond."""

MAX_CHANNELS = 10**8
"""The most numbers in the channels of all slots and draws. Chosen: some 6 GB."""

MAX_TERMS = 8 * 10**11
"""The most terms of all sums over differences of vectors of symbols, with their derivatives.

Chosen: some ten minutes with QPSK on six antennas, 32 draws and 240 slots."""

_TABLE, _SEARCH = 1000, 2500
"""Sums for each draw in the table of a link's rate, and for each slot whose draw is known: about as
many as there are."""


def check_size(plan: Plan) -> None:
    """Raise `PlanError` where `plan` is beyond a cap; the error names its keys and the cap."""
    radio, slots = plan.radio, plan.flight.slots
    stations = radio.base_station, radio.relay, radio.ground_user
    base, relay, user = (each.antennas for each in stations)
    draws = radio.fading_samples if radio.fading == "ergodic" else 1
    sums = _SEARCH * slots if radio.fading == "realization" else draws * (_TABLE + slots)
    most = max(base, relay)
    inputs, differences = 1, 1
    if radio.rates is None:
        inputs = len(constellation(radio.modulation)) ** most
        differences = difference_vector_count(radio.modulation, most)
    for what, number, cap in (
        ("vectors of symbols", inputs, MAX_INPUTS),
        ("numbers in its channels", slots * draws * relay * (base + user), MAX_CHANNELS),
        ("terms in its sums", sums * differences * most**2, MAX_TERMS),
    ):
        if number > cap:
            many = f", {draws:,} draws (radio.fading_samples)" if draws > 1 else ""
            raise PlanError(
                f"{plan.source}: radio.modulation: {radio.modulation} with {base}, {relay} and "
                f"{user} antennas (radio.*.antennas) in {slots:,} slots{many} has {number:.4g} "
                f"{what}, at most {cap:,} are accepted; ask for fewer antennas or draws, a "
                "smaller alphabet or a longer flight.time_step"
            )
