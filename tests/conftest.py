"""What all tests share."""

import gc
import os
import socket
from collections.abc import Callable
from dataclasses import fields
from functools import partial, wraps
from pathlib import Path
from typing import Any

import pytest
from hypothesis import HealthCheck, settings
from hypothesis.internal.conjecture import providers
from xdist.scheduler import LoadScopeScheduling

# As the command does, and before NumPy is imported.
os.environ.setdefault("OMP_NUM_THREADS", "1")

from faao_mav import workflow
from faao_mav.optimizer import optimize as solver
from faao_mav.optimizer.search import bound
from faao_mav.optimizer.search.map_bound import map_bound
from faao_mav.plan import Plan, parse_plan
from faao_mav.plan.model import PlanContents
from faao_mav.plan.yaml_text import dump_yaml, load_yaml

# Hypothesis tries numbers that it reads in the project's modules loaded so far. Which are loaded
# depends on how the tests are shared out among processes: without them, examples are the same.
setattr(providers, "is_local_module_file", lambda _: False)  # noqa: B010

settings.register_profile(
    "deterministic",
    max_examples=30,
    deadline=None,
    derandomize=True,
    database=None,
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.function_scoped_fixture],
)
settings.load_profile("deterministic")

PATIENCE = 300.0
"""How long a test waits for another process, s: on a busy machine, only a failure takes so long."""

MISSIONS = Path(__file__).parent.parent / "missions"

SMALL = """
site: {origin: {latitude: -35.363262, longitude: 149.165237, elevation: 584.0}}
vehicle: {max_speed: 20, max_acceleration: 5}
flight:
  start: [0, 50]
  end: [50, 0]
  altitude: 40
  duration: 10
  time_step: 0.5
radio:
  base_station: {position: [0, 0], power_dbm: 10}
  relay: {power_dbm: 10, noise_dbm: -80}
  ground_user: {position: [60, 60], noise_dbm: -80}
  causal: false
"""
"""Twenty slots in the active region, for R_avg of the paper: solved in a second."""

FLYABLE = SMALL.replace("max_speed: 20", "max_speed: 10") + "  fading: none\n"
"""The small plan within what ArduCopter flies, in the line of sight: made in half a second."""

SHORT = {
    "vehicle.max_speed": 8.0,
    "vehicle.max_acceleration": 1.5,
    "flight.start": [0, 30],
    "flight.end": [30, 0],
    "flight.altitude": 40,
    "flight.duration": 14,
    "flight.time_step": 0.5,
    "radio.ground_user.position": [40, 40],
}
"""Of the sample plans: seconds of flight, at a copter's speeds."""

MakePlan = Callable[..., Plan]


def edited(text: str, changes: dict[str, Any]) -> str:
    """Return the YAML `text` with the values at the dotted keys of `changes` replaced."""
    data = load_yaml(text, "test")
    for path, value in changes.items():
        *parents, last = path.split(".")
        section = data
        for key in parents:
            section = section.setdefault(key, {})
        section[last] = value
    return dump_yaml(data)


def changes_in(path: Path) -> dict[str, dict[str, Any]]:
    """Return the changes of plans in a YAML file by name, over those of which each is `like`."""
    found: dict[str, dict[str, Any]] = {}
    for name, changes in load_yaml(path.read_text(), path.name).items():
        found[name] = found.get(changes.pop("like", ""), {}) | changes
    return found


def contents(plan: Plan) -> dict[str, Any]:
    """Return what `plan` holds by section, without its text and the name of its file."""
    return {each.name: getattr(plan, each.name) for each in fields(PlanContents)}


def free_port(kind: int = socket.SOCK_DGRAM) -> int:
    """Return a free port of the loopback interface."""
    with socket.socket(socket.AF_INET, kind) as probe:
        probe.bind(("127.0.0.1", 0))
        port: int = probe.getsockname()[1]
        return port


@pytest.fixture(scope="session")
def small_plan() -> MakePlan:
    """Make the small plan with some keys replaced: `small_plan({"radio.seed": 1})`."""

    def make(changes: dict[str, Any] | None = None) -> Plan:
        return parse_plan(edited(SMALL, changes or {}))

    return make


@pytest.fixture(scope="session")
def paper_plan(small_plan: MakePlan) -> MakePlan:
    """Make the small plan for Algorithm 1 and a known draw, with some keys replaced."""

    def make(changes: dict[str, Any] | None = None) -> Plan:
        paper = {"optimizer.method": "algorithm1", "radio.fading": "realization"}
        return small_plan(paper | (changes or {}))

    return make


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> LoadScopeScheduling:
    """Share tests out one by one, but for those that share a server or fly real autopilots."""

    class OneFlightAtATime(LoadScopeScheduling):  # type: ignore[misc]
        def _split_scope(self, nodeid: str) -> str:
            together = ("tests/real_autopilots/", "tests/app/test_app.py")
            return next((each for each in together if nodeid.startswith(each)), nodeid)

    return OneFlightAtATime(config, log)


_SOLVED: dict[object, Any] = {}


@pytest.fixture
def planned_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Plans of the same text are solved for the first who asks."""

    def once(work: Callable[..., Any]) -> Callable[..., Any]:
        @wraps(work)  # doctests are those of `work`
        def solve(plan: Plan, *, observe: Any = None, bound: bool = False, **parts: Any) -> Any:
            del observe
            options = parts | ({"bound": True} if bound else {})
            if parts:
                return work(plan, **options)
            asked = (work, plan.text, plan.optimizer.method, bound)
            if asked not in _SOLVED:
                _SOLVED[asked] = work(plan, **options)
            return _SOLVED[asked]

        return solve

    monkeypatch.setattr(solver, "optimize", once(solver.optimize))
    monkeypatch.setattr(workflow, "plan_mission", once(workflow.plan_mission))


@pytest.fixture
def coarse_map(monkeypatch: pytest.MonkeyPatch) -> None:
    """A map with a tenth of the cells: the certificate is a little higher, and quicker."""
    monkeypatch.setattr(bound, "map_bound", partial(map_bound, cells=3_000))


@pytest.fixture
def unpainted(monkeypatch: pytest.MonkeyPatch) -> None:
    """Pages without their pictures, which take longest."""
    monkeypatch.setattr("faao_mav.report.page.inline_svg", lambda *_: "<svg></svg>")


@pytest.fixture(scope="session")
def autopilots(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder with the real autopilots, their simulators and runners; skips without one."""
    from simulators import usable

    named = os.environ.get("FAAO_AUTOPILOTS")
    if named is None:
        pytest.skip("FAAO_AUTOPILOTS does not name a folder with the real autopilots")
    return usable(Path(named), tmp_path_factory.mktemp("autopilots"))


def pytest_collection_finish() -> None:
    gc.freeze()  # nothing of what is imported is garbage
