"""The panels beside the map: the plan's keys, a flight's figures and findings, and its vehicle."""

import asyncio
import tempfile
import threading
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

from nicegui import events, ui

from faao_mav.app.document import Document
from faao_mav.app.vehicle import MISSION, debriefed, fly_command, uploaded, watched
from faao_mav.app.workers import Workers, said, talk
from faao_mav.fly.fly import as_text
from faao_mav.plan.keys import PlanKey, reference
from faao_mav.report.page import facts
from faao_mav.report.summary import result_lines
from faao_mav.validate.rule import by_rule, message_of
from faao_mav.workflow import Result

_LARGEST_LOG = 2**30  # bytes of a log that is taken: hours of flight. Chosen
_MOST_LINES = 100  # lines of what has happened that are shown. Chosen


def fields() -> tuple[PlanKey, ...]:
    """Return the keys that have a field, in the order of the plan reference: all but the study's.

    >>> [key.path for key in fields()][:3]
    ['name', 'site.origin.latitude', 'site.origin.longitude']
    """
    known = reference().values()
    sections = {each.path for each in known if each.inside and each.accepted[:9] == "a mapping"}
    inside = {"", *sections} - {"study"}  # keys below a list of mappings have no field
    return tuple(key for key in known if key.path not in sections and _section(key.path) in inside)


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
        for section in dict.fromkeys(_section(key.path) for key in fields()):
            panel = ui.expansion(section or "plan").classes("w-full section")
            panel.props("dense header-class=section-head")
            panel.on_value_change(partial(self._open, section))
            self._sections[section] = panel
        for section in ("", "flight"):
            self._sections[section].open()

    def _open(self, section: str) -> None:
        keys = [key for key in fields() if _section(key.path) == section]
        if keys[0].path in self._inputs:
            return
        with self._sections[section]:
            if section:
                ui.label(reference()[section].description).classes("about")
            self._inputs |= {key.path: self._field(key) for key in keys}
        self.show()
        self.tell(self._problems)

    def show(self) -> None:
        """Show the values of the document."""
        for path, shown in self._inputs.items():
            value = self._document.shown(tuple(path.split(".")))
            shown.value = value or None if isinstance(shown, ui.select) else value

    def tell(self, problems: Mapping[str, str]) -> None:
        """Show what is wrong with the fields, by their paths, and only that."""
        self._problems = problems
        for section in self._sections.keys() & map(_section, problems):
            self._sections[section].open()
        for path, shown in self._inputs.items():
            problem = problems.get(path)
            if (shown.props.get("error-message") or None) != problem:
                shown.props["error"], shown.props["error-message"] = problem is not None, problem
                shown.update()

    def _field(self, key: PlanKey) -> ui.input | ui.select:
        path = tuple(key.path.split("."))
        label = f"{path[-1]}, {key.unit}" if key.unit else path[-1]
        default = "Required." if key.required else f"Default: {key.default or 'none'}."

        def commit() -> None:
            value = shown.value or ""
            if str(value) != self._document.shown(path):
                self._document.write(path, str(value))
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
            self._facts = ui.element("div").classes("facts")
        with ui.tab_panel("Findings"):
            self._findings = ui.column().classes("findings")

    def stale(self) -> None:
        """Mark what is shown as of the plan before."""
        self._facts.classes("stale")
        self._findings.classes("stale")

    def clear(self) -> None:
        """Show nothing."""
        for shown in (self._facts, self._findings):
            shown.classes(remove="stale").clear()

    def show(self, result: Result) -> None:
        """Show what is to be said of `result` in the place of what was."""
        self.clear()
        with self._facts:
            ui.html(facts(result_lines(result)), sanitize=False)  # all in it is escaped
        items = result.conversion.mission.items if result.conversion is not None else ()
        with self._findings:
            if result.no_mission is not None:
                ui.label(str(result.no_mission)).classes("finding error")
            elif not result.findings:
                ui.label("None: nothing speaks against the mission.")
            for group in by_rule(result.findings):
                with ui.element("div").classes(f"finding {group[0].level}"):
                    ui.label(f"{group[0].level}: {message_of(group)}")
                    ui.label(group[0].action).classes("about")
                    for number in dict.fromkeys(each.item for each in group):
                        if number is None or not (items[number - 1].x or items[number - 1].y):
                            continue
                        show = partial(self._focus, [items[number - 1].x, items[number - 1].y])
                        button = ui.button(f"item {number}", on_click=show)
                        button.props("flat dense no-caps icon=place")


def _section(path: str) -> str:
    return path.rpartition(".")[0]


_ABOUT = """Upload reads the mission back and compares; Watch compares, then follows the vehicle on
the map, and may be left or closed at any time. Neither arms nor starts it."""

_HOW = f"Arm and start on the command line, in the folder to which {MISSION} was downloaded:"


