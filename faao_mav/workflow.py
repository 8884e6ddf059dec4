"""The whole way from a plan to a mission: optimise, convert, predict, check, price, write.

The command line, the reports, the studies and Python users all call `plan_mission`.
"""

import time
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, Unpack

from faao_mav.autopilot import autopilots
from faao_mav.autopilot.files import parameter_path, plan_target
from faao_mav.errors import FaaoError, InputError, counted
from faao_mav.files import check_writable, write_together
from faao_mav.mission.formats import (
    check_replaceable,
    comment_for,
    fence_path,
    remove_outdated,
    render_files,
)
from faao_mav.mission.formats.parameter_file import render_parameters
from faao_mav.optimizer.pricing import (
    FreshRates,
    MutualInformation,
    Saturation,
    fresh_rates,
    price,
    saturation,
)
from faao_mav.optimizer.problem import OwnParts
from faao_mav.optimizer.shadowing import Shadowed, shadowed, worth
from faao_mav.optimizer.solution import Observer, Progress, Rates, Solution
from faao_mav.plan import Plan
from faao_mav.plan.fields import dbm
from faao_mav.schedule.conversion import Conversion, beyond_vehicle, check_vehicle, convert
from faao_mav.schedule.prediction import Prediction
from faao_mav.validate import Check, Finding, Level, Limits, check
from faao_mav.validate.flown import Debriefing

if TYPE_CHECKING:
    from faao_mav.optimizer.search.bound import Bound


