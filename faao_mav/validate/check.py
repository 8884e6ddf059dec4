"""All that can be said of a mission offline: its predicted flight, the plan's link, findings."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

from faao_mav.errors import FaaoError
from faao_mav.mission.item import Mission
from faao_mav.validate import Finding, Level, Limits, LinkCheck, validate
from faao_mav.vehicle import Vehicle
from faao_mav.vehicle.track import Track

if TYPE_CHECKING:
    from faao_mav.optimizer.solution import Solution


@dataclass(frozen=True, slots=True, eq=False)
class Check:
    """What was found: `unpredicted` says why there is no `track`, `link` needs a plan."""

    track: Track | None
    unpredicted: str
    link: LinkCheck | None
    findings: tuple[Finding, ...]

    def of(self, level: Level) -> tuple[Finding, ...]:
        """Return the findings of `level`."""
        return tuple(finding for finding in self.findings if finding.level is level)


def check(
    mission: Mission,
    vehicle: Vehicle,
    *,
    limits: Limits | None = None,
    solution: "Solution | None" = None,
    lead: float | None = None,
) -> Check:
    """Predict the flight of `mission` by `vehicle` and judge both by all rules.

    With a `solution` also by what the flight makes of that plan, which begins `lead` seconds after
    the flight does where that is known. A mission that cannot be
    predicted is judged by its items alone; nothing is raised.
    """
    track, unpredicted = _track(mission, vehicle)
    link = None
    if solution is not None and track is not None:
        from faao_mav.validate.comparison import compare_with_plan  # the radio's code

        link = compare_with_plan(solution, track, lead=lead)
    findings = validate(mission, vehicle, track=track, limits=limits, link=link)
    return Check(track, unpredicted, link, findings)


def _track(mission: Mission, vehicle: Vehicle) -> tuple[Track | None, str]:
    """Return the predicted flight, or None and why there is none."""
    from faao_mav.vehicle.predict import predict

    try:
        track = predict(mission, vehicle)
    except FaaoError as error:
        return None, str(error)
    return (track, "") if len(track.t) else (None, "there is nothing to fly")
