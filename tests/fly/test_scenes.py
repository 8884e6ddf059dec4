"""Flights on the mock as scenes: what is watched, what happens, what becomes of it.

A line of `tests/data/fly/scenes.txt` has three parts between bars. The first names

- what is flown: `watch` (a mission that others start), `mission` (armed and started), `far` (one
  with a place 111 s away), `hovering` (one that ends in the air), or a plan by setpoints: `low`,
  `hovers` (at its end), `swift`, `waiting`, `fenced` and `away` (from where the vehicle stands), on
  `both` kinds or one;
- parameters NAME=VALUE; options of the mock, `home=EAST,HIGHER` in metres; faults of the link, of
  which `loss` may have several values; `until`, s;
- `refuses`: the start is denied; `stays-armed`: it does not disarm when it lands, `keeps-armed`:
  nor when asked; `unwell`: it does not arm; `not-flyable`: it does not start; `elsewhere`.

The second tells what happens at a time or in a time, s: somebody else sets a mode or gives an
order, it hears the `answer` to one, a `parameter` is set, packets are `silence`, some messages are
lost (`loses`) or only their answers (`mutes`), all that the vehicle says waits for the end of a
`hold-up`, it denies arming (`unready`), tells the item under way late (`lag`) or no mode
(`modeless`), positions are changed. The third has the kind of the
ending, "-" for none, and what holds then: what was told (`says`), the ending's `text`, the gate's
findings (`finds`), modes, orders; `quiet`: nothing that moves it is sent from then on, `unmoved`:
no setpoint; `cancelled`: the last word ends a transfer. Nothing is sent in any scene that its
`Judge` calls wrong.
"""

from collections.abc import Iterator
from functools import partial
from typing import Any

import numpy as np
import pytest
from scenes import DATA, MODES, ORDERS, Scene, arms, foreseen, is_setpoint, staged, starts
from stations import VEHICLE
from trials import flown

from faao_mav.wire.messages import CommandLong, MissionAck
from faao_mav.wire.protocol import MavCommand, MavResult


@pytest.fixture(autouse=True)
def foreseen_once(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("faao_mav.autopilot.predict.predict", foreseen)


def rows() -> Iterator[Any]:
    """Yield each scene, for each kind of autopilot and each loss that it names."""
    for line in (DATA / "scenes.txt").read_text().splitlines():
        if line and not line.startswith("#"):
            who, happens, becomes = (part.strip() for part in line.split("|"))
            flies, kinds, *given = who.split()
            settings = dict(word.partition("=")[::2] for word in given)
            for kind in ("ardupilot", "px4") if kinds == "both" else (kinds,):
                for loss in settings.get("loss", "0").split(","):
                    one = {**settings, "loss": loss}
                    yield pytest.param(flies, kind, one, happens, becomes, id=f"{kind} {line}")


@pytest.mark.parametrize(("flies", "kind", "given", "happens", "becomes"), [*rows()])
def test_what_becomes_of_it(
    flies: str, kind: str, given: dict[str, str], happens: str, becomes: str
) -> None:
    scene = staged(flies, kind, given, happens)
    watch, mock, modes = scene.watch, scene.mock, MODES[kind]
    ending, *wanted = becomes.split(" & ")
    seen: dict[str, tuple[int, int, bool]] = {}

    def look(word: str, _: float) -> None:
        seen[word] = len(scene.orders), mock.mode, mock.armed

    words = {word for each in wanted for word in each.split() if word.replace(".", "").isdigit()}
    assert scene.run([(float(word), partial(look, word)) for word in sorted(words)]) == ending
    assert scene.client.wrong == []
    outcome, findings = watch.outcome, watch.gate.findings or ()
    texts: dict[str, Any] = {
        "says": watch.seen.told,
        "text": [] if outcome is None else [outcome.text],
        "finds": [f"{each.rule} {each.message} {each.action}" for each in findings],
    }
    for each in wanted:
        first, _, rest = each.partition(" ")
        match first:
            case "says" | "text" | "finds":
                assert any(rest in text for text in texts[first])
            case "not":
                assert not any(rest.removeprefix("says ") in text for text in texts["says"])
            case "once":
                assert sum(rest in text for text in texts["says"]) == 1
            case "ends":
                assert outcome.text.endswith(rest)
            case "no":
                assert scene.orders == []
            case "orders" | "exactly":
                once = first == "orders"
                given_orders = [*dict.fromkeys(scene.commands)] if once else scene.commands
                assert given_orders == [ORDERS[word.lower()] for word in rest.split()]
            case "cancelled":
                cancelled = MissionAck(VEHICLE, 0, MavResult.OPERATION_CANCELLED)
                assert scene.client.sent[-1] == cancelled
            case "quiet" | "busy":
                assert (len(scene.orders) > seen[rest][0]) == (first == "busy")
            case "unmoved":
                assert scene.after(*map(float, rest.split("-"))) == 0
            case "moved":
                assert scene.after(float(rest)) > 50
            case "level":
                heights = [up for t, up in scene.client.setpoints if t > float(rest)]
                assert max(abs(up - 6.0) for up in heights) < 0.2
            case "in":
                sent: list[Any] = [*filter(is_setpoint, scene.client.sent)]
                assert sent == sorted(sent, key=lambda setpoint: setpoint.time_boot_ms)
            case "arrived":
                assert scene.solution is not None
                last = watch.seen.record().line(scene.solution).w[-1]
                assert np.linalg.norm(last - scene.solution.w[-1]) < 1.0
            case "heard":
                assert watch.seen.fixes[-1].t > float(rest)
            case "armed" | "disarmed":
                assert mock.armed == (first == "armed")
            case "end":
                assert mock.mode == modes[rest.removeprefix("mode ")]
            case _ if rest.startswith("mode "):
                assert seen[first][1] == modes[rest.removeprefix("mode ")]
            case _:
                assert rest == "disarmed"
                assert seen[first][2] is False


@pytest.mark.parametrize(
    "seed", [pytest.param(n, marks=[pytest.mark.slow] * (n >= 4)) for n in range(30)]
)
def test_in_no_trouble_what_must_not_happen_does(seed: int) -> None:
    """The first flights that meet trouble at random: any number of seeds can be flown."""
    assert flown(seed) == []


# ---- what no words of scenes say


def test_an_interrupt_while_an_order_is_given_takes_it_back() -> None:
    """Ctrl-C comes anywhere: here between the order to arm, or to start, and its sending."""
    for ordered, then in ((arms, [ORDERS["disarm"]]), (starts, [(MavCommand.SET_MODE, 1.0)])):
        scene = Scene("ardupilot", arm=True)
        said = scene.watch._said

        def interrupted(watch: Any = scene.watch, ordered: Any = ordered, said: Any = said) -> Any:
            if any(ordered(message) for message in watch._out):
                watch._said = said
                raise KeyboardInterrupt
            return said()

        scene.watch._said = interrupted
        with pytest.raises(KeyboardInterrupt):
            scene.run()
        orders = [each for each in scene.watch.cancel(100.0) if isinstance(each, CommandLong)]
        assert [(each.command, each.param1) for each in orders] == then