@dataclass(frozen=True, slots=True, eq=False)
class Result:
    """What a plan led to.

    `solution` is the optimised flight. `conversion` is its mission with the autopilot parameters
    that the mission is timed for, `prediction` what the predicted flight of that mission delivers,
    `check` what validation says of it. Where no mission can be made these three are None and
    `no_mission` says why.

    `information` is the mutual information along the solution, bit/s/Hz; `fresh` the rates on
    fading that was not planned on, None unless the plan averages over fading; `saturation` says
    whether the alphabet limits the rate, `bound` estimates what no route can exceed, if asked for;
    `shadowed` tells what arrives under shadowing, where its spread is known.
    `seconds_optimize` is the time of the optimiser, `seconds_total` that of everything, in seconds.

    >>> from faao_mav import plan_mission, read_plan
    >>> result = plan_mission(read_plan("missions/copter_relay.yaml"))
    >>> result.flyable, result.as_dict()["delivered_rate"] == result.solution.delivered_rate
    (True, True)
    """

    solution: Solution
    information: MutualInformation | None = None
    fresh: FreshRates | None = None
    saturation: Saturation | None = None
    bound: "Bound | None" = None
    shadowed: Shadowed | None = None
    conversion: Conversion | None = None
    prediction: Prediction | None = None
    check: Check | None = None
    no_mission: FaaoError | None = None
    seconds_optimize: float = 0.0
    seconds_total: float = 0.0

    def __repr__(self) -> str:
        """Say what the plan led to, in a line."""
        made = str(self.no_mission or "no mission asked for")
        if self.conversion is not None:
            errors = sum(finding.level is Level.ERROR for finding in self.findings)
            items = counted(len(self.conversion.mission.items), "item")
            made = f"a mission of {items}, {counted(errors, 'error')}"
        delivers = f"delivers {self.solution.delivered_rate:.4f} bit/s/Hz"
        return f"<Result of {self.solution.plan.name!r}: {delivers}, {made}>"

    @property
    def findings(self) -> tuple[Finding, ...]:
        """What validation found in the mission; nothing where there is no mission."""
        return self.check.findings if self.check is not None else ()

    @property
    def fence(self) -> dict[str, Any] | None:
        """How near flights come to the edge of the plan's fence, as in `--json`; None without one.

        `zones` say of each of the `areas` whether it is one to stay in or out of, with its name;
        `notes` what of the fence's file was passed over. `margin` is what the plan is to keep,
        `planned_clearance` what it keeps, `predicted_clearance` what the whole predicted flight
        keeps, None without one: m, below 0 outside.
        """
        plan, area = self.solution.plan, self.solution.plan.keep_in
        if area is None or plan.fence is None:
            return None
        track = self.check.track if self.check is not None else None
        return {
            "areas": len(plan.zones),
            "zones": [zone.name for zone in plan.zones],
            "notes": list(plan.geofence.notes),
            "margin": plan.fence.margin,
            "planned_clearance": area.clearance(self.solution.w),
            "predicted_clearance": area.clearance(track.position[:, :2]) if track else None,
        }

    @property
    def flyable(self) -> bool:
        """Whether there is a mission without errors, of a plan that is not beyond its vehicle."""
        errors = any(finding.level is Level.ERROR for finding in self.findings)
        return self.conversion is not None and not errors and not beyond_vehicle(self.solution.plan)

    def write(self, path: str | Path) -> tuple[Path, ...]:
        """Write the mission to the file `path`, its parameters and its fence to files beside it.

        All are written or none; their paths are returned, that of the mission first. The ending of
        `path` tells the mission's format: see `faao_mav.mission.formats`. A mission that needs no
        parameters has no file of them, and a format that holds the fence no file of that. Files
        there that an earlier run wrote and that are not this mission's are removed: validation and
        ground stations would take them for its own.
        Raises the error that stood in the way of a mission, if there is none, and `InputError`
        where a file cannot be written or removed.
        """
        conversion, plan = self.conversion, self.solution.plan
        if conversion is None:
            raise self.no_mission or InputError("there is no mission: the plan was only optimised")
        mission, *beside = mission_files(path, plan)
        target = plan_target(conversion.vehicle)
        contents = render_files(conversion.mission, mission, target).contents
        parameters = parameter_path(mission, plan.vehicle.autopilot)
        if parameters in beside:
            contents[parameters] = render_parameters(
                conversion.parameters,
                conversion.vehicle.type.family.parameter_style,
                header=comment_for(mission),
            ).encode(errors="replace")  # the name of a mission may be no Unicode
        write_together(contents)
        known = [fence_path(mission), *(parameter_path(mission, each) for each in autopilots())]
        for outdated in known:
            if outdated and outdated not in beside and mission.suffix.lower() != ".kml":
                remove_outdated(outdated)
        return mission, *beside

    def as_dict(self) -> dict[str, Any]:
        """Return the JSON object of `--json`: bit/s/Hz, seconds, metres, dB, 10^6 bytes.

        A part that is not there is null.
        """
        solution, plan, conversion = self.solution, self.solution.plan, self.conversion
        information, fresh, under = self.information, self.fresh, self.shadowed
        flown, energy = self.prediction, self.check and self.check.energy
        mission = predicted = None
        if conversion is not None:
            mission = {
                "items": len(conversion.mission.items),
                "duration": flown and flown.duration,
                "distance": conversion.schedule.route.distance,
                "parameters": dict(conversion.parameters),
            }
        if conversion is not None and flown is not None:
            predicted = flight_as_dict(plan, flown) | {"assumption": conversion.vehicle.assumption}
        return {
            "name": plan.name,
            **rates_as_dict(plan, solution.rates, solution.delivered_rate),
            "rate": plan.optimizer.rate,
            "gain_over_cutoff": solution.gain,
            "causal": plan.radio.causal,
            "duplex": plan.radio.duplex,
            "bandwidth_mhz": plan.radio.bandwidth_mhz,
            "mutual_information": information.average if information else None,
            "mutual_information_bs_uav": information.bs_uav if information else None,
            "mutual_information_uav_user": information.uav_user if information else None,
            "mutual_information_delivered": information.delivered if information else None,
            "mutual_information_error": information.error if information else None,
            "fresh_rate": fresh.average if fresh else None,
            "fresh_rate_error": fresh.error if fresh else None,
            "fresh_delivered_rate": fresh.delivered if fresh else None,
            "fresh_delivered_rate_error": fresh.delivered_error if fresh else None,
            "upper_bound": self.bound.value if self.bound else None,
            "upper_bound_exact": self.bound.exact if self.bound else None,
            "goal": _goal_as_dict(solution),
            "height": _height_as_dict(solution),
            "shadowing": under and {"mean": under.mean, "quantiles": dict(under.quantiles)},
            "starts": dict(solution.starts),
            "iterations": solution.iterations,
            "converged": solution.converged,
            "ending": solution.ending,
            "history": solution.history.tolist(),
            "residuals": solution.residuals(),
            "seconds": {"optimize": self.seconds_optimize, "total": self.seconds_total},
            "saturated": self.saturation.saturated if self.saturation else None,
            "spare_db": self.saturation.spare_db if self.saturation else None,
            "no_mission": str(self.no_mission) if self.no_mission else None,
            "mission": mission,
            "predicted": predicted,
            "wind": asdict(plan.site.wind),
            "energy": energy and energy.as_dict(),
            "fence": self.fence,
            "validation": [asdict(finding) for finding in self.findings],
        }


