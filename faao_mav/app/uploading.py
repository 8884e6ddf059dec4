"""A finished flight onto a vehicle, and what became of it in words."""

from faao_mav.errors import FaaoError, PlanError
from faao_mav.workflow import Result


def uploaded(result: Result, connection: str) -> str:
    """Upload the mission of `result` to `connection`, read it back, compare; return what to tell.

    What the command line would not upload is not uploaded: a mission with errors, or that of a plan
    beyond its vehicle. Nothing is armed or started.
    """
    from faao_mav.mavlink.client import upload
    from faao_mav.mavlink.upload_text import upload_text
    from faao_mav.schedule.conversion import beyond_vehicle

    try:
        if result.conversion is None or not result.flyable:
            raise PlanError("the mission does not pass validation; do not fly it")
        if beyond := beyond_vehicle(result.solution.plan):
            raise PlanError("\n".join(beyond))
        report = upload(result.conversion.mission, connection, note=lambda _: None)
    except FaaoError as error:
        return f"failed       {error}"
    told = upload_text(report)
    return told if report.verified else f"{told}\nthe mission is not verified; do not fly it"
