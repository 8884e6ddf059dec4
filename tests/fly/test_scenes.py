"""Flights on the mock as scenes: what is watched, what happens, what becomes of it.

A line of `tests/data/fly/scenes.txt` has three parts between bars. The first names

- what is flown: `watch` (a mission that others start), `mission` (armed and started), `far` (one
  with a place 111 s away), `hovering` (one that ends in the air), or a plan by setpoints: `low`,
  `hovers` (at its end), `swift`, `waiting`, `fenced` and `away` (from where the vehicle stands), on
  `both` kinds or one;
- parameters NAME=VALUE; options of the mock, `home=EAST,HIGHER` in metres; faults of the link, of
  which `loss` may have several values; `until`, s;
- `refuses`: the start is denied; `stays-armed`: it does not disarm when it lands; `elsewhere`.

The second tells what happens at a time or in a time, s: somebody else sets a mode or gives an
order, packets are `silence`, some messages are lost (`loses`) or only their answers (`mutes`), all
that the vehicle says waits for the end of a `hold-up`, it denies arming (`unready`), tells the item
under way late (`lag`), positions are changed. The third has the kind of the ending, "-" for none,
and what holds then: what was told (`says`), the ending's `text`, the gate's findings (`finds`),
modes, orders; `quiet`: nothing that moves it is sent from then on, `unmoved`: no setpoint. Nothing
is sent in any scene that its `Judge` calls wrong.
"""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scenes import MODES, ORDERS, is_setpoint, staged
from trials import Trial, flown

SCENES = Path(__file__).parents[1] / "data" / "fly" / "scenes.txt"


def rows() -> Iterator[Any]:
    """Yield each scene, for each kind of autopilot and each loss that it names."""
    for line in SCENES.read_text().splitlines():
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
    seen: dict[str, Any] = {}
    looks: list[tuple[float, Callable[[float], object]]] = []

    def look(name: str, at: float, what: Callable[[], Any]) -> None:
        looks.append((at, lambda _: seen.__setitem__(name, what())))

    for each in wanted:
        first, *words = each.split()
        if first in ("quiet", "busy"):
            look(each, float(words[0]), lambda: len(scene.orders))
        elif words[:1] == ["mode"] and first[0].isdigit():
            look(each, float(first), lambda: mock.mode)
        elif words == ["disarmed"]:
            look(each, float(first), lambda: mock.armed)
    assert scene.run(looks) == ending
    assert scene.client.wrong == []
    outcome, findings = watch.outcome, watch.gate.findings or ()
    texts: dict[str, Any] = {
        "says": watch.seen.told,
        "text": [] if outcome is None else [outcome.text],
        "finds": [f"{each.rule} {each.message} {each.action}" for each in findings],
    }
    for each in wanted:
        first, *words = each.split()
        rest = " ".join(words)
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
                given_orders = scene.commands
                if first == "orders":
                    given_orders = list(dict.fromkeys(given_orders))
                assert given_orders == [ORDERS[word.lower()] for word in words]
            case "quiet":
                assert len(scene.orders) == seen[each]
            case "busy":
                assert len(scene.orders) > seen[each]
            case "unmoved":
                assert scene.after(*map(float, rest.split("-"))) == 0
            case "moved":
                assert scene.after(float(rest)) > 50
            case "level":
                heights = [up for t, up in scene.client.setpoints if t > float(rest)]
                assert max(abs(up - 6.0) for up in heights) < 0.2
            case "in":
                sent: list[Any] = [*filter(is_setpoint, scene.client.sent)]
                times = [each.time_boot_ms for each in sent]
                assert times == sorted(times)
            case "arrived":
                assert scene.solution is not None
                last = watch.seen.record().line(scene.solution).w[-1]
                assert np.linalg.norm(last - scene.solution.w[-1]) < 1.0
            case "heard":
                assert watch.seen.fixes[-1].t > float(rest)
            case "armed" | "disarmed":
                assert mock.armed == (first == "armed")
            case "end":
                assert mock.mode == modes[words[1]]
            case _ if words[0] == "mode":
                assert seen[each] == modes[words[1]]
            case _:
                assert words == ["disarmed"]
                assert seen[each] is False


@pytest.mark.parametrize(
    "seed", [pytest.param(n, marks=[pytest.mark.slow] * (n >= 4)) for n in range(30)]
)
def test_in_no_trouble_what_must_not_happen_does(seed: int) -> None:
    """The first flights that meet trouble at random: any number of seeds can be flown."""
    assert flown(Trial.of(seed)).wrong == []