def _goal_as_dict(solution: Solution) -> dict[str, Any] | None:
    """Return what a goal led to, s, dBm and Wh, and what one step less delivers."""
    plan, least = solution.plan, solution.least
    if least is None:
        return None
    below = least.below
    less = 0.0 if below is None else worth(below)
    return {
        "minimise": plan.goal.minimise,
        "maximise": plan.goal.maximise,
        "needed_rate": plan.needed_rate,
        "deliver_mbytes": plan.goal.deliver_mbytes,
        "duration": plan.flight.duration,
        "power_dbm": [round(dbm(power), 6) for power in plan.powers],
        "energy_wh": solution.energy_wh,
        "limit": least.limit,
        "one_step_less": below
        and {"delivered_rate": less, "delivered_mbytes": below.plan.megabytes(less)},
        "optimizations": least.optimizations,
    }


def _height_as_dict(solution: Solution) -> dict[str, Any] | None:
    """Return which height was chosen, m, and what both ends of the choice deliver, bit/s/Hz."""
    if (found := solution.height) is None:
        return None
    ends = {"least": (found.least, found.at_least), "most": (found.most, found.at_most)}
    return {"altitude": solution.plan.flight.altitude, "tried": found.tried} | {
        name: {"altitude": at, "delivered_rate": end and end.delivered_rate}
        for name, (at, end) in ends.items()
    }


def flight_as_dict(plan: Plan, flight: Prediction) -> dict[str, Any]:
    """Return what a flight delivers and how far it is from `plan`, as `predicted` in `--json`."""
    return {
        **rates_as_dict(plan, flight.rates, flight.delivered_rate),
        "average_rate_by_position": flight.by_position.R_avg,
        "delivered_rate_by_position": flight.delivered_by_position,
        "duration": flight.duration,
        "max_path_error": flight.max_path_error,
        "max_position_error": flight.max_position_error,
        "rms_position_error": flight.rms_position_error,
    }


def debriefing_as_dict(found: Debriefing) -> dict[str, Any]:
    """Return the JSON object of what became of a plan: units as in `Result.as_dict`."""
    solution, plan = found.solution, found.solution.plan
    return {
        "planned": rates_as_dict(plan, solution.rates, solution.delivered_rate),
        "predicted": flight_as_dict(plan, found.predicted),
        "flown": flight_as_dict(plan, found.flown),
        "start": found.start,
        "missing": found.missing,
        "from_end": found.from_end,
        "broken_off": found.broken_off,
        "altitude_error": found.altitude_error,
    }


