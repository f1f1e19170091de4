"""One module a format; each writes a part of a finished recording for other people's tools."""

import re
import tempfile
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from humanmm.errors import InputError
from humanmm.models.motion.excerpt import Excerpt, Unit, Up, Wishes, WorldScenery, excerpt, is_steady
from humanmm.models.records.recording import RecordedPerson, Recording
from humanmm.storage.run_folder.exporters.amass import reader_rate, write_amass
from humanmm.storage.run_folder.exporters.bvh import write_bvh
from humanmm.storage.run_folder.exporters.c3d import write_c3d
from humanmm.storage.run_folder.exporters.cameras.blender_script import write_blender_script
from humanmm.storage.run_folder.exporters.cameras.colmap import colmap_files
from humanmm.storage.run_folder.exporters.cameras.tum import tum_files
from humanmm.storage.run_folder.exporters.fbx import write_fbx
from humanmm.storage.run_folder.exporters.gltf_scene import write_glb
from humanmm.storage.run_folder.exporters.gvhmr import write_gvhmr
from humanmm.storage.run_folder.exporters.index import facts_of, note
from humanmm.storage.run_folder.exporters.joints_csv import write_csv
from humanmm.storage.run_folder.exporters.trc import write_trc
from humanmm.storage.run_folder.exporters.usd import write_usd
from humanmm.storage.store.files import check_writable, no_empty_folder_left, replace_file

Writer = Callable[[Path], None]


def _own_times(recording: Recording) -> None:
    """The format keeps the time of every frame."""


def _constant(recording: Recording) -> float | None:
    """The format knows one rate: frames of a variable one are brought to the mean."""
    return None if is_steady(recording) else recording.fps


@dataclass(frozen=True)
class Format:
    """How one format is written."""

    description: str
    files: Callable[[Excerpt], Mapping[str, Writer]]
    """Names of the files, and what writes each."""
    up: Up
    unit: Unit
    convention: str = ""
    """Why neither axes nor unit can be chosen; empty if they can."""
    rate: Callable[[Recording], float | None] = _own_times
    """The rate to which frames are brought if the user names none; None keeps them."""
    of_frames: bool = False
    """Whether every entry belongs to a frame of the video, so that there is no other rate."""
    is_scene: bool = False
    """Whether people are hidden in it where they are not seen for long."""
    has_scenery: bool = False
    """Whether there is a place for points of the background."""


def _of_each_person(
    suffix: str, write: Callable[[Excerpt, RecordedPerson, Path], None]
) -> Callable[[Excerpt], Mapping[str, Writer]]:
    def files(part: Excerpt) -> Mapping[str, Writer]:
        people = part.recording.people
        return {f"person_{one.person:02d}{suffix}": partial(write, part, one) for one in people}

    return files


def _of_all(name: str, write: Callable[[Excerpt, Path], None]) -> Callable[[Excerpt], Mapping[str, Writer]]:
    return lambda part: {name: partial(write, part)}


FORMATS: dict[str, Format] = {
    "amass": Format(
        "SMPL-X parameters as in AMASS (Blender's SMPL-X add-on, GMR)", _of_each_person(".npz", write_amass), "z", "m",
        "its readers expect z up and metres", reader_rate,
    ),
    "bvh": Format("each person's skeleton and rotations", _of_each_person(".bvh", write_bvh), "y", "cm", "", _constant),
    "glb": Format(
        "glTF: skinned people and cameras in one scene", _of_all("scene.glb", write_glb), "y", "m",
        "glTF is y up and in metres", is_scene=True,
    ),
    "fbx": Format(
        "the same scene through Blender", _of_all("scene.fbx", write_fbx), "y", "m",
        "Blender writes the axes and the unit into the file, and programs convert them", _constant, is_scene=True,
    ),
    "usd": Format("the same scene (extra `usd`)", _of_all("scene.usdc", write_usd), "z", "m", is_scene=True),
    "csv": Format("joints, one row a frame and joint", _of_each_person(".csv", write_csv), "z", "m"),
    "trc": Format("joints as markers (OpenSim, Pose2Sim)", _of_each_person(".trc", write_trc), "y", "m"),
    "c3d": Format(
        "joints as markers (extra `c3d`)", _of_each_person(".c3d", write_c3d), "z", "mm", "", _constant
    ),
    "gvhmr": Format(
        "GVHMR's hmr4d_results.pt", _of_each_person(".pt", write_gvhmr), "y", "m", "GVHMR's world is y up, in metres"
    ),
    "tum": Format("camera trajectories, a file a shot (evo)", tum_files, "z", "m"),
    "colmap": Format(
        "cameras and points of the background as a COLMAP model in text", colmap_files, "z", "m", of_frames=True,
        has_scenery=True,
    ),
    "blender": Format(
        "a script that makes the cameras in Blender", _of_all("cameras_blender.py", write_blender_script), "z", "m",
        "Blender is z up and in metres", _constant,
    ),
}  # fmt: skip

