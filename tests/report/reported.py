"""One flight for the tests of reports, with a fence and a hostile name."""

from dataclasses import replace
from functools import cache

from conftest import SMALL, edited

from faao_mav import Conversion, Result, plan_mission
from faao_mav.mission.fence import Circle, Fence, Polygon
from faao_mav.plan import parse_plan
from faao_mav.schedule.prediction import Prediction
from faao_mav.validate import Finding, Level

HOSTILE = "</title><script>alert('x')</script> $\\frac & \" 'π' 中"

FINDINGS = (
    Finding(Level.ERROR, "fence-leg", 4, "the leg is <b>outside</b>", "go around & back"),
    Finding(Level.NOTE, "far", None, "it is far", ""),
)


@cache
def flown() -> Result:
    text = edited(SMALL, {"name": HOSTILE, "radio.fading": "none"})
    result = plan_mission(parse_plan(text))
    assert result.conversion is not None
    assert result.check is not None
    lat, lon = -35.363262, 149.165237
    corners = ((lat - 0.01, lon - 0.01), (lat + 0.01, lon - 0.01), (lat, lon + 0.01))
    fence = Fence(
        polygons=(Polygon(corners, inclusion=True),),
        circles=(Circle((lat + 0.0002, lon + 0.0006), 5.0, inclusion=False),),
    )
    mission = replace(result.conversion.mission, fence=fence)
    return replace(
        result,
        solution=replace(result.solution, starts={"straight": 1.0, "bs": 1.1}),
        conversion=replace(result.conversion, mission=mission),
        check=replace(result.check, mission=mission, findings=FINDINGS),
    )


def conversion() -> Conversion:
    """The conversion of `flown`."""
    found = flown().conversion
    assert found is not None
    return found


def prediction() -> Prediction:
    """The prediction of `flown`."""
    found = flown().prediction
    assert found is not None
    return found
