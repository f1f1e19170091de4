"""One module a format; each writes one finished recording for other people's tools.

An exporter is a function (recording, path) that writes one file; `FORMATS` says which exist, and whether they write a
file for each person or one for all.
"""

import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from humanmm.errors import InputError
from humanmm.models.records.recording import RecordedPerson, Recording
from humanmm.storage.run_folder.exporters.amass import write_amass
from humanmm.storage.run_folder.exporters.joints_csv import write_csv
from humanmm.storage.run_folder.exporters.trc import write_trc
from humanmm.storage.store.files import replace_file


@dataclass(frozen=True)
class Format:
    """How one format is written: one file a person, named person_<nn><suffix>."""

    suffix: str
    write: Callable[[Recording, RecordedPerson, Path], None]
    description: str


FORMATS: dict[str, Format] = {
    "amass": Format(".npz", write_amass, "SMPL-X parameters as in AMASS, z up (Blender add-on, GMR)"),
    "csv": Format(".csv", write_csv, "world joints, one row a frame and joint"),
    "trc": Format(".trc", write_trc, "joints as markers for OpenSim and Pose2Sim, y up, metres"),
}


ALWAYS_WRITTEN = "amass"
"""Every run folder holds it from the start: exporting it again overwrites nothing."""


def export(recording: Recording, folder: Path, format_name: str, *, force: bool = False) -> tuple[Path, ...]:
    """Write every person of a recording into `folder`; the paths written. Existing files need `force`."""
    if format_name not in FORMATS:
        raise InputError(f"there is no format {format_name!r}; choose one of {', '.join(FORMATS)}")
    chosen = FORMATS[format_name]
    paths = {person.person: folder / f"person_{person.person:02d}{chosen.suffix}" for person in recording.people}
    existing = [path for path in paths.values() if path.exists()]
    if existing and not force:
        if format_name == ALWAYS_WRITTEN and all(_is_current(chosen, recording, p, paths) for p in recording.people):
            return tuple(paths.values())
        raise InputError(f"{existing[0]} exists already; give --force to replace it")
    for person in recording.people:
        _write_one(chosen, recording, person, paths[person.person])
    return tuple(paths.values())


def _is_current(chosen: Format, recording: Recording, person: RecordedPerson, paths: dict[int, Path]) -> bool:
    """Whether the person's file exists and is what would be written."""
    path = paths[person.person]
    with tempfile.TemporaryDirectory() as folder:
        fresh = Path(folder) / path.name
        chosen.write(recording, person, fresh)
        return path.exists() and path.read_bytes() == fresh.read_bytes()


def _write_one(chosen: Format, recording: Recording, person: RecordedPerson, path: Path) -> None:
    replace_file(path, lambda fresh: chosen.write(recording, person, fresh))
