"""A finished run in five lines: who is in it, its shots, how sure it is, what to look at, and where it is."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

SHOWN = 4
"""People or shots of one line; there may be a hundred."""
_SOURCES = {
    "given": "given", "metadata": "of the file", "estimated": "estimated", "default": "assumed", "bones": "of bones",
    "feet": "of feet", "assumed": "assumed",
}  # fmt: skip


def five_lines(record: Mapping[str, Any], run_dir: Path) -> list[str]:
    """What a terminal shows at the end of a run; `record` is the tree of run.json."""
    lines = {
        "people": _people(record["people"]),
        "shots": _shots(record["shots"], int(record["video"]["num_frames"])),
        "sure": "; ".join(certainty(record)),
        "look at": _look_at(record),
        "result": f"{run_dir}   (humanmm view {run_dir} shows it)",
    }
    return [f"{name:<8} {line}" for name, line in lines.items()]


def one_line(record: Mapping[str, Any]) -> str:
    """The same in one line, without the place: `done: 2 people, 3 shots, 1 warning`."""
    counts = [
        counted(len(record["people"]), "person", "people"),
        counted(len(record["shots"]), "shot", "shots"),
        counted(len(record["warnings"]), "warning", "warnings") if record["warnings"] else "nothing doubtful",
    ]
    return f"{record['state']}: {', '.join(counts)}"


def certainty(record: Mapping[str, Any]) -> list[str]:
    """Everything that was guessed, with its uncertainty: focal length, scale, floor, cuts, identities."""
    found = []
    focal = record.get("focal")
    if focal and focal["px"] is not None:
        found.append(
            f"focal {focal['px']:.0f} px{_percent(focal['relative_uncertainty'])} ({_SOURCES[focal['source']]})"
        )
    scale, floor = record.get("scale"), record.get("floor")
    if scale:
        found.append(f"scale{_percent(scale['relative_uncertainty'])} ({_SOURCES[scale['source']]})")
    if floor:
        height = floor["uncertainty_m"]
        found.append(f"floor{'' if height is None else f' ± {100 * height:.0f} cm'} ({_SOURCES[floor['source']]})")
    joins = [shot["join"] for shot in record["shots"] if shot.get("join") and shot["linked"]]
    if joins:
        worst = max(join["uncertainty_deg"] for join in joins)
        found.append(f"cameras at cuts ± {worst:.0f}° at worst")
    likely = [one["probability"] for person in record["people"] for one in person.get("identity", ())]
    if likely:
        found.append(f"who is who {100 * min(likely):.0f} % at least")
    return found


def _people(people: Sequence[Mapping[str, Any]]) -> str:
    parts = []
    for person in people[:SHOWN]:
        frames = person.get("end", 0) - person.get("start", 0)
        seen = f"seen in {person['observed_frames']} of {frames} frames" if frames else "in no frame"
        doubt = f", doubtful ({100 * person['probability']:.0f} %)" if person["probability"] < DOUBTFUL else ""
        parts.append(f"person {person['person']} {seen}{doubt}")
    return _listed(len(people), parts)


DOUBTFUL = 0.5
"""`records.shots.DOUBTFUL`, named here so that nothing heavy is imported (a test compares)."""


def _shots(shots: Sequence[Mapping[str, Any]], num_frames: int) -> str:
    parts = []
    for index, shot in enumerate(shots[:SHOWN]):
        place = "" if shot["linked"] else ", a world of its own"
        failed = ", failed" if shot["failed"] else ""
        parts.append(f"shot {index} frames {shot['start']} to {shot['end'] - 1}{place}{failed}")
    return f"{_listed(len(shots), parts)}; {num_frames} frames in all"


def _look_at(record: Mapping[str, Any]) -> str:
    failures = [f"{one['stage']}, {one['unit']} failed: {one['reason']}" for one in _failed(record)]
    doubts = [*failures, *record["warnings"]]
    if not doubts:
        return "nothing is doubtful"
    more = len(doubts) - 1
    return str(doubts[0]) + (f" (and {more} more in run.json)" if more else "")


def _failed(record: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    """What failed by itself, without what was skipped because of it."""
    return [stage for stage in record["stages"] if stage["state"] == "failed"]


def _listed(count: int, parts: Sequence[str]) -> str:
    more = f" and {count - len(parts)} more" if count > len(parts) else ""
    return f"{count}: {', '.join(parts)}{more}"


def _percent(share: float | None) -> str:
    return "" if share is None else f" ± {100 * share:.0f} %"


def counted(count: int, one: str, many: str) -> str:
    """A number and what it counts: `1 shot`, `2 shots`."""
    return f"{count} {one if count == 1 else many}"
