"""The peer: CasADi + IPOPT (MUMPS, exact Hessian) on the problem of the direct method.

maximise t, t <= mean of each link's rates, under (11), (12), (13d)-(13f) as `Kinematics` has them,
and the half-planes of a fence where there is one; or with a relay's queue t = mean of what is
forwarded, with r, f, q and the shares as variables. Lengths in 100 m. The precoders enter through
numbers c of every slot alone: with H = sqrt(g) H_r every exponent of (7), (8) is D_k = g(w) c_k, so
that one model with c as its parameter serves all starts and all precoders.
"""

import time
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import casadi as ca
import numpy as np

from faao_mav.arrays import Complex, Real
from faao_mav.optimizer.design import Link
from faao_mav.optimizer.fence_geometry import FenceGeometry
from faao_mav.optimizer.interior.maximize import objective
from faao_mav.optimizer.kinematics import Kinematics, Trajectory
from faao_mav.optimizer.problem import Problem
from faao_mav.optimizer.rates.field import RateField
from faao_mav.optimizer.rates.table_rate import TableRate
from faao_mav.optimizer.search.starts import points_along, starts
from faao_mav.plan import Plan, read_plan
from faao_mav.radio.gain import PathGain
from faao_mav.radio.relay import RelayQueue

MISSIONS = Path(__file__).parents[1] / "missions"

EACH = {
    "power": tuple(f"radio.{end}.power_dbm" for end in ("base_station", "relay")),
    "antennas": tuple(f"radio.{end}.antennas" for end in ("base_station", "relay", "ground_user")),
}
"""Keys that stand for the same key of several ends."""

LENGTH = 100.0
TOLERANCE = 1e-7
PATIENCE = 60.0
"""Processor seconds that the peer may take for one start where the relay has a queue."""
ROUNDS, GAIN = 6, 1e-5
"""Alternation of IPOPT and best precoders: at most so many rounds, the least gain of R_avg."""


def sample(name: str, changes: Mapping[str, Any]) -> Plan:
    """Return a sample plan for the direct method with the values at some dotted keys replaced."""
    wide = {path: value for key, value in changes.items() for path in EACH.get(key, (key,))}
    return read_plan(MISSIONS / f"{name}.yaml").changed({"optimizer.method": "direct"} | wide)


@dataclass(frozen=True)
class ClassRate:
    """offset - factor log2(base + sum_k multiplicity_k e^(-g c_k)), one column of c per slot.

    (7), (8) with every class of differences, or the closed form of BPSK on two antennas, which is
    the rate at the best precoders: 2 - 2 log2(1 + e^-x).
    """

    link: Link
    offset: float
    factor: float
    base: float
    multiplicity: Real
    c: Real

    @property
    def gain(self) -> float:
        """g at the foot of the station: c times it is of the order of one to a hundred."""
        assert isinstance(self.link.gains.law, PathGain)
        return self.link.gains.law.reference_gain / self.link.gains.height**2


@dataclass(frozen=True)
class Curve:
    """A rate that depends on the distance alone: a cubic B-spline through values of our own."""

    link: Link
    value: Any
    c: Real
    gain: float = 1.0


def peer_starts(problem: Problem, random: int) -> dict[str, Trajectory]:
    """The flights that the peer starts from: by way of the stations, and of random places.

    A plan that names its own starts is taken at its word. Where the time is too short for a flight
    by way of the stations, the start is the way itself at an even speed: IPOPT's iterates need not
    be feasible.
    """
    named = problem.plan.optimizer.starts
    names: list[str] = (
        ["straight", "bs", "user", "bs-user", "user-bs"] if "global" in named else [*named]
    )
    places = {"bs": problem.bs_uav.gains.midway, "user": problem.uav_user.gains.midway}
    rng, kin = np.random.default_rng(0), problem.kinematics
    corners = np.stack([*places.values(), kin.start, kin.end])
    low, high = corners.min(axis=0) - 50, corners.max(axis=0) + 50
    for k in range(random if named != ("straight",) else 0):
        places |= {f"a{k}": rng.uniform(low, high), f"b{k}": rng.uniform(low, high)}
        names.append(f"a{k}-b{k}")
    found = starts(kin, names, places)
    for name in names:
        if name not in found and name in {"bs", "user", "bs-user", "user-bs"}:
            found[name] = _hurried(kin, [places[key] for key in name.split("-")])
    return {name: found[name] for name in names if name in found}


