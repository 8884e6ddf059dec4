"""How long uploads take over links that lose packets, beside MAVSDK, in one run.

    python benchmarks/uploads.py [--quick]

Both upload the same missions to the same mock autopilot over loopback UDP that loses packets both
ways, from the same seeds. MAVSDK uploads only; ours reads back and compares as well, which is
counted apart. "right" is what the mock holds afterwards, by its own storage.
"""

import argparse
import sys
import time
from collections.abc import Iterator
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
from faao_mav.mission import Mission
from faao_mav.sim import MockAutopilot, behaviour_of
from faao_mav.sim.faults import Faults
from faao_mav.wire import upload
from faao_mav.wire.protocol import MissionType
from faao_mav.wire.wire_items import wire_items


def ours(mock: MockAutopilot, mission: Mission, faults: Faults) -> str:
    """Return what our client says, and its times of uploading and reading back, s, as cells."""
    port, stages = free_port(), dict[str, float]()

    def observe(what: str, done: int, total: int) -> None:
        stages.setdefault(what.split()[0], time.monotonic())

    with running(mock, f"udpin:127.0.0.1:{port}", faults=faults):
        try:
            report = upload(mission, f"udpout:127.0.0.1:{port}", system=1, observe=observe)
            said: str = report.parts[0].verdict
        except LinkError as error:
            said = str(error)
    end = time.monotonic()
    read = stages.get("reading", end)
    return f"{said} | {read - stages.get('uploading', end):.2f} | {end - read:.2f}"


def mavsdk(mock: MockAutopilot, mission: Mission, faults: Faults) -> str:
    """Return the same of MAVSDK, which does not read back."""
    port, rows = free_port(), wire_items(mission, MissionType.MISSION, mock.vehicle)
    items = [
        SdkItem(seq, r.frame, r.command, r.current, 1, *r.params, r.x, r.y, r.z, 0)
        for seq, r in enumerate(rows)
    ]
    with a_mavsdk(port) as sdk, running(mock, f"udpout:127.0.0.1:{port}", faults=faults):
        system = sdk.first_autopilot(20.0)
        assert system is not None
        client, begin, said = MissionRaw(system), time.monotonic(), "success"
        try:
            client.upload_mission(items)
        except MissionRawError as error:
            said = str(error).split(";")[0][:30]
        return f"{said} | {time.monotonic() - begin:.2f} | -"


@contextmanager
def a_mavsdk(port: int) -> Iterator[Mavsdk]:
    sdk = Mavsdk(Configuration.create_with_component_type(ComponentType.GROUND_STATION))
    try:
        sdk.add_any_connection(f"udpin://127.0.0.1:{port}")
        yield sdk
    finally:
        sdk.destroy()


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--quick", action="store_true", help="40 items only")
    counts = (40,) if parser.parse_args().quick else (40, 650)
    print("| mock | items | loss | client | says | upload, s | read back, s | right |")
    print("|---|---|---|---|---|---|---|---|")
    for kind in ("px4", "ardupilot"):
        behaviour = behaviour_of("px4" if kind == "px4" else "ardupilot")
        for count, loss in ((count, loss) for count in counts for loss in (0.0, 0.05, 0.2)):
            mission, faults = a_mission(count), Faults(loss=loss, latency=0.0)
            for client, uploaded in (("faao-mav", ours), ("MAVSDK 4.1.0", mavsdk)):
                mock = MockAutopilot(behaviour, home=HOME, beat=0.1)
                rows = wire_items(mission, MissionType.MISSION, mock.vehicle)
                cells = uploaded(mock, mission, faults)
                right = places(mock.lists.items(MissionType.MISSION)) == places(rows)
                row = f"| {kind} | {count} | {loss:.0%} | {client} | {cells}"
                print(f"{row} | {'yes' if right else 'no'} |", flush=True)


if __name__ == "__main__":
    main()
