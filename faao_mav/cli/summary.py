"""The result of the main job, for people and for programs."""

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from faao_mav.cli.finding_lines import count_of, grouped, line_of
from faao_mav.optimizer.pricing import FreshRates, MutualInformation, Saturation
from faao_mav.optimizer.search.bound import Bound
from faao_mav.optimizer.solution import Solution
from faao_mav.schedule.conversion import Conversion
from faao_mav.schedule.prediction import Prediction
from faao_mav.validate.finding import Finding, Level
from faao_mav.vehicle import caveat

if TYPE_CHECKING:
    from faao_mav.mavlink.client import UploadReport


@dataclass(frozen=True, slots=True)
class Result:
    """Everything that the main job found out; without an `upload` none was asked for, or tried."""

    solution: Solution
    information: MutualInformation
    fresh: FreshRates | None
    saturation: Saturation
    bound: Bound | None
    conversion: Conversion
    prediction: Prediction
    seconds_optimize: float
    seconds_total: float
    written: tuple[Path, ...]
    findings: tuple[Finding, ...] = ()
    upload: "UploadReport | None" = None


def as_dict(result: Result) -> dict[str, Any]:
    """Return the JSON object of `--json`: bit/s/Hz, seconds, metres, dB."""
    solution, rates = result.solution, result.solution.rates
    information = result.information
    return {
        "name": solution.plan.name,
        "average_rate": rates.R_avg,
        "rate_bs_uav": rates.R_U,
        "rate_uav_user": rates.R_G,
        "mutual_information": information.average,
        "mutual_information_bs_uav": information.bs_uav,
        "mutual_information_uav_user": information.uav_user,
        "mutual_information_error": information.error,
        "fresh_rate": result.fresh.average if result.fresh else None,
        "fresh_rate_error": result.fresh.error if result.fresh else None,
        "upper_bound": result.bound.value if result.bound else None,
        "upper_bound_exact": result.bound.exact if result.bound else None,
        "starts": dict(solution.starts),
        "iterations": solution.iterations,
        "converged": solution.converged,
        "ending": solution.ending,
        "history": solution.history.tolist(),
        "residuals": solution.residuals(),
        "seconds": {"optimize": result.seconds_optimize, "total": result.seconds_total},
        "saturated": result.saturation.saturated,
        "spare_db": result.saturation.spare_db,
        "mission": {
            "items": len(result.conversion.mission.items),
            "duration": result.prediction.duration,
            "distance": result.conversion.schedule.route.distance,
            "parameters": dict(result.conversion.parameters),
        },
        "predicted": {
            "average_rate": result.prediction.rates.R_avg,
            "rate_bs_uav": result.prediction.rates.R_U,
            "rate_uav_user": result.prediction.rates.R_G,
            "average_rate_by_position": result.prediction.by_position.R_avg,
            "duration": result.prediction.duration,
            "max_path_error": result.prediction.max_path_error,
            "max_position_error": result.prediction.max_position_error,
            "rms_position_error": result.prediction.rms_position_error,
            "calibrated": not caveat(result.conversion.vehicle),
        },
        "validation": [asdict(finding) for finding in result.findings],
        "upload": _upload_as_dict(result.upload),
    }


def as_text(result: Result) -> str:
    """Return the summary for people."""
    solution, rates = result.solution, result.solution.rates
    information, limit = result.information, result.saturation
    flight, flown = solution.plan.flight, result.prediction
    share = 100 * flown.rates.R_avg / rates.R_avg if rates.R_avg else 100.0
    title = [solution.plan.name] if solution.plan.name else []
    lines = [
        *title,
        f"rate         {rates.R_avg:.4f} bit/s/Hz of at most {limit.ceiling:g} "
        f"(base station to UAV {rates.R_U:.4f}, UAV to user {rates.R_G:.4f})",
        f"             {solution.history[0]:.4f} on the straight start; mutual information "
        f"{information.average:.3f} +- {information.error:.1g}",
    ]
    if result.fresh is not None:
        lines.append(
            f"             {result.fresh.average:.4f} +- {result.fresh.error:.1g} on fading that "
            "was not planned on"
        )
    if result.bound is not None:
        short = 100 * (1 - rates.R_avg / result.bound.value) if result.bound.value else 0.0
        lines.append(
            f"bound        within {short:.2g} % of the best that any route can do: at most "
            f"{result.bound.value:.4f} bit/s/Hz{'' if result.bound.exact else ' (numerical)'}"
        )
    if limit.saturated:
        lines.append(
            "saturated    the alphabet is used up and the route hardly matters: "
            f"{limit.spare_db:.1f} dB less power at both stations would do"
        )
    if len(solution.starts) > 1:
        ranked = sorted(solution.starts.items(), key=lambda start: start[1])
        (worst, low), (best, high) = ranked[0], ranked[-1]
        lines.append(
            f"starts       {len(ranked)}, from {low:.4f} ({worst}) to {high:.4f} ({best}) bit/s/Hz"
        )
    state = "converged" if solution.converged else "NOT CONVERGED"
    lines += [
        f"optimiser    {state} after {_count(solution.iterations, 'iteration')}, "
        f"{result.seconds_optimize:.1f} s: {solution.ending}",
        f"mission      {_count(len(result.conversion.mission.items), 'item')}; relay route of "
        f"{result.conversion.schedule.route.distance:.0f} m",
        f"predicted    {flown.rates.R_avg:.4f} bit/s/Hz, {share:.2f} % of the plan, in "
        f"{flown.duration:.1f} s (planned: {flight.duration:g} s)",
        f"             {flown.rms_position_error:.1f} m rms from the plan at equal times, "
        f"{flown.max_position_error:.1f} m at most; {flown.max_path_error:.1f} m from its path",
    ]
    if doubt := caveat(result.conversion.vehicle):
        lines.append(f"             {doubt}")
    lines += _checked(result.findings)
    if result.conversion.parameters:
        wanted = ", ".join(f"{name} {v:g}" for name, v in result.conversion.parameters.items())
        lines.append(f"parameters   the mission is timed for {wanted}: load them first")
    lines += [f"written      {path}" for path in result.written]
    if not result.written:
        lines.append("written      nothing: give --out MISSION.waypoints")
    if result.upload is not None:
        from faao_mav.cli import upload

        lines.append(upload.as_text(result.upload))
    return "\n".join(lines)


def _checked(findings: Sequence[Finding]) -> Iterator[str]:
    """Yield the lines of a validation: notes are counted, the rest is told."""
    told = [finding for finding in findings if finding.level is not Level.NOTE]
    notes = f"{count_of(findings, Level.NOTE)}"
    if not told:
        yield f"checked      no errors or warnings, {notes}"
        return
    counts = (count_of(findings, level) for level in (Level.ERROR, Level.WARNING))
    yield f"checked      {', '.join(counts)}, {notes}"
    for group in grouped(told):
        yield f"             {line_of(group)}"


def _upload_as_dict(report: "UploadReport | None") -> dict[str, Any] | None:
    if report is None:
        return None
    from faao_mav.cli import upload

    return upload.as_dict(report)


def _count(number: int, noun: str) -> str:
    return f"{number} {noun}" if number == 1 else f"{number} {noun}s"
