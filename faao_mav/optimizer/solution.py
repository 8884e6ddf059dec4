"""What an optimiser tells and returns, and how a solution is checked, saved and loaded."""

import io
import json
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from faao_mav.arrays import Complex, Integers, Real
from faao_mav.errors import InputError, quote
from faao_mav.files import read_archive, write_whole
from faao_mav.optimizer.design import Link, check_power, largest_power
from faao_mav.optimizer.kinematics import Trajectory
from faao_mav.optimizer.problem import Problem, build_problem
from faao_mav.plan import Plan, parse_plan
from faao_mav.power import JOULES_PER_WH
from faao_mav.radio.relay import Relayed

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@dataclass(frozen=True, slots=True)
class Progress:
    """Where an optimiser stands: R_avg of the best iterate so far, and what runs now."""

    iteration: int
    max_iterations: int
    stage: str
    best_rate: float


Observer = Callable[[Progress], None]
"""What an optimiser tells its progress to."""


def staged(observe: Observer | None, told: str) -> Observer:
    """Return an observer that tells `observe` the progress, of stages that begin with `told`."""

    def tell(now: Progress) -> None:
        if observe is not None:
            observe(replace(now, stage=f"{told}: {now.stage}"))

    return tell


@dataclass(frozen=True, slots=True)
class Rates:
    """R_U, R_G of (10) and R_avg of (9), bit/s/Hz."""

    R_U: float
    R_G: float

    @classmethod
    def of(cls, I_U: Real, I_G: Real) -> "Rates":
        """Return the means of the rates of slots (n,): with T = (N + 2) delta_t that is (10)."""
        return cls(float(I_U.mean()), float(I_G.mean()))

    @property
    def R_avg(self) -> float:
        """min(R_U, R_G), (9)."""
        return min(self.R_U, self.R_G)


@dataclass(frozen=True, slots=True)
class Least:
    """How the duration, power or energy of a `goal` was found, which the solution has.

    `limit` is what the plan allowed: s (for the most data too), the base station's dBm, or the Wh
    of the whole duration. `below` is the best solution with one step of the grid less, None where
    there is no flight, and `optimizations` how many flights were optimised.
    """

    limit: float
    below: "Solution | None"
    optimizations: int


@dataclass(frozen=True)
class BestHeight:
    """What a choice of heights brought: they are `least` to `most`, m, of which so many were tried.

    `at_least` and `at_most` are the solutions at both ends, None without a flight there.
    """

    least: float
    most: float
    at_least: "Solution | None"
    at_most: "Solution | None"
    tried: int


