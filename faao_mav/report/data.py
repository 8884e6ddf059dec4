"""What a report is made of."""

from collections.abc import Sequence
from dataclasses import dataclass

from faao_mav.mission.item import Mission
from faao_mav.optimizer.pricing import FreshRates, MutualInformation, Saturation
from faao_mav.optimizer.search.bound import Bound
from faao_mav.optimizer.solution import Solution
from faao_mav.schedule.conversion import Conversion
from faao_mav.schedule.prediction import Prediction
from faao_mav.validate.finding import Finding
from faao_mav.validate.link import LinkCheck
from faao_mav.vehicle import Vehicle
from faao_mav.vehicle.track import Track


@dataclass(frozen=True, slots=True, eq=False)
class ReportData:
    """The parts that there are; each adds its sections, `findings` of None was not checked."""

    solution: Solution | None = None
    conversion: Conversion | None = None
    prediction: Prediction | None = None
    findings: Sequence[Finding] | None = None
    mission: Mission | None = None
    """A mission by itself, with its predicted flight as `track`, for a page without conversion."""
    track: Track | None = None
    link: LinkCheck | None = None
    vehicle: Vehicle | None = None
    information: MutualInformation | None = None
    fresh: FreshRates | None = None
    saturation: Saturation | None = None
    bound: Bound | None = None
    title: str = ""
    """Without one, the name of the plan."""
