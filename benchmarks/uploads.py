"""How long uploads take over links that lose packets, beside MAVSDK, in one run.

    python benchmarks/uploads.py [--quick]

Both upload the same missions to the same mock autopilot over loopback UDP that loses packets both
ways, from the same seeds. MAVSDK uploads only; ours reads back and compares as well, which is
counted apart. "right" is what the mock holds afterwards, by its own storage.
"""

import argparse
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
sys.path.insert(0, str(Path(__file__).parents[1] / "tests" / "wire"))

from conftest import free_port
from mavsdk.component_type import ComponentType
from mavsdk.mavsdk import Configuration, Mavsdk
from mavsdk.plugins.mission_raw import MissionItem as SdkItem
from mavsdk.plugins.mission_raw import MissionRaw, MissionRawError
from served import running
from stations import HOME, a_mission, places

from faao_mav.errors import LinkError
from faao_mav.sim import MockAutopilot, MockKind, behaviour_of
from faao_mav.sim.faults import Faults
from faao_mav.wire import upload
from faao_mav.wire.protocol import MissionType
from faao_mav.wire.wire_items import wire_items

KINDS: tuple[MockKind, ...] = ("px4", "ardupilot")


def ours(kind: MockKind, count: int, faults: Faults) -> tuple[str, float, float, bool]:
    """Return what our client says, its upload and read-back times (s), and whether it is right."""
    mock, port, stages = a_mock(kind), free_port(), dict[str, float]()

    def observe(what: str, done: int, total: int) -> None:
        stages.setdefault(what.split()[0], time.monotonic())

    with running(mock, f"udpin:127.0.0.1:{port}", faults=faults):
        try:
            report = upload(a_mission(count), f"udpout:127.0.0.1:{port}", system=1, observe=observe)
            said: str = report.parts[0].verdict
        except LinkError as error:
            said = str(error)
    end = time.monotonic()
    read = stages.get("reading", end)
    return said, read - stages.get("uploading", end), end - read, is_right(mock, count)


def mavsdk(kind: MockKind, count: int, faults: Faults) -> tuple[str, float, float, bool]:
    """Return the same of MAVSDK, which does not read back."""
    mock, port = a_mock(kind), free_port()
    rows = wire_items(a_mission(count), MissionType.MISSION, mock.vehicle)
    items = [
        SdkItem(seq, r.frame, r.command, r.current, 1, *r.params, r.x, r.y, r.z, 0)
        for seq, r in enumerate(rows)
    ]
    with a_mavsdk(port) as sdk, running(mock, f"udpout:127.0.0.1:{port}", faults=faults):
        system = sdk.first_autopilot(20.0)
        if system is None:
            return "no vehicle", 0.0, 0.0, False
        client = MissionRaw(system)
        begin = time.monotonic()
        try:
            client.upload_mission(items)
            said = "success"
        except MissionRawError as error:
            said = str(error).split(";")[0][:30]
        took = time.monotonic() - begin
    return said, took, 0.0, is_right(mock, count)


@contextmanager
def a_mavsdk(port: int) -> Iterator[Mavsdk]:
    sdk = Mavsdk(Configuration.create_with_component_type(ComponentType.GROUND_STATION))
    try:
        sdk.add_any_connection(f"udpin://127.0.0.1:{port}")
        yield sdk
    finally:
        sdk.destroy()


def a_mock(kind: MockKind) -> MockAutopilot:
    return MockAutopilot(behaviour_of(kind), home=HOME, beat=0.1)


def is_right(mock: MockAutopilot, count: int) -> bool:
    rows = wire_items(a_mission(count), MissionType.MISSION, mock.vehicle)
    return places(mock.lists.items(MissionType.MISSION)) == places(rows)


Client = Callable[[MockKind, int, Faults], tuple[str, float, float, bool]]
CLIENTS: dict[str, Client] = {"faao-mav": ours, "MAVSDK 4.1.0": mavsdk}


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--quick", action="store_true", help="40 items only")
    parser.add_argument("--seeds", type=int, default=1)
    options = parser.parse_args()
    print("| mock | items | loss | client | says | right | upload, s | read back, s |")
    print("|---|---|---|---|---|---|---|---|")
    for kind in KINDS:
        for count in (40,) if options.quick else (40, 650):
            for loss in (0.0, 0.05, 0.2):
                for seed in range(options.seeds):
                    for name, client in CLIENTS.items():
                        faults = Faults(loss=loss, latency=0.0, seed=seed)
                        said, took, read, right = client(kind, count, faults)
                        back = f"{read:.2f}" if read else "-"
                        print(
                            f"| {kind} | {count} | {loss:.0%} | {name} | {said} "
                            f"| {'yes' if right else 'no'} | {took:.2f} | {back} |",
                            flush=True,
                        )


if __name__ == "__main__":
    main()