@dataclass(frozen=True)
class Solution:
    '''A solved plan: SI units, local east-north metres, one row per time slot.

    `problem` is what was solved, the limit on the energy with it; `t` (n,) s; `w`, `v`, `a` (n, 2);
    `P_B` (n, N_t, N_t) and `P_U` (n, N_u, N_u) in sqrt(W); the fading `H_rB` (n, N_u, N_t) and
    `H_rU` (n, N_r, N_u) without path gain; `I_U`, `I_G` (n,) of (7), (8) in bits; `history` the
    rate that is maximised (R_del, or R_avg where the plan is not causal) of the start and after
    each iteration.
    Fading that is averaged over has a leading axis of draws, and so have precoders that know it.
    `converged` tells whether the method's own stopping rule ended it, `ending` in words what did;
    `starts` what each start of the direct method led to, bit/s/Hz, which is rough for
    those that were not followed to the end. `shares` (n,) of each slot are those in which a
    half-duplex relay receives; it sends in the rest. All rates are those that the plan counts,
    `optimizer.rate`: cutoff rates, or for a plan for the mutual information (5), (6), and `gain` is
    by how much the rate that it maximises is above that of the plan for the cutoff rate. `least`
    tells of a plan whose `goal` minimises, `height` of one that leaves it open; these two and the
    limit on the energy are not saved.

    >>> from faao_mav import optimize, parse_plan
    >>> solution = optimize(parse_plan("""
    ... site: {origin: {latitude: -35.36, longitude: 149.17, elevation: 584}}
    ... vehicle: {max_speed: 20, max_acceleration: 5}
    ... flight: {start: [0, 50], end: [50, 0], altitude: 40, duration: 10, time_step: 0.5}
    ... radio:
    ...   fading: none
    ...   base_station: {position: [0, 0], power_dbm: 0}
    ...   relay: {power_dbm: 0, noise_dbm: -80}
    ...   ground_user: {position: [60, 60], noise_dbm: -80}
    ... """))
    >>> round(solution.delivered_rate, 3), solution.is_feasible(1e-6)
    (0.602, True)
    '''

    problem: Problem
    t: Real
    w: Real
    v: Real
    a: Real
    P_B: Complex
    P_U: Complex
    H_rB: Complex
    H_rU: Complex
    I_U: Real
    I_G: Real
    history: Real
    converged: bool
    ending: str
    starts: Mapping[str, float] = field(default_factory=dict)
    shares: Real | None = None
    gain: float | None = None
    least: Least | None = None
    height: BestHeight | None = None

    def __repr__(self) -> str:
        """Say what was solved and found, in a line."""
        ending = "converged" if self.converged else "not converged"
        found = f"delivers {self.delivered_rate:.4f} bit/s/Hz, R_avg {self.rates.R_avg:.4f}"
        return f"<Solution of {self.plan.name!r}: {len(self.t)} slots, {found}, {ending}>"

    def plot(self) -> "Figure":
        """Return the flight in one figure of matplotlib: map, speed, and both rates."""
        from faao_mav import flight_figure

        return flight_figure(self)

    def plot_route(self) -> "Figure":
        """Return the map of the route as a figure of matplotlib."""
        from faao_mav import route_figure

        return route_figure(self)

    @property
    def plan(self) -> Plan:
        """The plan that was solved."""
        return self.problem.plan

    @property
    def rates(self) -> Rates:
        """R_U, R_G and R_avg."""
        return Rates.of(self.I_U, self.I_G)

    @property
    def hops(self) -> Iterator[tuple[Link, Complex, Complex]]:
        """Both links, each with its fading H_r and its precoders."""
        yield self.problem.bs_uav, self.H_rB, self.P_B
        yield self.problem.uav_user, self.H_rU, self.P_U

    @cached_property
    def relayed(self) -> Relayed:
        """What the relay receives, forwards and holds, by the plan's duplex and buffer."""
        return self.relay(self.I_U, self.I_G, self.shares)

    def relay(self, I_U: Real, I_G: Real, shares: Real | None = None) -> Relayed:
        """Return what the plan's relay makes of rates (n,), bits, with these or the best shares."""
        return self.problem.relay.relayed(I_U, I_G, self.plan.flight.time_step, shares)

    @property
    def delivered_rate(self) -> float:
        """The delivered rate R_del, the mean of what is forwarded, bit/s/Hz; at most R_avg."""
        return self.relayed.rate

    @property
    def maximised(self) -> float:
        """What the plan maximises, bit/s/Hz: R_del, or R_avg where it is not causal."""
        return self.delivered_rate if self.plan.radio.causal else self.rates.R_avg

    @cached_property
    def steps(self) -> tuple[Integers, Integers] | None:
        """Which of the radio's own rates the hops have in each slot, (n,): 1 is the lowest, 0 none.

        Where the fading is averaged over it is that of the mean SNR. None without `radio.rates`.
        """
        found = []
        for link, H_r, P in self.hops:
            if link.steps is None:
                return None
            snr = link.snr(link.channel(self.w, H_r), P)
            found.append(link.steps.number(snr.mean(axis=0) if link.averaged else snr))
        return found[0], found[1]

    @property
    def energy_wh(self) -> float | None:
        """The energy of the planned flight and its relay, Wh; None without `vehicle.power`."""
        energy = self.problem.energy_of(self.trajectory)
        return None if energy is None else energy / JOULES_PER_WH

    @property
    def iterations(self) -> int:
        """Iterations that were completed."""
        return len(self.history) - 1

    @property
    def trajectory(self) -> Trajectory:
        """w, v and a."""
        return Trajectory(self.w, self.v, self.a)

    def clearance(self) -> float | None:
        """Return the least distance of the continuous path from the fence, m; None without one."""
        fence = self.problem.fence
        return None if fence is None else fence.clearance(self.trajectory, float(self.t[1]))

    def recomputed_slots(self, power: float = 1.0) -> tuple[Real, Real]:
        """Return I_U, I_G from w, the fading and the precoders alone, all powers times `power`."""
        scale = np.sqrt(power)
        first, second = (
            link.mean_rates(link.channel(self.w, H_r), scale * P) for link, H_r, P in self.hops
        )
        return first, second

    def residuals(self) -> dict[str, float]:
        """Return by how much each constraint of (13) is missed, computed from the arrays alone.

        Metres, m/s, m/s²; `fence` is by how much the continuous path misses the margin; the power
        limits (13b), (13c) relative to W, and `energy` to its limit; the fading relative to what
        the plan's seed draws at w; the rates of the slots in bits. 0 where a constraint holds.
        """
        problem, clearance = self.problem, self.clearance()
        found = problem.kinematics.residuals(self.trajectory)
        for limit in problem.energy_limits(problem.kinematics):
            found["energy"] = limit.excess(problem.kinematics, self.trajectory)
        if problem.fence is not None and clearance is not None:
            found["fence"] = max(0.0, problem.fence.margin - clearance)
        powers = "(13b) power of the base station", "(13c) power of the relay"
        for hop, (link, H_r, P) in enumerate(self.hops):
            found[powers[hop]] = max(0.0, largest_power(P) / link.power - 1)
            found[f"({hop + 1}) fading"] = float(np.abs(H_r - link.small_scale(self.w)).max())
        told = np.array([self.I_U, self.I_G])
        found["(9) rate"] = float(np.abs(np.array(self.recomputed_slots()) - told).max())
        return found

    def is_feasible(self, tolerance: float = 1e-6) -> bool:
        """Tell whether every one of the `residuals` is below `tolerance`, each in its own unit."""
        return max(self.residuals().values()) < tolerance


