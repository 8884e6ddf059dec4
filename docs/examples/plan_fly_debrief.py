"""From a plan to a debriefing in the mock autopilot's air, over loopback; nothing real is armed.

python plan_fly_debrief.py FOLDER   (missions/ of the checkout; half a minute)
"""

import subprocess
import sys
from pathlib import Path

from faao_mav import Flight, debrief, fly_mission, plan_mission, read_plan, render_report, upload

result = plan_mission(read_plan(Path(sys.argv[1]) / "copter_relay.yaml"))
result.write("mission.waypoints")
made = result.conversion
command = [sys.executable, "-m", "faao_mav", "autopilot", "--listen", "udpin:127.0.0.1:14561"]
with subprocess.Popen([*command, "--speedup", "20"], stdout=subprocess.DEVNULL) as mock:
    try:
        vehicle = "udpout:127.0.0.1:14561"
        sent = upload(made.mission, vehicle, parameters=made.parameters)
        print("verified:", sent.verified)
        flight = Flight.planned(made, result.solution)
        flown = fly_mission(flight, vehicle, arm=True, log=Path("flight.tlog"))
        print("ending:", flown.ending.kind)
    finally:
        mock.terminate()
told = debrief("flight.tlog", result.solution)
print(f"delivered {100 * told.found.flown.delivered_rate / result.solution.delivered_rate:.1f} %")
Path("flight.html").write_text(render_report(told))
