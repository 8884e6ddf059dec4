"""The wire: missions to and from vehicles, and a mock autopilot."""

from faao_mav.mavlink.client import UploadReport, clear, download, upload
from faao_mav.mavlink.pace import Timeouts
from faao_mav.mavlink.protocol import MissionType
from faao_mav.mavlink.verify import Difference

__all__ = [
    "Difference",
    "MissionType",
    "Timeouts",
    "UploadReport",
    "clear",
    "download",
    "upload",
]