class Fly:
    """What is done with a vehicle: one thing at a time, with the mission of the finished flight.

    Setup, once: `Fly(workers, draw, download)`, where `draw` calls the map's method of a name and
    `download` sends the browser the file of a name; `show` is for a finished flight, None when the
    plan has changed since; at the end: `close`. A watch goes on with the flight with which it
    began.
    """

    def __init__(
        self, workers: Workers, draw: Callable[..., object], download: Callable[[str], object]
    ) -> None:
        self._workers, self._draw = workers, draw
        self._result: Result | None = None  # of the finished flight
        self._file: Path | None = None  # that has its plan
        self._task: asyncio.Task[None] | None = None
        self._interrupt = threading.Event()
        with ui.tab_panel("Fly"):
            self._connection = ui.input(
                "Connection", value="udpout:127.0.0.1:14550", on_change=self._enable
            )
            self._connection.classes("w-full")
            with ui.row().classes("mt-2 gap-2"):
                upload, watch = (partial(self._begin, work) for work in (uploaded, watched))
                self._upload_button = _button("Upload and verify", upload)
                self._watch_button = _button("Watch", watch)
                self._leave_button = _button("Leave", self._interrupt.set)
            self._stands = ui.label().classes("uploaded stands")
            self._told = ui.label().classes("uploaded").props('aria-live="polite"')
            ui.label(_ABOUT).classes("about mt-2")
            with ui.element("div").classes("to-fly") as self._to_fly:
                ui.label(_HOW).classes("about")
                self._command = ui.label().classes("command")
                with ui.row().classes("gap-2"):
                    _button(f"Download {MISSION}", partial(download, MISSION))
                    _button("Copy", lambda: ui.clipboard.write(self._command.text))
            ui.separator().classes("my-3")
            self._log = ui.upload(
                label="Debrief: drop a log (.bin, .tlog, .ulg)",
                on_upload=self._debrief, auto_upload=True, max_file_size=_LARGEST_LOG,
            )  # fmt: skip
            self._log.props("accept=.bin,.tlog,.ulg flat bordered").classes("w-full log")
            self._debriefing = ui.label().classes("uploaded debriefing")
        self._enable()

    def show(self, result: Result | None, file: Path | None = None) -> None:
        """Take `result` for the finished flight; `file` has its plan, where one has."""
        self._result, self._file = result, file
        self._enable()

    def close(self) -> None:
        """Watch no longer, and cancel an upload; the vehicle goes on with what it does."""
        if self._task is not None:
            self._task.cancel()

    def _enable(self) -> None:
        flyable = self._result is not None and self._result.flyable
        for button in (self._upload_button, self._watch_button):
            button.set_enabled(flyable and self._task is None)
        self._leave_button.set_enabled(self._task is not None)
        self._command.text = fly_command(str(self._connection.value), self._file)
        self._to_fly.set_visibility(flyable and bool(self._command.text))

    def _begin(self, work: Callable[..., str]) -> None:
        """Do `work` with the mission and the connection as they stand now."""
        if self._result is not None and self._task is None:
            asked = (self._result, str(self._connection.value))
            self._task = asyncio.create_task(self._until_done(work, *asked))
            self._stands.text = self._told.text = ""
            if work is watched:
                self._draw("flown", [])
            self._enable()

    async def _until_done(self, work: Callable[..., str], *asked: object) -> None:
        try:
            told = await talk(work, self._hear, self._interrupt, *asked)
        except Exception as error:
            told = f"failed       {said(error)}"
        self._task = None
        self._tell(told)
        self._enable()

    def _tell(self, text: str) -> None:
        lines = [*self._told.text.splitlines(), *text.splitlines()]
        self._told.text = "\n".join(lines[-_MOST_LINES:])

    def _hear(self, told: dict[str, Any]) -> None:
        if "note" in told:
            self._tell(as_text(told))
        elif "doing" in told:
            self._stands.text = told["doing"]
        else:
            self._stands.text = f"{told['phase']:<10}{as_text(told)}"
            self._draw("flies", [told["latitude"], told["longitude"]])

    async def _debrief(self, event: events.UploadEventArguments) -> None:
        self._log.reset()
        name, shown = event.file.name, self._debriefing
        if (result := self._result) is None:
            shown.text = "the flight of the plan is not finished yet: drop it again"
            return
        shown.text = f"reading {name}"
        with tempfile.TemporaryDirectory() as folder:
            log = Path(folder) / f"log{Path(name).suffix}"
            try:
                await event.file.save(log)
                shown.text, places = await self._workers.long(debriefed, result, log, name)
            except Exception as error:
                shown.text = f"failed       {said(error)}"
                return
        self._draw("flown", places)


def _button(text: str, act: Callable[[], object]) -> ui.button:
    return ui.button(text, on_click=act).props("no-caps unelevated")