def make_solution(
    problem: Problem,
    flight: Trajectory,
    precoders: Sequence[Complex],
    history: list[float],
    *,
    converged: bool,
    ending: str,
    rates: Real | None = None,
) -> Solution:
    """Put an iterate together with its fading and rates: those given (2, n), or computed."""
    I_U, I_G = problem.rates(flight.w, precoders) if rates is None else rates
    return Solution(
        problem=problem,
        t=problem.kinematics.time_step * np.arange(len(flight.w), dtype=np.float64),
        w=flight.w,
        v=flight.v,
        a=flight.a,
        P_B=precoders[0],
        P_U=precoders[1],
        H_rB=problem.bs_uav.small_scale(flight.w),
        H_rU=problem.uav_user.small_scale(flight.w),
        I_U=I_U,
        I_G=I_G,
        history=np.array(history),
        converged=converged,
        ending=ending,
        shares=problem.relay.best_shares(I_U, I_G, problem.kinematics.time_step),
    )


_ARRAYS = ("t", "w", "v", "a", "P_B", "P_U", "H_rB", "H_rU", "I_U", "I_G", "history")
_HUGE = 1e100  # what their numbers stay below, so that squares are finite


def save_solution(
    solution: Solution, path: str | Path, extra: Mapping[str, Real] | None = None
) -> None:
    """Write `solution` to the NumPy archive `path` (.npz), whole or not at all.

    Keys: the arrays of `Solution` by name, those of its `relayed`, `R_avg`, `R_U`, `R_G`, `R_del`,
    `converged`, `ending`, `starts` (JSON text), `gain` if there is one and `plan`, the YAML text;
    and the arrays `extra`, which `load_solution` leaves alone. The same solution gives the same
    bytes.

    >>> from tempfile import TemporaryDirectory
    >>> from faao_mav import load_solution, optimize, read_plan
    >>> solution = optimize(read_plan("missions/copter_relay.yaml"))
    >>> with TemporaryDirectory() as folder:
    ...     save_solution(solution, Path(folder) / "flight.npz")
    ...     loaded = load_solution(Path(folder) / "flight.npz")
    >>> bool(np.all(loaded.w == solution.w))
    True
    """
    values: dict[str, Any] = {}
    for source, names in (
        (solution, (*_ARRAYS, "shares", "gain", "converged", "ending")),
        (solution.rates, ("R_avg", "R_U", "R_G")),
        (solution.relayed, ("received", "forwarded", "queue")),
    ):
        values |= {name: getattr(source, name) for name in names}
    values |= {"R_del": solution.delivered_rate, "starts": json.dumps(dict(solution.starts))}
    values |= {"plan": solution.plan.text} | dict(extra or {})
    buffer = io.BytesIO()
    np.savez(buffer, **{name: value for name, value in values.items() if value is not None})
    write_whole(path, buffer.getvalue())


