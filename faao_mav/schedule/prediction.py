"""What the predicted flight of a mission delivers, against the plan."""

from dataclasses import dataclass

import numpy as np

from faao_mav.arrays import Integers, Real
from faao_mav.optimizer.solution import Rates, Solution
from faao_mav.radio.relay import Relayed
from faao_mav.schedule.schedule import deviation, positions_at


@dataclass(frozen=True, slots=True, eq=False)
class Prediction:
    """The relay flight as it is predicted, on the plan's clock.

    `w` (n, 2), m, is where the aircraft is in each of the plan's slots. `I_U` and `I_G` (n,) of
    (7), (8), bits, are what it gets there with the slot's precoders. `relayed` is what the relay
    makes of them, forwarding as fast as it can, in half duplex within the slot's planned share.
    `by_position` are R_U and R_G, and `delivered_by_position` the delivered rate, bit/s/Hz, if the
    radio takes precoders and share of the slot planned nearest to where it is instead.
    `duration`, s, is T plus by how much later than planned the aircraft comes to w_F, within
    the path tolerance and for good. Errors are metres, at equal times and of the path.
    """

    w: Real
    I_U: Real
    I_G: Real
    relayed: Relayed
    by_position: Rates
    delivered_by_position: float
    duration: float
    max_path_error: float
    max_position_error: float
    rms_position_error: float

    def __repr__(self) -> str:
        """Say what is delivered, and how near the plan the flight is, in a line."""
        near = f"{self.rms_position_error:.2g} m rms from the plan"
        return f"<Prediction: {self.delivered_rate:.4f} bit/s/Hz in {self.duration:.1f} s, {near}>"

    @property
    def rates(self) -> Rates:
        """R_U, R_G and R_avg of (9), (10), bit/s/Hz."""
        return Rates(float(self.I_U.mean()), float(self.I_G.mean()))

    @property
    def delivered_rate(self) -> float:
        """The delivered rate of the predicted flight, bit/s/Hz."""
        return self.relayed.rate


def price_flight(solution: Solution, t: Real, w: Real) -> Prediction:
    """Return what the channel of `solution` delivers along a flight.

    The aircraft is at `w` (k, 2), m, at the plan's times `t` (k,), s: 0 when the plan's first slot
    begins. They increase.
    """
    at = positions_at(solution.t, t, w)
    errors = deviation(solution.t, solution.w, t, w, solution.plan.mission.path_tolerance)
    I_U, I_G = rates_along(solution, at)
    nearest, shares = nearest_slots(solution, at), solution.shares
    other = np.flatnonzero(nearest != np.arange(len(at)))
    near_U, near_G = I_U.copy(), I_G.copy()
    near_U[other], near_G[other] = rates_along(solution, at, nearest, only=other)
    near_shares = shares[nearest] if shares is not None else None
    return Prediction(
        w=at,
        I_U=I_U,
        I_G=I_G,
        relayed=solution.relay(I_U, I_G, shares),
        by_position=Rates(float(np.mean(near_U)), float(np.mean(near_G))),
        delivered_by_position=solution.relay(near_U, near_G, near_shares).rate,
        duration=solution.plan.flight.duration + errors.late,
        max_path_error=errors.path,
        max_position_error=errors.max,
        rms_position_error=errors.rms,
    )


def rates_along(
    solution: Solution, w: Real, slots: Integers | None = None, *, only: Integers | None = None
) -> tuple[Real, Real]:
    """Return I_U (7) and I_G (8), bits, each (n,), where the aircraft is at `w` (n, 2) in slot n.

    Each slot keeps its fading; the line of sight and the path gain are those at `w`. The
    precoders are those of the same slot, or of `slots` (n,), as `nearest_slots` gives for a radio
    that goes by position. Precoders that know the draw of an averaged fading stay with the draw.
    With `only` (k,) they are the rates (k,) of those slots of the n alone.
    """
    at = np.arange(len(w)) if only is None else only
    of = at if slots is None else slots[at]
    I_U, I_G = (
        link.mean_rates(link.channel(w)[..., at, :, :], P[..., of, :, :])
        for link, P in zip(solution.problem.links, (solution.P_B, solution.P_U), strict=True)
    )
    return I_U, I_G


def nearest_slots(solution: Solution, w: Real) -> Integers:
    """Return for each of `w` (n, 2), m, the slot (n,) that is planned nearest to it.

    Of slots at one place, where the aircraft hovers, it is the first.
    """
    import shapely  # as in transit: only predictions need it

    places, first = np.unique(solution.w, axis=0, return_index=True)
    tree = shapely.STRtree(np.asarray(shapely.points(places)))
    _, nearest = tree.query_nearest(shapely.points(w), all_matches=False)
    return np.asarray(first[nearest])