ALWAYS_WRITTEN = "amass"
"""Every run folder holds it from the start: exporting it again overwrites nothing."""
_ALWAYS = re.compile(r"person_[0-9]{2,}\.npz")


def export(
    recording: Recording,
    folder: Path,
    format_name: str,
    *,
    wishes: Wishes | None = None,
    scenery: Callable[[], WorldScenery] = dict,
    force: bool = False,
) -> tuple[Path, ...]:
    """Write what is wished of a recording into `folder`; the paths written. Existing files need `force`.

    `scenery` has the background of the recording, and is called for a format that has a place for it.
    """
    if format_name not in FORMATS:
        raise InputError(f"there is no format {format_name!r}; choose one of {', '.join(FORMATS)}")
    chosen = FORMATS[format_name]
    part = _excerpt(recording, format_name, wishes or Wishes())
    if chosen.has_scenery:
        part = replace(part, scenery=scenery())
    files = chosen.files(part)
    if not files:
        raise InputError("nobody is in these frames: nothing was written")
    existing = [folder / name for name in files if (folder / name).exists()]
    if existing and not force:
        if format_name == ALWAYS_WRITTEN and all(_is_current(write, folder / name) for name, write in files.items()):
            return tuple(folder / name for name in files)
        raise InputError(f"{existing[0]} exists already; give --force to replace it")
    check_writable(folder)
    with no_empty_folder_left(folder):
        for name, write in files.items():
            replace_file(folder / name, write)
    if format_name != ALWAYS_WRITTEN:
        note(folder, files, facts_of(part, recording, format_name))
    return tuple(folder / name for name in files)


def always_written(folder: Path) -> list[Path]:
    """The files of the format that every run folder holds, also those of people who are no longer in its recording."""
    return [path for path in folder.glob("person_*") if _ALWAYS.fullmatch(path.name)]


def _excerpt(recording: Recording, format_name: str, wishes: Wishes) -> Excerpt:
    chosen = FORMATS[format_name]
    if chosen.convention and (wishes.up not in (None, chosen.up) or wishes.unit not in (None, chosen.unit)):
        raise InputError(f"{chosen.convention}: leave --up and --unit out for {format_name}")
    if chosen.of_frames and wishes.fps is not None:
        raise InputError(f"{format_name} has an entry for each frame of the video: leave --fps out")
    if wishes.keep_unseen and not chosen.is_scene:
        scenes = ", ".join(name for name, one in FORMATS.items() if one.is_scene)
        raise InputError(f"{format_name} hides nobody: leave --keep-unseen out (it is for {scenes})")
    return excerpt(recording, wishes, up=chosen.up, unit=chosen.unit, fps=chosen.rate(recording))


def _is_current(write: Writer, path: Path) -> bool:
    """Whether a file exists and is what would be written."""
    with tempfile.TemporaryDirectory() as folder:
        fresh = Path(folder) / path.name
        write(fresh)
        return path.exists() and path.read_bytes() == fresh.read_bytes()
