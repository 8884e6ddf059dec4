"""The panel "Fly": upload, watch, the command that flies, debrief; the vehicle on the map."""

import asyncio
import tempfile
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

from nicegui import events, ui

from faao_mav.app.vehicle import MISSION, debriefed, fly_command, uploaded, watched
from faao_mav.app.workers import Workers, said, talk
from faao_mav.fly.fly import as_text
from faao_mav.workflow import Result

_LARGEST_LOG = 2**30
"""Bytes of a log that is taken. Chosen: hours of flight."""

_MOST_LINES = 100
"""Lines of what has happened that are shown. Chosen."""

_ABOUT = """Upload reads the mission back and compares; Watch compares, then follows the vehicle on
the map, and may be left or closed at any time. Neither arms nor starts it."""

_HOW = f"Arm and start on the command line, in the folder to which {MISSION} was downloaded:"


class Fly:
    """What is done with a vehicle: one thing at a time, with the mission of the finished flight.

    Setup, once: `Fly(workers, draw, download)`, where `draw` calls the map's method of a name and
    `download` sends the browser the file of a name; `show` is for a finished flight, `stale` for
    when the plan has changed since; at the end: `close`. A watch goes on with the flight with
    which it began.
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
                self._upload_button = _button("Upload and verify", lambda: self._begin(uploaded))
                self._watch_button = _button("Watch", self._watch)
                self._leave_button = _button("Leave", self._interrupt.set)
            self._stands = ui.label().classes("uploaded stands")
            self._told = ui.label().classes("uploaded").props('aria-live="polite"')
            ui.label(_ABOUT).classes("about mt-2")
            with ui.element("div").classes("to-fly") as self._to_fly:
                ui.label(_HOW).classes("about")
                self._command = ui.label().classes("command")
                with ui.row().classes("gap-2"):
                    _button(f"Download {MISSION}", lambda: download(MISSION))
                    _button("Copy", lambda: ui.clipboard.write(self._command.text))
            ui.separator().classes("my-3")
            self._log = ui.upload(
                label="Debrief: drop a log (.bin, .tlog, .ulg)",
                on_upload=self._debrief, auto_upload=True, max_file_size=_LARGEST_LOG,
            )  # fmt: skip
            self._log.props("accept=.bin,.tlog,.ulg flat bordered").classes("w-full log")
            self._debriefing = ui.label().classes("uploaded debriefing")
        self._enable()

    def stale(self) -> None:
        """Take the finished flight for that of another plan: nothing new is done with it."""
        self._result = None
        self._enable()

    def show(self, result: Result, file: Path | None) -> None:
        """Take `result` for the finished flight; `file` has its plan, where one has."""
        self._result, self._file = result, file
        self._enable()

    def close(self) -> None:
        """Watch no longer, and cancel an upload; the vehicle goes on with what it does."""
        if self._task is not None:
            self._task.cancel()

    def _enable(self) -> None:
        flyable = self._result is not None and self._result.flyable
        self._upload_button.set_enabled(flyable and self._task is None)
        self._watch_button.set_enabled(flyable and self._task is None)
        self._leave_button.set_enabled(self._task is not None)
        self._command.text = fly_command(str(self._connection.value), self._file)
        self._to_fly.set_visibility(flyable and bool(self._command.text))

    def _begin(self, work: Callable[..., str]) -> None:
        """Do `work` with the mission and the connection as they stand now."""
        if self._result is not None and self._task is None:
            asked = (self._result, str(self._connection.value))
            self._task = asyncio.create_task(self._until_done(work, *asked))
            self._stands.text = self._told.text = ""
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

    def _watch(self) -> None:
        self._draw("flown", [])
        self._begin(watched)

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
        if (result := self._result) is None:
            self._debriefing.text = "the flight of the plan is not finished yet: drop it again"
            return
        self._debriefing.text = f"reading {event.file.name}"
        with tempfile.TemporaryDirectory() as folder:
            log = Path(folder) / f"log{Path(event.file.name).suffix}"
            try:
                await event.file.save(log)
                told = await self._workers.long(debriefed, result, log, event.file.name)
            except Exception as error:
                self._debriefing.text = f"failed       {said(error)}"
                return
        self._debriefing.text, places = told
        self._draw("flown", places)


def _button(text: str, act: Callable[[], object]) -> ui.button:
    return ui.button(text, on_click=act).props("no-caps unelevated")
