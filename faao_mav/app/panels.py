"""The panels beside the map: the plan's keys as fields, a flight's figures, and its findings."""

from collections.abc import Callable, Mapping
from functools import partial

from nicegui import ui

from faao_mav.app.document import Document, Path
from faao_mav.plan.keys import PlanKey, reference
from faao_mav.report.summary import result_lines
from faao_mav.validate import Finding
from faao_mav.validate.rule import by_rule, message_of
from faao_mav.workflow import Result


def fields() -> tuple[PlanKey, ...]:
    """Return the keys that have a field, in the order of the plan reference: all but the study's.

    >>> [key.path for key in fields()][:3]
    ['name', 'site.origin.latitude', 'site.origin.longitude']
    """
    known = reference().values()
    sections = {each.path for each in known if each.inside and each.accepted[:9] == "a mapping"}
    inside = {"", *sections} - {"study"}  # keys below a list of mappings have no field
    return tuple(
        key for key in known if key.path not in sections and key.path.rpartition(".")[0] in inside
    )


class Form:
    """The fields of a document; `changed` is called after one was written.

    Those of a section are made when it is opened: each element on the page slows every change.
    """

    def __init__(self, document: Document, changed: Callable[[], None]) -> None:
        self._document, self._changed = document, changed
        self._inputs: dict[str, ui.input | ui.select] = {}
        self._sections: dict[str, ui.expansion] = {}
        self._problems: Mapping[str, str] = {}

    def build(self) -> None:
        """Make one panel for each section of the file, with the fields of the first ones."""
        for key in fields():
            section = key.path.rpartition(".")[0]
            if section not in self._sections:
                panel = ui.expansion(section or "plan").classes("w-full section")
                panel.props("dense header-class=section-head")
                panel.on_value_change(partial(self._open, section))
                self._sections[section] = panel
        for section in ("", "flight"):
            self._sections[section].open()

    def _open(self, section: str) -> None:
        held = [key for key in fields() if key.path.rpartition(".")[0] == section]
        if held[0].path in self._inputs:
            return
        with self._sections[section]:
            if section:
                ui.label(reference()[section].description).classes("about")
            for key in held:
                self._inputs[key.path] = self._field(key)
        self.show()
        self.tell(self._problems)

    def show(self) -> None:
        """Show the values of the document."""
        for name, shown in self._inputs.items():
            value = self._document.shown(_path(name))
            held = value or None if isinstance(shown, ui.select) else value
            if shown.value != held:
                shown.value = held

    def tell(self, problems: Mapping[str, str]) -> None:
        """Show what is wrong with the fields, by their paths, and only that."""
        self._problems = problems
        for name in problems:
            if (panel := self._sections.get(name.rpartition(".")[0])) is not None:
                panel.open()
        for name, shown in self._inputs.items():
            problem = problems.get(name)
            if (shown.props.get("error-message") or None) != problem:
                shown.props["error"], shown.props["error-message"] = problem is not None, problem
                shown.update()

    def _field(self, key: PlanKey) -> ui.input | ui.select:
        name = key.path.rpartition(".")[2]
        label = f"{name}, {key.unit}" if key.unit else name
        default = "Required." if key.required else f"Default: {key.default or 'none'}."

        def commit() -> None:
            value = shown.value or ""
            if str(value) != self._document.shown(_path(key.path)):
                self._document.write(_path(key.path), str(value))
                self._changed()

        shown: ui.input | ui.select
        if key.choices:
            shown = ui.select([*key.choices], label=label, clearable=True)
            shown.on_value_change(commit)
        else:
            shown = ui.input(label=label).on("keydown.enter", commit).on("blur", commit)
        shown.props["hint"] = f"{key.description} {default}"
        shown.props(f'dense bottom-slots data-key="{key.path}"').classes("w-full")
        return shown


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


def _path(name: str) -> Path:
    return tuple(name.split("."))