def load_solution(path: str | Path) -> Solution:
    """Read what `save_solution` wrote. Raises `InputError` for anything else.

    >>> load_solution("README.md")  # doctest: +ELLIPSIS
    Traceback (most recent call last):
        ...
    faao_mav.errors.InputError: README.md: ...
    """
    from pydantic import TypeAdapter, ValidationError

    required = ("plan", "ending", "starts", "converged", *_ARRAYS)
    found = read_archive(path, (*required, "shares", "gain"), "a result of faao-mission --save")
    for name in required:
        if name not in found:
            raise InputError(f"{path}: not a result of faao-mission --save: {name} is missing")
    _check(found["plan"], "U", (), f"{path}: plan")
    plan = parse_plan(str(found["plan"]), f"{path} (plan)")
    for name, (kinds, shape) in _expected(plan, found["history"].size).items():
        if name in found:
            _check(found[name], kinds, shape, f"{path}: {name}")
    shares = found.get("shares")
    if shares is not None and not ((shares >= 0) & (shares <= 1)).all():
        raise InputError(f"{path}: shares: expected a number of 0 to 1 per slot")
    try:
        starts = TypeAdapter(dict[str, float]).validate_json(str(found["starts"]), strict=True)
    except ValidationError:
        said = quote(str(found["starts"]))
        raise InputError(f"{path}: starts: {said}; expected rates by start") from None
    arrays: dict[str, Any] = {name: found[name] for name in _ARRAYS}
    problem = build_problem(plan)
    slots = plan.flight.time_step * np.arange(plan.flight.slots)
    if not np.allclose(arrays["t"], slots, rtol=0, atol=1e-6):
        raise InputError(f"{path}: t: expected the times of the slots of the plan in the file")
    for name, link in (("P_B", problem.bs_uav), ("P_U", problem.uav_user)):
        check_power(arrays[name], link.power, f"{path}: {name}")
    return Solution(
        problem=problem,
        converged=bool(found["converged"]),
        ending=str(found["ending"]),
        starts=starts,
        shares=shares,
        gain=float(found["gain"]) if "gain" in found else None,
        **arrays,
    )


def _expected(plan: Plan, steps: int) -> dict[str, tuple[str, tuple[int, ...]]]:
    """Return kinds (NumPy's letters) and shape of each array of a solution of `plan`.

    `steps` are the entries of the history, of which there is one or more.
    """
    n, radio = plan.flight.slots, plan.radio
    base, relay, user = (
        station.antennas for station in (radio.base_station, radio.relay, radio.ground_user)
    )
    draws = (radio.fading_samples,) if radio.fading == "ergodic" else ()
    known = draws if radio.csi == "instantaneous" else ()
    return {
        **dict.fromkeys(("ending", "starts"), ("U", ())),
        "converged": ("b", ()),
        "gain": ("f", ()),
        "history": ("f", (max(1, steps),)),
        **dict.fromkeys(("t", "I_U", "I_G", "shares"), ("f", (n,))),
        **dict.fromkeys(("w", "v", "a"), ("f", (n, 2))),
        "P_B": ("fc", (*known, n, base, base)),
        "P_U": ("fc", (*known, n, relay, relay)),
        "H_rB": ("fc", (*draws, n, relay, base)),
        "H_rU": ("fc", (*draws, n, user, relay)),
    }


def _check(array: "np.ndarray[Any, Any]", kinds: str, shape: tuple[int, ...], where: str) -> None:
    """Raise `InputError` unless `array` is of one of the `kinds`, in `shape`, and below `_HUGE`."""
    if array.dtype.kind not in kinds or array.shape != shape:
        numbers = f"numbers {shape}, as the plan in the file has them"
        expected = "text" if kinds == "U" else numbers
        raise InputError(f"{where}: {array.dtype} {array.shape}; expected {expected}")
    if kinds != "U" and not (np.abs(array) < _HUGE).all():
        raise InputError(f"{where}: expected finite numbers below {_HUGE:g}")