def rates_as_dict(plan: Plan, rates: Rates, delivered: float) -> dict[str, Any]:
    """Return rates by their names in `--json`, bit/s/Hz, and with a bandwidth in Mbit/s too."""
    named = {
        "average_rate": rates.R_avg,
        "rate_bs_uav": rates.R_U,
        "rate_uav_user": rates.R_G,
        "delivered_rate": delivered,
    }
    megabits = {name: plan.megabits(rate) for name, rate in named.items()}
    told = megabits if plan.radio.bandwidth_mhz is not None else None
    return {**named, "mbit_per_second": told, "delivered_mbytes": plan.megabytes(delivered)}


def optimize_plan(
    plan: Plan, *, observe: Observer | None = None, **parts: Unpack[OwnParts]
) -> Result:
    """Return the solution of `plan` with its mutual information: all that a study's row needs.

    `observe` is told the progress; `parts` are one's own. Raises what `optimize` raises.
    """
    from faao_mav.optimizer.optimize import optimize

    started = time.perf_counter()
    solution = optimize(plan, observe=observe, **parts)
    seconds = time.perf_counter() - started
    information = price(solution) if solution.problem.uav_user.steps is None else None
    return Result(solution, information, seconds_optimize=seconds)


def plan_mission(
    plan: Plan, *, bound: bool = False, observe: Observer | None = None, **parts: Unpack[OwnParts]
) -> Result:
    """Optimise the flight of `plan` and make the mission that flies it.

    With `bound` what no route can exceed is computed too; `observe` is told the progress; `parts`
    are one's own, see `OwnParts`. A flight that no mission can be made of is a result without a
    mission: see `Result.no_mission`. Raises what `optimize` raises.

    >>> from faao_mav import read_plan
    >>> result = plan_mission(read_plan("missions/copter_relay.yaml"))
    >>> result.flyable
    True
    >>> result.prediction.rates.R_avg > 0.99 * result.solution.rates.R_avg
    True
    >>> sorted(result.conversion.parameters)[:2]
    ['WPNAV_ACCEL', 'WPNAV_JERK']
    """
    started = time.perf_counter()
    result = optimize_plan(plan, observe=observe, **parts)
    solution = result.solution
    if observe is not None:
        observe(Progress(1, 1, "the mission's timing", solution.history[-1]))
    result = with_mission(result)
    ceiling = None
    if bound:
        from faao_mav.optimizer.search.bound import upper_bound

        ceiling = upper_bound(solution.problem, solution.maximised, observe=observe)
    return replace(
        result,
        fresh=fresh_rates(solution),
        saturation=saturation(solution),
        shadowed=shadowed(solution),
        bound=ceiling,
        seconds_total=time.perf_counter() - started,
    )


def with_mission(result: Result) -> Result:
    """Return `result` with its mission, or with why there is none."""
    solution = result.solution
    try:
        check_vehicle(solution.plan)
        conversion = convert(solution)
    except FaaoError as error:
        return replace(result, no_mission=error)
    judged = check(
        conversion.mission,
        conversion.vehicle,
        limits=Limits(max_speed=solution.plan.vehicle.max_speed),
        solution=solution,
    )
    return replace(result, conversion=conversion, prediction=judged.prediction, check=judged)


def mission_files(path: str | Path, plan: Plan) -> tuple[Path, ...]:
    """Return the files that `Result.write` writes for `plan`: mission, then parameters and fence.

    Raises `InputError` for one that cannot be written, and for parameters or a fence there that no
    run has written: they are a user's own, perhaps. To be asked before the work.
    """
    mission = Path(path)
    fence = fence_path(mission)
    check_writable(mission)
    beside = []
    if any(plan.candidates):
        beside.append(parameter_path(mission, plan.vehicle.autopilot))
        check_replaceable(beside[-1], "the mission's parameters are")
    if fence is not None and plan.fence is not None:
        beside.append(fence)
        check_replaceable(fence, "the mission's fence is")
    return mission, *beside
