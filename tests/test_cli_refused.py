"""What commands refuse, before any work: one clear error, exit status 2, nothing written."""

import shlex
import shutil
from pathlib import Path

import pytest
from conftest import FLYABLE, MISSIONS, edited
from typer.testing import CliRunner

from faao_mav.cli.main import app

DATA = Path(__file__).parent / "data"
NOWHERE = "udpout:127.0.0.1:9"

REFUSED = f"""
plan.yaml --out x.gpx | x.gpx: '.gpx'; expected a name that ends in .waypoints or .txt
plan.yaml --out x | no ending
plan.yaml --out absent/x.txt | there is no directory absent
plan.yaml --save x.yaml | --save x.yaml: give a name that ends in .npz
plan.yaml --out m.txt --report r.pdf | --report r.pdf: give a name that ends in .html
plan.yaml --out m.txt --figure f.jpg | --figure f.jpg: give a name that ends in .png
plan.yaml --method magic | optimizer.method: 'magic' is not accepted; give direct or
plan.yaml --method algorithm1 | radio.fading: ergodic is not for algorithm1
bad.yaml --out m.txt | bad.yaml: flight.altitude: -1
useless.yaml --out m.txt --save r.npz | vehicle.parameters: WPNAV_JERK: 0
useless_plane.yaml | AIRSPEED_MIN
beyond.yaml --out m.txt | max_speed: 22 m/s; ArduCopter keeps plans of at most 20 m/s (the most
beyond.yaml --upload {NOWHERE} | 5 m/s^2 (WP_ACC); give that or less, or --force to make the
plan.yaml --nonsense | No such option
plan.yaml second.yaml | unexpected extra argument
plan.yaml --out plan.yaml | '.yaml'; expected a name that ends in
plan.txt --out plan.txt | --out plan.txt: is the file of PLAN.yaml too
plan.txt --out m.txt --precoders m.txt | --precoders m.txt: is the file of --out too
plan.txt --out m.txt --precoders m.param | is the file of the parameters of --out
plan.yaml --out m.txt --upload nonsense | expected udpin:HOST:PORT
plan.yaml --out m.txt --system 3 | --system 3: is for an upload; give --upload
plan.yaml --out m.txt --allow-armed | --allow-armed: is for an upload; give --upload
plan.yaml --force | --force: is for a mission; give --out MISSION or --upload
absent.yaml | absent.yaml: cannot be read: No such file or directory
folder/absent | folder/absent: cannot be read: No such file or directory
convertt | convertt: no command and no file of this name; did you mean convert?
convertt m.waypoints --out x.plan | no command and no file of this name; did you mean convert?
zzz | zzz: no command and no file of this name; commands: plan, validate,
{"z" * 300} | zzz: no command and no file of this name; commands: plan, validate,
validate m.waypoints --plan plan.yaml --solution r.npz | give one
convert two_current.waypoints --out x.plan | field current: '1'; expected 0
convert m.waypoints --out x.gpx | '.gpx'; expected a name that ends in .waypoints
convert m.waypoints --out absent/x.plan | there is no directory
convert absent.waypoints --out x.plan | cannot be read: No such file
convert plain.kml --out x.plan | KML is written for drawing
convert m.waypoints --out m.waypoints | is the file of MISSION too; give another name
convert m.waypoints --out ./m.waypoints | is the file of MISSION too; give another name
convert m.waypoints --out link.waypoints | is the file of MISSION too; give another name
upload missing.waypoints --to {NOWHERE} | missing.waypoints
upload m.waypoints --to nonsense | expected udpin:HOST:PORT
upload m.waypoints --to /dev/ttyNONE,57600 | there is no such device
upload m.waypoints --to {NOWHERE} --log no/x.tlog | no directory
upload m.waypoints --to {NOWHERE} --signing-key no | cannot be read
download --from nonsense --out x.plan | expected udpin:HOST:PORT
download --from {NOWHERE} --out x.doc | expected a name
app no.yaml --no-browser | no.yaml: cannot be read
app --host 256.1.1.1 --no-browser | --host 256.1.1.1 --port 0:
autopilot --listen nonsense | expected udpin:HOST:PORT
autopilot --home 1,2 | expected LAT,LON,ALT
autopilot --home 91,2,3 | latitude
autopilot --home 0,0,1e30 | an altitude of at most 100000 m
autopilot --home 0,0,nan | expected LAT,LON,ALT
autopilot --parameters still.param | WPNAV_ACCEL
fly missing.waypoints --to {NOWHERE} | missing.waypoints
fly m.waypoints --to nowhere | nowhere
fly m.waypoints --to {NOWHERE} --plan a --solution b | --plan and --solution: give one
fly m.waypoints --to a --stream --plan p.yaml | --stream: needs --arm
fly m.waypoints --to a --stream --arm | --stream: needs --plan
fly m.waypoints --to a --radio udp:h:1 | --radio: needs --plan
debrief log.tlog | --plan or --solution: give the plan that was flown
debrief m.waypoints --plan a.yaml | give a flight log: .bin, .tlog, .ulg
debrief log.tlog --plan a.yaml --report page.txt | --report
"""
"""Command lines, and what each is told."""


def test_what_cannot_be_done_is_said_before_the_work(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    for name in ("plan.yaml", "plan.txt"):
        Path(name).write_text(edited(FLYABLE, {"radio.fading": "ergodic"}))
    Path("bad.yaml").write_text(edited(FLYABLE, {"flight.altitude": -1}))
    useless = {"vehicle.parameters": {"WPNAV_JERK": 0}}
    Path("useless.yaml").write_text(edited(FLYABLE, useless))
    useless = {"vehicle.parameters": {"AIRSPEED_MIN": -1}}
    plane = (MISSIONS / "plane_relay.yaml").read_text()
    Path("useless_plane.yaml").write_text(edited(plane, useless))
    beyond = {"vehicle.max_speed": 22, "vehicle.max_acceleration": 5.5}
    Path("beyond.yaml").write_text(edited(FLYABLE, beyond))
    shutil.copy(DATA / "missions" / "two_current.waypoints", "two_current.waypoints")
    shutil.copy(DATA / "missions" / "plain.waypoints", "m.waypoints")
    shutil.copy(DATA / "logs" / "arducopter.tlog", "log.tlog")
    Path("link.waypoints").symlink_to("m.waypoints")
    Path("still.param").write_text("WPNAV_ACCEL,0\n")
    before = {path: path.read_bytes() for path in tmp_path.iterdir()}
    wrong = []
    for line in REFUSED.strip().splitlines():
        command, part = line.split(" | ")
        result = CliRunner().invoke(app, shlex.split(command))
        clean = isinstance(result.exception, SystemExit) and result.stdout == ""
        if (result.exit_code, clean) != (2, True) or part not in result.stderr:
            wrong.append((command, result.exit_code, result.output, result.exception))
        assert {path: path.read_bytes() for path in tmp_path.iterdir()} == before, command
    assert wrong == []
