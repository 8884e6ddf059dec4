"""The panel "Fly": upload, watch, arm and start, debrief; the vehicle and its track on the map."""

import asyncio
import tempfile
from collections.abc import Callable, Coroutine
from pathlib import Path
from typing import Any

from nicegui import events, ui

from faao_mav.app.planner import mistake
from faao_mav.app.vehicle import debriefed, uploaded, watched
from faao_mav.app.workers import Workers
from faao_mav.errors import FaaoError
from faao_mav.mavlink.flying.telling import as_text
from faao_mav.workflow import Result

_LARGEST_LOG = 2**30
"""Bytes of a log that is taken. Chosen: hours of flight."""

_MOST_LINES = 100
"""Lines of what has happened that are shown. Chosen."""

_ABOUT = """Upload reads the mission back and compares; Watch compares, then follows the vehicle on
the map. Neither arms nor starts it: while it is watched on the ground, Arm and start does, once you
confirm it."""


class Fly:
    """What is done with a vehicle: one thing at a time, with the mission of the finished flight.

    Setup, once: `Fly(workers, draw)`, where `draw` calls the map's method of a name; `show` is for
    a finished flight, `stale` for when the plan has changed since; at the end: `close`. A watch
    goes on with the flight with which it began.
    """

    def __init__(self, workers: Workers, draw: Callable[..., object]) -> None:
        self._workers, self._draw = workers, draw
        self._result: Result | None = None  # of the finished flight
        self._watched: Result | None = None
        self._task: asyncio.Task[None] | None = None
        self._arms, self._phase = False, ""
        self._interrupt = workers.event()
        with ui.tab_panel("Fly"):
            self._connection = ui.input("Connection", value="udpout:127.0.0.1:14550")
            self._connection.classes("w-full")
            with ui.row().classes("mt-2 gap-2"):
                self._upload_button = _button("Upload and verify", self._upload)
                self._watch_button = _button("Watch", self._begin_to_watch)
                self._arm_button = _button("Arm and start", self._ask_to_arm)
                self._leave_button = _button("Leave", self._leave)
            self._arm_button.props("color=red-9")
            self._stands = ui.label().classes("uploaded stands")
            self._told = ui.label().classes("uploaded").props('aria-live="polite"')
            ui.label(_ABOUT).classes("about mt-2")
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

    def show(self, result: Result) -> None:
        """Take `result` for the finished flight."""
        self._result = result
        self._enable()

    def close(self) -> None:
        """Watch no longer; the vehicle goes on with what it does."""
        if self._task is not None:
            self._task.cancel()

    def _enable(self) -> None:
        ready = self._result is not None and self._result.flyable and self._task is None
        self._upload_button.set_enabled(ready)
        self._watch_button.set_enabled(ready)
        self._arm_button.set_enabled(self._phase == "waiting")
        self._leave_button.set_enabled(self._watched is not None)
        holds = self._arms and self._phase in ("starting", "flying")
        self._leave_button.text = "Hold" if holds else "Leave"

    def _begin(self, work: Coroutine[Any, Any, str]) -> None:
        self._stands.text = self._told.text = ""
        self._task = asyncio.create_task(self._until_done(work))
        self._enable()

    async def _until_done(self, work: Coroutine[Any, Any, str]) -> None:
        try:
            self._tell(await work)
        except Exception as error:
            self._tell(_failure(error))
        finally:
            self._task = self._watched = None
            self._arms, self._phase = False, ""
            self._enable()

    def _tell(self, text: str) -> None:
        lines = [*self._told.text.splitlines(), *text.splitlines()]
        self._told.text = "\n".join(lines[-_MOST_LINES:])

    def _upload(self) -> None:
        if self._result is not None and self._task is None:
            asked = (self._result, str(self._connection.value))
            self._begin(asyncio.to_thread(uploaded, *asked))

    def _begin_to_watch(self) -> None:
        if self._result is not None and self._task is None:
            self._watch(self._result, arm=False)

    def _watch(self, result: Result, *, arm: bool) -> None:
        self._watched, self._arms = result, arm
        self._interrupt.clear()
        self._draw("flown", [])
        asked = (self._interrupt, result, str(self._connection.value), arm)
        self._begin(self._workers.talk(watched, self._hear, *asked))

    def _hear(self, told: dict[str, Any]) -> None:
        if "note" in told:
            self._tell(as_text(told))
            return
        self._phase, self._stands.text = told["phase"], f"{told['phase']:<10}{as_text(told)}"
        self._draw("flies", [told["latitude"], told["longitude"]])
        self._enable()

    def _leave(self) -> None:
        self._interrupt.set()

    async def _ask_to_arm(self) -> None:
        """Arm and start the vehicle that is watched, if that is confirmed."""
        with ui.dialog() as dialog, ui.card():
            ui.label(f"Arm the vehicle at {self._connection.value} and start its mission?")
            ui.label("Its propellers will turn, and it will take off, once its own checks pass and "
                     "no other ground station is on the link.")  # fmt: skip
            with ui.row():
                _button("Cancel", lambda: dialog.submit(False)).props("flat autofocus")
                _button("Yes, arm it", lambda: dialog.submit(True)).props("color=red-9")
        confirmed = await dialog
        dialog.delete()
        watched, task = self._watched, self._task
        if confirmed and watched is not None and task is not None and self._phase == "waiting":
            self._leave()
            await task
            self._watch(watched, arm=True)

    async def _debrief(self, event: events.UploadEventArguments) -> None:
        self._log.reset()
        if (result := self._result) is None:
            self._debriefing.text = "the flight of the plan is not finished yet: drop it again"
            return
        self._debriefing.text = f"reading {event.file.name}"
        with tempfile.TemporaryDirectory() as folder:
            log = Path(folder) / f"log{Path(event.file.name).suffix}"
            await event.file.save(log)
            try:
                told = await self._workers.long(debriefed, result, log, event.file.name)
            except Exception as error:
                self._debriefing.text = _failure(error)
                return
        self._debriefing.text, places = told
        self._draw("flown", places)


def _failure(error: Exception) -> str:
    said = str(error) if isinstance(error, FaaoError) else mistake(error)
    return f"failed       {said}"


def _button(text: str, act: Callable[[], object]) -> ui.button:
    return ui.button(text, on_click=act).props("no-caps unelevated")
