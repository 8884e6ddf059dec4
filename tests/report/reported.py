"""One flight for the tests of reports, with a fence and a hostile name."""

from dataclasses import dataclass, replace
from functools import cache

from conftest import SMALL, edited

from faao_mav import optimize
from faao_mav.mission.fence import Circle, Fence, Polygon
from faao_mav.optimizer.solution import Solution
from faao_mav.plan import parse_plan
from faao_mav.schedule.conversion import Conversion, convert
from faao_mav.schedule.prediction import Prediction, predict_delivery
from faao_mav.validate import Finding, Level

HOSTILE = "</title><script>alert('x')</script> $\\frac & \" 'π' 中"

FINDINGS = (
    Finding(Level.ERROR, "fence-leg", 4, "the leg is <b>outside</b>", "go around & back"),
    Finding(Level.NOTE, "far", None, "it is far", ""),
)


@dataclass(frozen=True)
class Flown:
    solution: Solution
    conversion: Conversion
    prediction: Prediction


@cache
def flown() -> Flown:
    text = edited(SMALL, {"name": HOSTILE, "radio.fading": "none"})
    solution = optimize(parse_plan(text))
    conversion = convert(solution)
    lat, lon = -35.363262, 149.165237
    corners = ((lat - 0.01, lon - 0.01), (lat + 0.01, lon - 0.01), (lat, lon + 0.01))
    fence = Fence(
        polygons=(Polygon(corners, inclusion=True),),
        circles=(Circle((lat + 0.0002, lon + 0.0006), 5.0, inclusion=False),),
    )
    mission = replace(conversion.mission, fence=fence)
    prediction = predict_delivery(solution, conversion)
    solution = replace(solution, starts={"straight": 1.0, "bs": 1.1})
    return Flown(solution, replace(conversion, mission=mission), prediction)
