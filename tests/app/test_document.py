"""A plan that is edited: comments stay, changes are undone, zones are as plans have them."""

import re
from pathlib import Path
from typing import Any

import pytest
from conftest import MISSIONS, SMALL
from hypothesis import given, settings
from hypothesis import strategies as st

from faao_mav.app.document import Document, problems_of
from faao_mav.app.scene import Scene
from faao_mav.errors import PlanError
from faao_mav.plan import parse_plan
from faao_mav.plan.keys import reference
from faao_mav.plan.yaml_text import load_yaml


def test_a_change_leaves_comments_and_all_other_values() -> None:
    for path in sorted(MISSIONS.glob("*.yaml")):
        text = path.read_text()
        document = Document(text)
        document.write(("flight", "altitude"), "77.5")
        assert re.findall("#.*", document.text) == re.findall("#.*", text), path
        wanted = load_yaml(text, "p")
        wanted["flight"]["altitude"] = 77.5
        assert load_yaml(document.text, "p") == wanted, path
        if path.stem == "fenced_relay":
            assert document.text == text.replace("altitude: 100", "altitude: 77.5")
    document = Document("name: a\nstudy:\n  schemes:  # these\n    - faao\n")
    document.write(("name",), "b")
    assert document.text == "name: b\nstudy:\n  schemes:  # these\n    - faao\n"


def test_values_are_written_removed_undone_and_done_again() -> None:
    top, start = "# top\nflight: {duration: 120}  # s\n", ("flight", "start")
    document = Document(top)
    document.write(("optimizer", "tolerance"), "1e-3")
    document.write(start, "[0, 350]")
    assert document.text == (
        "# top\nflight: {duration: 120, start: [0, 350]} # s\noptimizer:\n  tolerance: 1e-3\n"
    )
    document.write(("flight", "duration"), " ")
    assert document.value(("flight", "duration")) is None
    for _ in range(2):
        document.undo()
    assert (document.shown(start), document.can_undo, document.can_redo) == ("", True, True)
    document.redo()
    assert document.shown(start) == "[0, 350]"
    document.write(("name",), "x")
    assert not document.can_redo
    for _ in range(9):
        document.undo()
    assert document.text == top
    for k in range(5):
        document.put(start, [k, 50], "drag 1")
    document.put(start, [9, 50], "drag 2")
    document.undo()
    assert document.value(start) == [4, 50]  # a whole drag is one step


def test_what_plans_do_not_hold_is_kept_as_text_and_told_as_the_command_line_does() -> None:
    document = Document(SMALL)
    for text in ("!!set {a}", "*a", "[1", "{a: 1, a: 2}", "- 1\n- "):
        document.write(("name",), text)
        assert document.value(("name",)) in (text, [1, None])
        document.undo()
        assert document.text == SMALL
    document.write(("flight", "start"), "[0, 3")
    with pytest.raises(PlanError) as error:
        parse_plan(document.text, "plan.yaml")
    told = problems_of(str(error.value), "plan.yaml", [*reference()])
    assert told.keys() == {"flight.start"}
    assert told["flight.start"].startswith("'[0, 3': not two finite numbers")
    assert str(error.value) == f"plan.yaml: flight.start: {told['flight.start']}"


@settings(max_examples=15)
@given(
    value=st.recursive(
        st.integers(-(10**6), 10**6)
        | st.floats(-1e6, 1e6)
        | st.booleans()
        | st.text("ab:#- é", max_size=9),
        lambda inner: st.lists(inner, max_size=3) | st.dictionaries(st.sampled_from("abc"), inner),
        max_leaves=6,
    )
)
def test_what_is_put_in_is_read_again(value: Any) -> None:
    document = Document(SMALL)
    document.put(("vehicle", "parameters"), value)
    read = load_yaml(document.text, "p")
    assert read["vehicle"]["parameters"] == value
    assert read["flight"] == load_yaml(SMALL, "p")["flight"]


