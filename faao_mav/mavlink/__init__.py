"""The wire: missions to and from vehicles, and a mock autopilot."""

from faao_mav.mavlink.client import LinkOptions, UploadReport, clear, download, upload
from faao_mav.mavlink.protocol import MissionType
from faao_mav.mavlink.transfer.pace import Timeouts
from faao_mav.mavlink.transfer.verify import Difference

__all__ = [
    "Difference",
    "LinkOptions",
    "MissionType",
    "Timeouts",
    "UploadReport",
    "clear",
    "download",
    "upload",
]
