"""The page: complete, safe, and without a network."""

import re
import shutil
import subprocess
from dataclasses import replace
from html.parser import HTMLParser
from pathlib import Path

import pytest
from conftest import PATIENCE
from reported import HOSTILE, conversion, flown

from faao_mav.errors import InfeasibleError
from faao_mav.report import summary
from faao_mav.report.page import render_report
from faao_mav.validate import Check
from faao_mav.workflow import Result

VOID = {"meta", "br", "link", "img", "input", "hr"}
SECTIONS = "Result Findings Parameters Route Motion Link Queue Convergence Precoders Plan"


class Page(HTMLParser):
    """The elements of a page: their attributes, their texts; every one is closed in order."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.elements: list[tuple[str, dict[str, str | None]]] = []
        self.texts: list[tuple[str, str]] = []
        self.feed(text)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, dict(attrs)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.elements.append((tag, dict(attrs)))

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        if self.open:
            self.texts.append((self.open[-1], data))

    def of(self, tag: str) -> list[str]:
        return [text for element, text in self.texts if element == tag]


@pytest.fixture(scope="module")
def full() -> str:
    return render_report(flown())


def test_every_section_is_there_and_every_picture_has_a_title(full: str) -> None:
    page = Page(full)
    assert page.of("h2") == SECTIONS.split()
    pictures = [attributes for tag, attributes in page.elements if tag == "svg"]
    assert len(pictures) == 6
    titles = {a["id"] for tag, a in page.elements if tag == "title" and "id" in a}
    assert titles == {picture["aria-labelledby"] for picture in pictures}
    assert page.of("text").count("predicted") == 5  # map, speed, both rates and the queue
    wanted = conversion().parameters
    assert {*wanted} < {*page.of("dt")}
    assert {f"{value:g}" for value in wanted.values()} < {*page.of("dd")}
    shown = " ".join(text for _, text in page.texts)
    assert re.search(r"faao-mav \d.*numpy \d.*Python \d", shown)


def test_the_page_says_what_the_summary_says_but_how_long_it_took(full: str) -> None:
    said = summary(flown(), verbose=True).replace(" +- ", " ± ")
    parameters = [f"{value:g}" for value in conversion().parameters.values()]
    more = [text for text in Page(full).of("dd") if text not in said and text not in parameters]
    assert all(text.startswith("converged after") for text in more)
    assert len(more) == 1


@pytest.mark.usefixtures("unpainted")
def test_a_part_that_is_not_there_leaves_its_sections_out() -> None:
    none = Result(flown().solution, no_mission=InfeasibleError("too many items"))
    page = Page(render_report(none))
    assert "none: too many items" in page.of("dd")
    assert "Findings" not in page.of("h2")
    sound = Check(conversion().mission, conversion().vehicle, unpredicted="no model")
    page = Page(render_report(sound))
    assert (page.of("h1"), page.of("h2")) == (["Relay flight"], ["Result", "Findings"])
    assert "no model" in page.of("dd")
    assert Page(render_report(sound, title="Checked")).of("h1") == ["Checked"]


def test_nothing_comes_from_elsewhere_and_names_are_text(full: str) -> None:
    page = Page(full)
    loading = {"script", "link", "img", "iframe", "object"}
    assert not loading & {tag for tag, _ in page.elements}
    for tag, attributes in page.elements:
        for name, value in attributes.items():
            assert not name.startswith("on"), (tag, name)
            if name in ("href", "src", "xlink:href"):
                assert (value or "").startswith("#"), (tag, value)
    assert not any(word in full for word in ("http:", "https:", "@import", "<script"))
    ids = [a["id"] for _, a in page.elements if a.get("id")]
    assert len(ids) == len(set(ids))
    targets = re.findall(r"url\(([^)]*)\)", full) + re.findall(r'href="([^"]*)"', full)
    assert targets
    assert {target[1:] for target in targets if target[0] == "#"} <= set(ids)
    assert {target[0] for target in targets} == {"#"}
    assert page.of("h1") == [HOSTILE] == page.of("title")[:1]
    assert "item 4: the leg is <b>outside</b> [fence-leg]" in "".join(page.of("li"))
    assert page.of("b") == ["error", "note"]
    assert "".join(page.of("pre")) == flown().solution.plan.text


def test_the_same_flight_gives_the_same_page_in_light_and_dark(full: str) -> None:
    assert render_report(replace(flown(), seconds_optimize=99.0, seconds_total=100.0)) == full
    light, dark = (
        set(re.findall(r"(--\w+):", block))
        for block in re.findall(r":root \{(.*?)\}", full, re.DOTALL)
    )
    assert light == dark
    assert set(re.findall(r"var\((--\w+)\)", full)) <= light


@pytest.mark.skipif(shutil.which("chromium") is None, reason="no chromium to show the page with")
def test_a_phone_shows_it_without_scrolling_sideways(tmp_path: Path, full: str) -> None:
    probe = (
        '<iframe id="f" src="page.html" width="320" height="600"></iframe><script>'
        'f.onload = () => { const d = f.contentDocument; document.title = "wide " + '
        "(d.documentElement.scrollWidth <= f.clientWidth) + "
        '" drawn " + [...d.querySelectorAll("svg")].every('
        "s => s.getBoundingClientRect().height > 99) }</script>"
    )
    (tmp_path / "page.html").write_text(full)
    (tmp_path / "probe.html").write_text(probe)
    shown = subprocess.run(
        ["chromium", "--headless", "--no-sandbox", "--disable-gpu", "--virtual-time-budget=5000",
         "--allow-file-access-from-files", f"--user-data-dir={tmp_path / 'profile'}",
         "--dump-dom", (tmp_path / "probe.html").as_uri()],
        capture_output=True, text=True, timeout=PATIENCE, check=True,
    )  # fmt: skip
    assert "<title>wide true drawn true</title>" in shown.stdout