def test_zones_are_drawn_changed_and_removed() -> None:
    document = Document(SMALL)
    scene, frame = Scene(document), parse_plan(SMALL).origin.frame
    center, *square = (
        [float(x) for x in frame.to_geodetic(place)]
        for place in ((20, 30), (-90, -90), (90, -90), (90, 90), (-90, 90))
    )
    circle = {"center": center, "radius": 4.0, "inclusion": False, "key": None}
    inside = {"corners": square, "inclusion": True, "key": None}
    for zone in (circle, inside):
        scene.change(zone, None)
    plan = parse_plan(document.text)
    assert [zone.inclusion for zone in plan.zones] == [True, False]
    assert document.value(("fence", "exclusion")) == [{"center": [20.0, 30.0], "radius": 4.0}]
    shown = scene.zones()
    assert [zone["key"] for zone in shown] == ["inclusion/0", "exclusion/0"]
    scene.change({**shown[1], "radius": 7.0}, None)
    assert document.value(("fence", "exclusion", 0, "radius")) == 7.0
    scene.remove("inclusion/0")
    assert document.value(("fence", "inclusion")) is None
    scene.remove("exclusion/0")
    assert document.value(("fence",)) is None
    for _ in range(5):
        document.undo()
    assert document.text == SMALL
    # what was dragged or chosen when it was undone is not there any more
    for key in ("inclusion/0", "exclusion/7"):
        scene.change({**shown[1], "key": key}, None)
        scene.remove(key)
    assert document.text == SMALL
    odd = Document(f"{SMALL}fence: {{exclusion: 3}}\n")
    Scene(odd).change(circle, None)
    assert odd.value(("fence", "exclusion")) == [{"center": [20.0, 30.0], "radius": 4.0}]
    ringless = "fence: {exclusion: [{polygon: 3}, {center: 3}, 7]}\n"
    assert Scene(Document(SMALL + ringless)).zones() == []
    # the short form of an inclusion becomes a list when it is changed
    document = Document((MISSIONS / "fenced_relay.yaml").read_text())
    scene = Scene(document)
    first = scene.zones()[0]
    assert first["key"] == "inclusion/0"
    for zone, corners in ((first, [4]), ({**first, "key": None}, [4, 4])):
        scene.change(zone, None)
        assert [len(each["polygon"]) for each in document.value(("fence", "inclusion"))] == corners
    assert parse_plan(document.text).zones[0].inclusion


def test_a_station_in_degrees_stays_in_degrees() -> None:
    place = "{latitude: -35.363, longitude: 149.166}"
    document = Document(SMALL.replace("position: [60, 60]", f"position: {place}"))
    scene = Scene(document)
    scene.move("user", [-35.3625, 149.1662], None)
    scene.move("base", [-35.363262, 149.165237], None)
    moved = {"latitude": -35.3625, "longitude": 149.1662}
    assert document.value(("radio", "ground_user", "position")) == moved
    assert document.value(("radio", "base_station", "position")) == [0.0, 0.0]
    # without a sound origin nothing is on the map, nor moved there
    for origin in ("", "{latitude: 91, longitude: 1}", "[1]", "{latitude: a}"):
        nowhere = Document(f"site: {{origin: {origin}}}\nfence: {{exclusion: 3}}\n")
        scene = Scene(nowhere)
        assert (scene.frame, scene.stations(), scene.zones()) == (None, [], [])
        scene.move("user", [1.0, 2.0], None)
        circle = {"center": [1.0, 2.0], "radius": 4.0, "inclusion": False, "key": None}
        scene.change(circle, None)
        assert not nowhere.can_undo


def test_only_the_file_that_was_opened_is_saved_and_no_newer_one(tmp_path: Path) -> None:
    path = tmp_path / "p.yaml"
    path.write_text(SMALL)
    first, second = Document.open(path), Document.open(path)
    for document, name in ((first, "a"), (second, "b")):
        document.write(("name",), name)
        assert not document.saved
    first.save()
    assert (first.saved, path.read_text()) == (True, first.text)
    with pytest.raises(PlanError, match="was changed since"):
        second.save()
    first.replace("name: other\n", "other.yaml")
    with pytest.raises(PlanError):
        first.save()
    assert load_yaml(path.read_text(), "p")["name"] == "a"
