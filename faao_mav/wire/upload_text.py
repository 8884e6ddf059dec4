"""An upload in words: the lines of the terminal and of the planner page."""

from faao_mav.wire.client import UploadReport
from faao_mav.wire.transfer import PartReport
from faao_mav.wire.verify import Difference


def upload_text(report: UploadReport) -> str:
    """Return `report` for people."""
    lines = [f"vehicle      {report.vehicle}", f"stands       {_stands(report)}"]
    lines += [f"parameter    {change}" for change in report.changes]
    lines += [_part_line(part) for part in report.parts if part.verified]
    for part in report.parts:
        lines += [f"not kept     {text}" for text in _dropped(part)]
    lines += [f"failed       {problem}" for problem in report.problems]
    if report.verified:
        lines.append(f"verified     read back and compared; the upload took {report.seconds:.1f} s")
    return "\n".join(lines)


def _stands(report: UploadReport) -> str:
    """Return where the vehicle stands beside the mission."""
    stands = report.stands
    if stands is None:
        return "not known how far from the mission's home: it does not tell where it is"
    return str(stands) if stands.is_meant else f"{stands}: it is not armed there"


def _dropped(part: PartReport) -> list[str]:
    """Return what storage lost, one line for each field."""
    lost: dict[str, list[Difference]] = {}
    for each in part.differences:
        if each.kind == "dropped":
            lost.setdefault(each.field, []).append(each)
    return [
        str(each[0]) + (f" (and so in {len(each) - 1} more items)" if len(each) > 1 else "")
        for each in lost.values()
    ]


def _part_line(part: PartReport) -> str:
    what = "items" if part.items != 1 else "item"
    again = "" if part.attempts == 1 else f", in {part.attempts} attempts"
    title = {"rally points": "rally"}.get(part.part.title, part.part.title)
    return f"{title:<13}{part.items} {what} stored{again}"
