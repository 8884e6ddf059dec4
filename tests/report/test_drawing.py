"""A planned mission for Google Earth."""

from xml.etree import ElementTree as Xml

import pytest
from conftest import MakePlan

from faao_mav.geodesy import LocalFrame
from faao_mav.optimizer.optimize import optimize
from faao_mav.schedule.conversion import convert
from faao_mav.workflow import DRAWING_START, draw_mission

KML, GX = "{http://www.opengis.net/kml/2.2}", "{http://www.google.com/kml/ext/2.2}"


def test_the_flight_and_the_stations_are_where_the_plan_has_them(small_plan: MakePlan) -> None:
    plan = small_plan(
        {"flight.start_velocity": "hover", "flight.end_velocity": "hover", "name": "a & b"}
    )
    solution = optimize(plan)
    root = Xml.fromstring(draw_mission(solution, convert(solution)))
    names = {element.text for element in root.iter(f"{KML}name")}
    assert {"a & b", "base station", "ground user"} <= names
    whens = [element.text or "" for element in root.iter(f"{KML}when")]
    coordinates = [
        [float(x) for x in (element.text or "").split()] for element in root.iter(f"{GX}coord")
    ]
    assert len(whens) == len(coordinates) > 60
    assert whens[0].startswith(DRAWING_START.strftime("%Y-%m-%dT%H:%M:%S"))
    assert whens == sorted(whens)
    frame = LocalFrame(plan.origin.latitude, plan.origin.longitude)
    places = frame.to_local([c[1] for c in coordinates], [c[0] for c in coordinates])
    heights = [c[2] - plan.origin.elevation for c in coordinates]
    assert max(heights) == pytest.approx(plan.flight.altitude, abs=0.5)
    for w in (solution.w[0], solution.w[-1]):
        assert min(abs(places - w).max(axis=1)) < 3