def _hurried(kin: Kinematics, stops: Sequence[Real]) -> Trajectory:
    """The way by `stops` at an even speed, whatever its limit is."""
    w = points_along(np.vstack([kin.start, *stops, kin.end]), np.linspace(0, 1, kin.slots))
    v = np.gradient(w, kin.time_step, axis=0)
    a = np.vstack([np.diff(v, axis=0) / kin.time_step, np.zeros(2)])
    return Trajectory(w, v, a)


def at_distance(link: Link, rate: Any, number: int, w: Real) -> ClassRate | Curve:
    """The curve of `rate` over the logarithm of the path gain, or the closed form at w."""
    if not (isinstance(rate, TableRate) and rate.kind == "curve"):
        return at_best(link, w)
    grid = rate.table.spline.x - np.log(link.power / link.noise)
    spline = ca.interpolant(f"rate{number}", "bspline", [grid], rate.value(grid, 0 * grid))
    return Curve(link, spline, np.zeros((1, 1)))


def at_precoders(link: Link, w: Real, P: Complex) -> ClassRate:
    """The rate at fixed precoders P that are best, or were chosen, at the positions w.

    Where the line of sight turns with the UAV the precoders' phases turn with it (without
    scattering the rate at P then depends on the distance alone): better for the peer than
    precoders that point where the UAV was.
    """
    assert not link.follows_position or link.nlos is None
    classes = link.classes
    z = link.small_scale(w) @ P @ classes.vectors.T / (2 * np.sqrt(link.noise))
    c = np.sum(np.abs(z) ** 2, axis=1).T
    return ClassRate(link, 2 * classes.bits, 1.0, classes.symbols, classes.multiplicity, c)


def at_best(link: Link, w: Real) -> ClassRate:
    """The rate at the best precoders in closed form: BPSK, two antennas."""
    assert not link.follows_position or link.nlos is None
    strongest = np.linalg.svd(link.small_scale(w), compute_uv=False)[:, 0]
    x = np.asarray(link.power * strongest**2 / (2 * link.noise), dtype=np.float64)
    return ClassRate(link, 2.0, 2.0, 1.0, np.ones(1), x[None, :])


def _rate(rate: ClassRate | Curve, w: Any, c: Any) -> Any:
    """The rate (1, n) at scaled positions w (2, n), c (k, n) in units of 1 / `gain`."""
    p, H = np.reshape(rate.link.gains.station.T, (2, -1)) / LENGTH, rate.link.gains.height / LENGTH
    away = (ca.DM(w) if isinstance(w, np.ndarray) else w) - p
    law, squared = rate.link.gains.law, ca.sum1(away**2) + H**2
    assert isinstance(law, PathGain)
    s = H / ca.sqrt(squared)
    terms = sum(c * s**k for k, c in enumerate(law.elevation_db, 1)) * np.log(10) / 10
    gain_log = terms - law.exponent / 2 * ca.log(squared * LENGTH**2)
    if isinstance(rate, Curve):
        return rate.value(gain_log + np.log(law.reference_gain))
    D = ca.repmat(ca.exp(gain_log) * rate.link.gains.height**2, c.shape[0], 1) * c
    total = rate.base + ca.mtimes(ca.DM(rate.multiplicity).T, ca.exp(-D))
    return rate.offset - rate.factor * ca.log(total) / np.log(2.0)


