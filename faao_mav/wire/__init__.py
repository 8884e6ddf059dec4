"""The wire: missions to and from vehicles, and a mock autopilot."""

from faao_mav.wire.client import LinkOptions as LinkOptions
from faao_mav.wire.client import download as download
from faao_mav.wire.client import upload as upload
from faao_mav.wire.jobs import UploadReport as UploadReport
from faao_mav.wire.protocol import MissionType as MissionType
from faao_mav.wire.wire_items import Difference as Difference
