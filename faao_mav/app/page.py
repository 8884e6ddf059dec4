"""The page of one window: the map, the plan beside it, what the flight delivers, and its files."""

from collections.abc import Callable
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
from nicegui import events, run, ui

from faao_mav.app import charts
from faao_mav.app.answers import FILES, Answer, made
from faao_mav.app.document import Document, problems_of
from faao_mav.app.form import Form, fields
from faao_mav.app.guard import TILES
from faao_mav.app.map import PlannerMap
from faao_mav.app.planner import Planner, Workers
from faao_mav.app.scene import STATIONS, Scene
from faao_mav.app.uploading import uploaded
from faao_mav.errors import FaaoError, PlanError
from faao_mav.plan.yaml_text import MAX_CHARACTERS

_ATTRIBUTION = '&copy; <a href="https://openstreetmap.org/copyright">OpenStreetMap</a> contributors'

_DRAWN = (("circle", False), ("polygon", False), ("circle", True), ("polygon", True))
"""Zones that can be drawn: shape, and whether the aircraft has to stay inside."""


class Page:
    """One window: its own document, its own answers.

    Setup, once: `build`; then each event changes the document and ends in `_changed`, which asks
    for answers; `_show` takes them.
    """

    def __init__(self, document: Document, path: Path | None, workers: Workers) -> None:
        self._document, self._path, self._workers = document, path, workers
        self._planner = Planner(workers, self._show)
        self._answer, self._gestures = Answer(), 0
        self._form = Form(lambda: self._document, self._changed)

    def build(self) -> None:
        """Make the elements of the page."""
        ui.add_css(files("faao_mav.app").joinpath("page.css").read_text(encoding="utf-8"))
        self._dark = ui.dark_mode(None)
        self._bar()
        with ui.element("main").classes("planner"):
            with ui.element("section").classes("left"):
                self._map_part()
            with ui.element("section").classes("right"):
                self._side_part()
        ui.keyboard(self._key)
        ui.context.client.on_disconnect(self._planner.close)

    def _bar(self) -> None:
        with ui.element("header").classes("bar"):
            self._name = ui.label().classes("name")
            self._told = ui.label().classes("rate").props('aria-live="polite"')
            ui.space()
            self._undo = _button("undo", "Undo (Ctrl+Z)", lambda: self._step(self._document.undo))
            self._redo = _button("redo", "Redo (Ctrl+Y)", lambda: self._step(self._document.redo))
            _button("folder_open", "Open a plan", self._open_dialog)
            if self._path is not None:
                _button("save", f"Save {self._path.name} (Ctrl+S)", self._save)
            with _button("download", "Download", lambda: None), ui.menu():
                name = Path(self._document.source).name
                ui.menu_item("Plan (.yaml)", lambda: ui.download.content(self._document.text, name))
                for wanted, label in FILES.items():
                    ui.menu_item(label, lambda wanted=wanted: self._download(wanted))
            _button("dark_mode", "Light or dark", self._dark.toggle)

    def _map_part(self) -> None:
        with ui.element("div").classes("tools"):
            for shape, inside in _DRAWN:
                label = f"{'Stay in' if inside else 'Stay out of'} a {shape}: click on the map"
                icon = "crop_square" if shape == "polygon" else "circle"
                draw = self._method("draw", shape, inside)
                _button(icon, label, draw).classes("in" if inside else "out")
            _button("delete", "Delete the chosen zone (Del)", self._method("remove_selected"))
            _button("center_focus_strong", "Show all", lambda: self._draw_scene(fit=True))
            ui.switch("Background", on_change=self._background).tooltip(
                "OpenStreetMap: the parts of the map that you look at are asked for from "
                f"{TILES.removeprefix('https://')}"
            )
        self._map = PlannerMap()
        self._map.on("ready", self._ready)
        self._map.on("moved", self._moved)
        self._map.on("zone", self._zone)
        self._map.on("removed", lambda e: self._remove(e.args["key"]))
        self._map.on("cursor", lambda e: self._cursor(e.args["at"]))
        self._where = ui.label().classes("where")
        with ui.element("div").classes("time"):
            self._slider = ui.slider(min=0, max=1, value=0, on_change=self._at_time)
            self._slider.props('aria-label="Time of the flight"')
            self._now = ui.label().classes("where")
        self._chart = ui.echart(charts.options({}, "")).style(f"height: {charts.HEIGHT}px")

    def _side_part(self) -> None:
        self._failed = ui.label().classes("failed").props('role="alert"')
        with ui.tabs().props("dense align=justify") as tabs:
            for tab in ("Plan", "Result", "Findings", "Upload"):
                ui.tab(tab)
        with ui.tab_panels(tabs, value="Plan", keep_alive=True).classes("w-full"):
            with ui.tab_panel("Plan"):
                self._form.build()
            with ui.tab_panel("Result"):
                self._facts = ui.element("dl").classes("facts")
            with ui.tab_panel("Findings"):
                self._findings = ui.column().classes("findings")
            with ui.tab_panel("Upload"):
                ui.label("The mission is put on the vehicle, read back and compared. It is not "
                         "armed or started.")  # fmt: skip
                self._connection = ui.input("Connection", value="udpout:127.0.0.1:14550")
                self._connection.classes("w-full")
                self._upload_button = ui.button("Upload and verify", on_click=self._upload)
                self._uploaded = ui.label().classes("uploaded").props('aria-live="polite"')

    def _ready(self) -> None:
        self._form.show()
        self._draw_scene(fit=True)
        self._changed(soon=False)

    def _changed(self, *, soon: bool = True) -> None:
        """Ask for what the document leads to; what was found before is no longer of it."""
        self._answer = Answer(drawing=self._answer.drawing, series=self._answer.series)
        self._form.show()
        self._draw_scene()
        self._name.text = self._document.shown(("name",)) or Path(self._document.source).name
        self._undo.set_enabled(self._document.can_undo)
        self._redo.set_enabled(self._document.can_redo)
        self._upload_button.set_enabled(False)
        self._planner.ask(self._document.text, self._document.source, soon=soon)

    def _show(self, answer: Answer) -> None:
        problems = {}
        if answer.refused:
            paths = [key.path for key in fields()]
            problems = problems_of(PlanError(answer.refused), self._document.source, paths)
        self._form.tell(problems)
        self._failed.text = answer.failed or "\n".join(
            f"{path}: {problem}" if path else problem for path, problem in problems.items()
        )
        if not answer.drawing:
            self._told.text = "no flight"
            self._map.run_method("clear_flight")
            return
        self._answer = answer
        data = "" if answer.megabytes is None else f", {answer.megabytes:,.1f} MB"
        state = "" if answer.result is not None else " (rough)"
        self._told.text = f"delivers {answer.delivered:.4f} bit/s/Hz{data}{state}"
        self._told.props["data-delivered"] = repr(answer.delivered)
        self._map.run_method("flight", answer.drawing)
        unit = "bit/Hz" if answer.megabytes is None else "MB"
        self._chart.options.update(charts.options(answer.series, unit))
        self._chart.update()
        self._slider.props["max"] = len(answer.series["t"]) - 1
        self._slider.update()
        if answer.result is not None:
            self._show_result(answer)

    def _show_result(self, answer: Answer) -> None:
        from faao_mav.report.summary import by_rule, message_of, result_lines

        result = answer.result
        assert result is not None
        self._upload_button.set_enabled(result.flyable)
        self._facts.clear()
        with self._facts:
            for label, text in result_lines(result):
                _text("dt", label)
                _text("dd", text)
        self._findings.clear()
        with self._findings:
            if result.no_mission is not None:
                ui.label(str(result.no_mission)).classes("error")
            elif not result.findings:
                ui.label("None: nothing speaks against the mission.")
            for group in by_rule(result.findings):
                with ui.element("div").classes(f"finding {group[0].level}"):
                    ui.label(f"{group[0].level}: {message_of(group)}")
                    ui.label(group[0].action).classes("about")
                    for each in group:
                        place = self._place_of_item(each.item)
                        if place:
                            focus = self._method("focus", place)
                            ui.button(f"item {each.item}", on_click=focus).props("flat dense")

    def _place_of_item(self, number: int | None) -> list[float] | None:
        result = self._answer.result
        if number is None or result is None or result.conversion is None:
            return None
        item = result.conversion.mission.items[number - 1]
        return [item.x, item.y] if item.x or item.y else None

    def _draw_scene(self, *, fit: bool = False) -> None:
        scene = Scene(self._document)
        self._map.run_method("scene", scene.stations(), scene.zones(), fit)

    def _moved(self, event: events.GenericEventArguments) -> None:
        kind, at, done = (event.args[key] for key in ("key", "at", "done"))
        if kind in STATIONS:
            Scene(self._document).move(kind, at, (kind, self._gestures))
            self._cursor(at)
            self._end(done)

    def _zone(self, event: events.GenericEventArguments) -> None:
        told = event.args
        Scene(self._document).change(told, (told["key"], self._gestures))
        self._end(told["done"])

    def _end(self, done: bool) -> None:
        """Take what comes next for another step of undo where a drag is done."""
        self._gestures += bool(done)
        self._changed()

    def _remove(self, key: str) -> None:
        Scene(self._document).remove(key)
        self._changed()

    def _cursor(self, at: list[float]) -> None:
        frame = Scene(self._document).frame
        if frame is None:
            return
        east, north = frame.to_local(*at).tolist()
        scene = Scene(self._document)
        text = f"{east:.1f} m east, {north:.1f} m north ({at[0]:.6f}, {at[1]:.6f})"
        for station in scene.stations()[:2]:
            apart = np.hypot(*(frame.to_local(*at) - frame.to_local(*station["at"])))
            text += f"; {station['label'].lower()} {apart:.0f} m"
        self._where.text = text

    def _at_time(self, event: events.ValueChangeEventArguments[Any]) -> None:
        series, k = self._answer.series, int(event.value)
        if not series or k >= len(series["t"]):
            return
        self._map.run_method("place_aircraft", self._answer.drawing["places"][k])
        self._chart.run_chart_method(
            "dispatchAction", {"type": "showTip", "seriesIndex": 0, "dataIndex": k}
        )
        self._now.text = (
            f"{series['t'][k]:.1f} s: {series['east'][k]:.1f} m east, {series['north'][k]:.1f} m "
            f"north, {series['speed'][k]:.2f} m/s"
        )

    def _background(self, event: events.ValueChangeEventArguments[Any]) -> None:
        url = f"{TILES}/{{z}}/{{x}}/{{y}}.png" if event.value else None
        self._map.run_method("background", url, _ATTRIBUTION)

    def _method(self, name: str, *arguments: object) -> Callable[[], object]:
        return lambda: self._map.run_method(name, *arguments)

    def _step(self, step: Callable[[], None]) -> None:
        step()
        self._changed()

    def _key(self, event: events.KeyEventArguments) -> None:
        if not (event.action.keydown and (event.modifiers.ctrl or event.modifiers.meta)):
            return
        if event.key == "z" and not event.modifiers.shift:
            self._step(self._document.undo)
        elif event.key in ("y", "Z", "z"):
            self._step(self._document.redo)
        elif event.key == "s" and self._path is not None:
            self._save()

    def _open_dialog(self) -> None:
        async def opened(event: events.UploadEventArguments) -> None:
            try:
                content = (await event.file.read()).decode("utf-8-sig")
                self._document.replace(content, event.file.name)
            except (PlanError, UnicodeDecodeError) as error:
                ui.notify(str(error), type="negative", multi_line=True)
                return
            dialog.close()
            self._changed(soon=False)
            self._draw_scene(fit=True)

        with ui.dialog() as dialog, ui.card():
            ui.label("Open a plan")
            ui.upload(on_upload=opened, auto_upload=True, max_file_size=4 * MAX_CHARACTERS).props(
                "accept=.yaml,.yml"
            )
        dialog.open()

    def _save(self) -> None:
        assert self._path is not None
        try:
            self._document.save(self._path)
        except FaaoError as error:
            ui.notify(str(error), type="negative", multi_line=True)
            return
        ui.notify(f"{self._path.name} saved", type="positive")

    async def _download(self, wanted: str) -> None:
        result = self._answer.result
        if result is None:
            ui.notify("The flight is not finished yet", type="warning")
            return
        try:
            name, content = await self._workers.run("finished", made, result, wanted)
        except FaaoError as error:
            ui.notify(str(error), type="negative", multi_line=True)
            return
        ui.download.content(content, name)

    async def _upload(self) -> None:
        if self._answer.result is None:
            return
        self._upload_button.disable()
        self._uploaded.text = "Uploading"
        where = str(self._connection.value)
        self._uploaded.text = await run.io_bound(uploaded, self._answer.result, where) or ""
        self._upload_button.set_enabled(self._answer.result is not None)


def _button(icon: str, tip: str, act: Callable[[], object]) -> ui.button:
    button = ui.button(icon=icon, on_click=act).props(f'flat dense round aria-label="{tip}"')
    return button.tooltip(tip)


def _text(tag: str, text: Any) -> None:
    """Add an element with a text, which is no HTML."""
    with ui.element(tag):
        ui.label(str(text))
