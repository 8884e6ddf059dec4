"""What comes of a finished flight: its figures, and what validation found."""

from collections.abc import Callable
from functools import partial

from nicegui import ui

from faao_mav.report.summary import result_lines
from faao_mav.validate import Finding
from faao_mav.validate.words import by_rule, message_of
from faao_mav.workflow import Result


class Results:
    """The panels "Result" and "Findings"; `focus` shows a [latitude, longitude] on the map."""

    def __init__(self, focus: Callable[[list[float]], object]) -> None:
        self._focus = focus
        with ui.tab_panel("Result"):
            self._facts = ui.element("dl").classes("facts")
        with ui.tab_panel("Findings"):
            self._findings = ui.column().classes("findings")

    def stale(self) -> None:
        """Mark what is shown as of the plan before."""
        for shown in (self._facts, self._findings):
            shown.classes("stale")

    def clear(self) -> None:
        """Show nothing."""
        for shown in (self._facts, self._findings):
            shown.classes(remove="stale")
            shown.clear()

    def show(self, result: Result) -> None:
        """Show what is to be said of `result` in the place of what was."""
        self.clear()
        with self._facts:
            for line in result_lines(result):
                for tag, words in zip(("dt", "dd"), line, strict=True):
                    with ui.element(tag):
                        ui.label(str(words))
        with self._findings:
            if result.no_mission is not None:
                ui.label(str(result.no_mission)).classes("finding error")
            elif not result.findings:
                ui.label("None: nothing speaks against the mission.")
            for group in by_rule(result.findings):
                with ui.element("div").classes(f"finding {group[0].level}"):
                    ui.label(f"{group[0].level}: {message_of(group)}")
                    ui.label(group[0].action).classes("about")
                    self._items(result, group)

    def _items(self, result: Result, group: list[Finding]) -> None:
        """Make a button for each item with a place that the findings `group` are about."""
        assert result.conversion is not None
        for number in dict.fromkeys(each.item for each in group if each.item is not None):
            item = result.conversion.mission.items[number - 1]
            if item.x or item.y:
                show = partial(self._focus, [item.x, item.y])
                ui.button(f"item {number}", on_click=show).props("flat dense no-caps icon=place")
