"""timeline.png of a run folder, drawn at the end of every run: it shows what this run took, so it is never cached."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from humanmm.models.motion.recording import Recording
from humanmm.models.pictures.overlay import Mark
from humanmm.models.pictures.timeline import StageTime, timeline
from humanmm.storage.files import replace_file
from humanmm.storage.picture_files import write_png

TIMELINE = "timeline.png"


def write_timeline(run_dir: Path, recording: Recording, record: Mapping[str, Any]) -> None:
    """Draw view/timeline.png; `record` is the tree of run.json."""
    transitions = [shot["transition"] for shot in record["shots"] if shot["transition"] is not None]
    marks = [Mark(t["type"], int(t["start"]), int(t["end"])) for t in transitions]
    failures = [f"{f['stage']}, {f['unit']}: {f['reason']}" for f in record["failures"]]
    image = timeline(recording, marks, stage_times(record), [*failures, *record["warnings"]])
    replace_file(run_dir / "view" / TIMELINE, lambda fresh: write_png(fresh, image))


def stage_times(record: Mapping[str, Any]) -> list[StageTime]:
    """Seconds and states of run.json's stages, the units of a stage added up, in their order."""
    rows: dict[str, list[Mapping[str, Any]]] = {}
    for entry in record["stages"]:
        rows.setdefault(entry["stage"], []).append(entry)
    return [
        StageTime(
            stage=stage,
            seconds=sum(float(unit["seconds"]) for unit in units),
            units=len(units),
            cached_units=sum(unit["state"] == "cached" for unit in units),
            failed_units=sum(unit["state"] == "failed" for unit in units),
        )
        for stage, units in rows.items()
    ]
