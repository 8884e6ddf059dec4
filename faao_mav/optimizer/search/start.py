"""A first flight to start from."""

import numpy as np

from faao_mav.arrays import Real
from faao_mav.errors import InfeasibleError
from faao_mav.optimizer.kinematics import Kinematics, Trajectory


def straight_flight(kin: Kinematics) -> Trajectory:
    """Return a feasible flight: along the line from w_I to w_F at the most even speed.

    End velocities that do not lie on that line bend it; then it is the flight of least
    sum ||a||², and where the line is too slow for the least speed, one with detours. Raises
    `InfeasibleError` when there is none.
    """
    line = kin.end - kin.start
    distance = float(np.linalg.norm(line))
    ends = [v for v in (kin.start_velocity, kin.end_velocity) if v is not None]
    if distance:
        direction = line / distance
    else:
        direction = next((v / np.linalg.norm(v) for v in ends if v.any()), np.array([1.0, 0.0]))
    across = np.array([-direction[1], direction[0]])
    if all(abs(v @ across) <= 1e-12 * kin.max_speed for v in ends):
        speed = even_speed(kin, direction, distance)
        if speed is not None:
            v = speed[:, None] * direction
            a = np.vstack([np.diff(v, axis=0) / kin.time_step, np.zeros(2)])
            return kin.integrate(v[0], a)
    if kin.min_speed > 0:
        from faao_mav.optimizer.search.cruise import cruise

        return cruise(kin)
    return _gentlest_flight(kin)


def even_speed(kin: Kinematics, direction: Real, distance: float) -> Real | None:
    """Return speeds (N + 2,) along `direction` (2,) as near to one value as the limits allow.

    The flight is `distance` metres long. None where that is not possible.
    """
    lower, upper = _speed_limits(kin, direction)
    slack = 1e-9 * max(1.0, distance)
    if (lower > upper + 1e-12).any():
        return None
    if not _flown(kin, lower) - slack <= distance <= _flown(kin, upper) + slack:
        return None
    # the flown distance rises with the speed, in straight pieces between the limits
    share = np.full(kin.slots, kin.time_step)
    share[[0, -1]] /= 2
    limits = np.concatenate([lower, upper])
    order = np.argsort(limits)
    speeds = limits[order]
    rise = np.cumsum(np.concatenate([share, -share])[order])
    flown = share @ lower + np.concatenate([[0.0], np.cumsum(rise[:-1] * np.diff(speeds))])
    return np.asarray(np.clip(np.interp(distance, flown, speeds), lower, upper))


def fewest_slots(kin: Kinematics, direction: Real, distance: float) -> int | None:
    """Return the least number of slots in which a straight flight gets `distance` metres far.

    None if those of `kin` are too few. It speeds up as long as it can, then slows down: how far it
    gets in 2, 3, ... slots is known from the sums of both.
    """
    after = np.arange(kin.slots)
    slots = after[1:] + 1
    gain = kin.max_acceleration * kin.time_step
    rising, falling = np.full((2, kin.slots), kin.max_speed)
    split, possible = np.zeros_like(slots), np.ones(slots.shape, dtype=bool)
    if kin.end_velocity is not None:
        last = float(kin.end_velocity @ direction)
        falling = np.minimum(kin.max_speed, last + gain * after)
    if kin.start_velocity is not None:
        first = float(kin.start_velocity @ direction)
        if kin.bound_first_acceleration:
            rising = np.minimum(kin.max_speed, first + gain * after)
        rising[0] = first
        if kin.end_velocity is None:
            split = slots
        elif kin.bound_first_acceleration:
            split = np.floor(((slots - 1) + (last - first) / gain) / 2).astype(int) + 1
        else:
            split = (first <= falling[slots - 1]).astype(int)
        if kin.end_velocity is not None:
            possible = abs(first - last) <= gain * (slots - 1) + 1e-12
    split = np.clip(split, 0, slots)
    sums = (np.concatenate([[0.0], np.cumsum(speed)]) for speed in (rising, falling))
    up, down = sums
    ends = np.minimum(rising[0], falling[slots - 1]) + np.minimum(rising[slots - 1], falling[0])
    flown = kin.time_step * (up[split] + down[slots - split] - ends / 2)
    enough = np.flatnonzero(possible & (flown >= distance))
    return int(slots[enough[0]]) if enough.size else None


def _speed_limits(kin: Kinematics, direction: Real) -> tuple[Real, Real]:
    """The least and the greatest speed (N + 2,) that the ends and the limits allow."""
    n = np.arange(kin.slots, dtype=float)
    gain = kin.max_acceleration * kin.time_step
    upper = np.full(kin.slots, kin.max_speed)
    lower = np.full(kin.slots, kin.min_speed) if kin.min_speed > 0 else -upper
    if kin.start_velocity is not None:
        first = float(kin.start_velocity @ direction)
        steps = n + (0.0 if kin.bound_first_acceleration else np.where(n > 0, np.inf, 0.0))
        upper = np.minimum(upper, first + gain * steps)
        lower = np.maximum(lower, first - gain * steps)
    if kin.end_velocity is not None:
        last, steps = float(kin.end_velocity @ direction), n[::-1]
        upper = np.minimum(upper, last + gain * steps)
        lower = np.maximum(lower, last - gain * steps)
    return lower, upper


def _flown(kin: Kinematics, speed: Real) -> float:
    return float(kin.time_step * (speed[:-1] + speed[1:]).sum() / 2)


def _gentlest_flight(kin: Kinematics) -> Trajectory:
    import cvxpy as cp

    from faao_mav.optimizer.scaled import flight_variables, solve

    flight = flight_variables(kin)
    problem = cp.Problem(cp.Minimize(cp.sum_squares(flight.a)), flight.constraints)
    if solve(problem) == cp.INFEASIBLE:
        raise InfeasibleError(
            "no flight from start to end meets the end velocities within the duration, "
            f"{kin.max_speed:g} m/s and {kin.max_acceleration:g} m/s^2; "
            "give more time or gentler end velocities"
        )
    return flight.trajectory()