def _apart(fence: FenceGeometry, kin: Kinematics, w: Any, angle: Any) -> list[Any]:
    """What is at most 0 where every chord keeps margin and bulge, w (2, n) scaled.

    One angle (P, n - 1) per obstacle and interval is a variable: half-planes part both ends of the
    chord from all corners.
    """
    room = fence.room(kin) / LENGTH
    east, north, parts = ca.cos(angle), ca.sin(angle), []
    for k, (corners, radius) in enumerate(
        zip(fence.obstacles.corners / LENGTH, fence.obstacles.radius / LENGTH, strict=True)
    ):
        for corner in np.unique(corners, axis=0):
            for end in (w[:, :-1], w[:, 1:]):
                along = east[k, :] * (end[0, :] - corner[0]) + north[k, :] * (end[1, :] - corner[1])
                parts.append(radius + ca.DM(room).T - along)
    for normal, offset in zip(fence.normals, fence.offsets / LENGTH, strict=True):
        parts.append(normal[0] * w[0, 1:-1] + normal[1] * w[1, 1:-1] - offset + ca.DM(room[1:]).T)
    return parts


class Model:
    """The nonlinear program for given kinematics and kinds of rates, built once."""

    def __init__(
        self,
        kin: Kinematics,
        rates: Sequence[ClassRate | Curve],
        max_seconds: float,
        relay: RelayQueue | None = None,
        fence: FenceGeometry | None = None,
    ) -> None:
        self.kin, n = kin, kin.slots
        self.relay, self.fence = relay, fence
        dt, speed = kin.time_step, kin.max_speed
        # v in v_max, a in a_max, w in LENGTH
        step = dt * speed / LENGTH
        bend = dt**2 * kin.max_acceleration / LENGTH
        turn = dt * kin.max_acceleration / speed
        cls: Any = ca.MX if any(isinstance(rate, Curve) for rate in rates) else ca.SX
        w, v, a = cls.sym("w", 2, n), cls.sym("v", 2, n), cls.sym("a", 2, n - 1)
        t = cls.sym("t")
        position = w[:, 1:] - w[:, :-1] - step * v[:, :-1] - bend / 2 * a
        velocity = v[:, 1:] - v[:, :-1] - turn * a
        speeds = ca.sum1(v**2)
        bounded = ca.sum1(a[:, kin.first_bounded_acceleration :] ** 2)
        parameters, each = [], []
        for number, rate in enumerate(rates):
            c = cls.sym(f"c{number}", *rate.c.shape)
            parameters.append(ca.vec(c))
            each.append(_rate(rate, w, c))
        variables = [ca.vec(w), ca.vec(v), ca.vec(a), t]
        if relay is None:
            below = [t - ca.sum2(rate) / n for rate in each]
        else:
            r, f, q, x = (cls.sym(name, 1, n) for name in "rfqx")
            variables += [ca.vec(part) for part in (r, f, q, x)]
            share = 1 - x if relay.half else x
            moved = q[1:] - q[:-1] - r[:-1] + f[:-1]
            parts = [t - ca.sum2(f) / n, r - x * each[0], f - share * each[1], f - q, moved, -moved]
            below = [ca.vec(part) for part in parts]
        if fence is not None:
            angle = cls.sym("angle", len(fence.obstacles), n - 1)
            variables.append(ca.vec(angle))
            below += [ca.vec(part) for part in _apart(fence, kin, w, angle)]
        g = [ca.vec(position), ca.vec(velocity), ca.vec(speeds), ca.vec(bounded), *below]
        sizes = [int(part.numel()) for part in g]
        self.lower_g = np.concatenate(
            [np.zeros(sizes[0] + sizes[1]), np.full(sum(sizes[2:]), -np.inf)]
        )
        self.upper_g = np.concatenate(
            [np.zeros(sizes[0] + sizes[1]), np.ones(sizes[2] + sizes[3]), np.zeros(sum(sizes[4:]))]
        )
        lower_w, upper_w = np.full((n, 2), -np.inf), np.full((n, 2), np.inf)
        lower_v, upper_v = lower_w.copy(), upper_w.copy()
        for least, most, at, value in (
            (lower_w, upper_w, 0, kin.start / LENGTH),
            (lower_w, upper_w, -1, kin.end / LENGTH),
            (lower_v, upper_v, 0, kin.start_velocity),
            (lower_v, upper_v, -1, kin.end_velocity),
        ):
            if value is not None:
                least[at] = most[at] = value if least is lower_w else value / speed
        free = np.full(2 * (n - 1) + 1, np.inf)
        lower = [lower_w.ravel(), lower_v.ravel(), -free]
        upper = [upper_w.ravel(), upper_v.ravel(), free]
        if relay is not None:
            room = np.full(n, relay.buffer / kin.time_step)
            room[0] = 0
            lower += [np.zeros(3 * n), np.full(n, 0.0 if relay.half else 1.0)]
            upper += [np.full(2 * n, np.inf), room, np.ones(n)]
        if fence is not None:
            turns = np.full(len(fence.obstacles) * (n - 1), np.inf)
            lower, upper = [*lower, -turns], [*upper, turns]
        self.lower, self.upper = np.concatenate(lower), np.concatenate(upper)
        options: dict[str, Any] = {
            "print_time": False,
            "ipopt": {
                "print_level": 0,
                "sb": "yes",
                "tol": TOLERANCE,
                "max_iter": 1000,
                "max_cpu_time": max_seconds,
                "linear_solver": "mumps",
            },
        }
        program: dict[str, Any] = {
            "x": ca.vertcat(*variables),
            "p": ca.vertcat(*parameters),
            "f": -t,
            "g": ca.vertcat(*g),
        }
        self.solver: Any = ca.nlpsol("peer", "ipopt", program, options)

    def solve(self, rates: Sequence[ClassRate | Curve], start: Trajectory) -> Trajectory:
        """Return where IPOPT ends from `start`."""
        kin, n = self.kin, self.kin.slots
        now = [np.ravel(ca.DM(_rate(r, start.w.T / LENGTH, r.c * r.gain)).full()) for r in rates]
        least, more = min(float(np.mean(each)) for each in now), []
        if self.relay is not None:
            shares = self.relay.best_shares(now[0], now[1], kin.time_step)
            relayed = self.relay.relayed(now[0], now[1], kin.time_step, shares)
            least = relayed.rate
            more = [relayed.received, relayed.forwarded, relayed.queue]
            more.append(np.ones(n) if shares is None else shares)
        if self.fence is not None and len(self.fence.obstacles):
            ends = start.w.T
            u, _ = self.fence.obstacles.separation(ends[:, :-1], ends[:, 1:])
            more.append(np.arctan2(u[1], u[0]).ravel(order="F"))
        x0 = np.concatenate(
            [
                (start.w / LENGTH).ravel(),
                (start.v / kin.max_speed).ravel(),
                (start.a[:-1] / kin.max_acceleration).ravel(),
                [least],
                *more,
            ]
        )
        found = self.solver(
            x0=x0,
            p=np.concatenate([r.c.ravel(order="F") * r.gain for r in rates]),
            lbx=self.lower,
            ubx=self.upper,
            lbg=self.lower_g,
            ubg=self.upper_g,
        )
        x = np.asarray(found["x"]).ravel()
        w, v = (part.reshape(n, 2) for part in np.split(x[: 4 * n], 2))
        a = x[4 * n : 6 * n - 2].reshape(n - 1, 2)
        return Trajectory(
            w * LENGTH, v * kin.max_speed, np.vstack([a * kin.max_acceleration, np.zeros(2)])
        )


def delivered(
    problem: Problem, field: RateField, flights: Iterable[Trajectory], kept: float
) -> tuple[list[float], list[float]]:
    """Return what IPOPT delivers from each start, 0 beyond `kept` of a limit, and its seconds."""
    kin, relay, fence = problem.kinematics, problem.relay, problem.fence
    model, reached, seconds = None, [], []
    for flight in flights:
        began = time.process_time()
        both = enumerate(zip(field.links, field.rates, strict=True))
        rates = [at_distance(link, rate, k, flight.w) for k, (link, rate) in both]
        model = model or Model(kin, rates, PATIENCE, relay, fence)
        found = model.solve(rates, flight)
        seconds.append(time.process_time() - began)
        beyond = [*kin.residuals(found).values()]
        beyond += [] if fence is None else [fence.margin - fence.clearance(found, kin.time_step)]
        sound = max(beyond) < kept
        reached.append(objective(field.value(found.w.T), kin, relay) if sound else 0.0)
    return reached, seconds
