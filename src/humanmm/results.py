"""A finished run as a Python value: the arrays of its motion.zarr, what its run.json says, its files and figures.

Everything is read at its first use, so that `load` costs nothing and loads no library.
"""

import os
from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

from humanmm.errors import InputError
from humanmm.progress import counted

if TYPE_CHECKING:
    import numpy as np

    from humanmm.config import Config
    from humanmm.models.evaluation.report import Report
    from humanmm.models.records.recording import RecordedPerson, Recording

Origin = Literal["loaded", "unchanged", "restored", "computed"]
_SHOWN_WARNINGS = 5


@dataclass(frozen=True)
class Cameras:
    """The camera of every frame; F frames."""

    R_world_cam: "np.ndarray"
    """(F,3,3) float32, camera to world; x right, y down, z forward."""
    t_world_cam: "np.ndarray"
    """(F,3) float32, camera centre in the world, metres."""
    K: "np.ndarray"
    """(F,3,3) float32, pixels of the source video, pixel centres at .5."""
    source: "np.ndarray"
    """(F,) uint8: 0 static, 1 tracked, 2 rotation only, 3 given by the user, 4 fallback."""


@dataclass(frozen=True)
class RecordedShot:
    """One shot: frames [start, end)."""

    start: int
    end: int
    transition: Mapping[str, Any] | None
    """How it begins: `type` (cut, dissolve, fade), `start`, `end`, `evidence`; None for the first shot."""
    people: tuple[int, ...]
    """Numbers of the people seen in it."""
    linked: bool
    """False if nothing places it relative to the shots before it."""
    failed: bool
    """True if a stage failed on it: its camera is a fallback and its motion was filled in."""


@dataclass(frozen=True)
class Failure:
    """One stage that failed on one scene or shot."""

    stage: str
    unit: str
    """`video`, `scene 2` or `shot 3`."""
    reason: str

    def __str__(self) -> str:
        label = self.stage if self.unit == "video" else f"{self.stage} · {self.unit}"
        return f"{label} failed: {self.reason}"


@dataclass(frozen=True)
class AppliedCorrection:
    """What became of one of the user's corrections."""

    correction: Mapping[str, Any]
    """As it stands in corrections.toml."""
    text: str
    """In words."""
    applied: bool
    reason: str
    """Why it does not fit; or what is to be known although it does."""


@dataclass(frozen=True)
class Run:
    """One run folder."""

    folder: Path
    origin: Origin = "loaded"
    """How `recover` came to it: `computed` something, `restored` the folder from the store alone, or left it
    `unchanged`; `loaded` if it comes from `load`."""

    @cached_property
    def record(self) -> Mapping[str, Any]:
        """The tree of run.json."""
        from humanmm.storage.run_folder.run_record import read_run_record

        return read_run_record(self.folder)

    @cached_property
    def recording(self) -> "Recording":
        """Everything that motion.zarr holds: times, shots, cameras and people of all F frames."""
        from humanmm.storage.run_folder.motion_zarr import MOTION, read_motion

        return read_motion(self.folder / MOTION)

    @property
    def people(self) -> "tuple[RecordedPerson, ...]":
        """The people, the main one first; each has the arrays `people/<nn>/…` of motion.zarr."""
        return self.recording.people

    @cached_property
    def cameras(self) -> Cameras:
        """The cameras of all frames."""
        found = self.recording
        return Cameras(found.R_world_cam, found.t_world_cam, found.K, found.camera_source)

    @cached_property
    def shots(self) -> tuple[RecordedShot, ...]:
        """The shots in order; they cover every frame."""
        return tuple(
            RecordedShot(
                shot["start"], shot["end"], shot["transition"], tuple(shot["people"]), shot["linked"], shot["failed"]
            )
            for shot in self.record["shots"]
        )

    @property
    def state(self) -> Literal["done", "partial"]:
        """`partial` if a stage failed on a scene or shot: `failures` says why."""
        state: Literal["done", "partial"] = self.record["state"]
        return state

    @cached_property
    def failures(self) -> tuple[Failure, ...]:
        """What failed by itself (what was skipped because of it is left out)."""
        failed = (entry for entry in self.record["stages"] if entry["state"] == "failed")
        return tuple(Failure(entry["stage"], entry["unit"], entry["reason"]) for entry in failed)

    @property
    def warnings(self) -> tuple[str, ...]:
        """Where the result is usable but worse than usual, a sentence each."""
        return tuple(self.record["warnings"])

    @cached_property
    def corrections(self) -> tuple[AppliedCorrection, ...]:
        """The user's corrections of this run, in order, and which of them fit (docs/correct.md)."""
        return tuple(AppliedCorrection(**one) for one in self.record.get("corrections", ()))

    @property
    def video(self) -> Path:
        """The video that was recovered."""
        return Path(self.record["video"]["path"])

    @cached_property
    def config(self) -> "Config":
        """The settings of the run."""
        from humanmm.config_reading import validate

        return validate(self.record["config"], origin=str(self.folder / "run.json"))

    def export(
        self,
        format_name: str,
        *,
        person: int | Sequence[int] | None = None,
        start: float | None = None,
        end: float | None = None,
        fps: float | None = None,
        up: Literal["y", "z"] | None = None,
        unit: Literal["m", "cm", "mm"] | None = None,
        keep_unseen: bool = False,
        out: "str | os.PathLike[str] | None" = None,
        force: bool = False,
    ) -> tuple[Path, ...]:
        """Write the run for another tool (docs/export.md lists the formats); paths of the files.

        `person` and the frames with `start` ≤ time < `end` (seconds from the first frame on) alone, at `fps` frames per
        second (rotations by slerp), with `up` up and in `unit`; what is None is the run's or the format's own. `glb`,
        `fbx` and `usd` hide people where they are not seen for more than 2 s, unless `keep_unseen`. `out` is a folder
        instead of the run's `export`. InputError if a file exists already and `force` is not given.
        """
        from humanmm.models.motion.excerpt import Wishes
        from humanmm.storage.run_folder import exporters
        from humanmm.storage.run_folder.kept_scenery import kept_scenery
        from humanmm.storage.run_folder.motion_zarr import EXPORT, MOTION, read_motion
        from humanmm.storage.view.scene import with_worlds

        people = () if person is None else (person,) if isinstance(person, int) else tuple(person)
        wishes = Wishes(fps=fps, people=people, start_s=start, end_s=end, up=up, unit=unit, keep_unseen=keep_unseen)
        folder = self.folder / EXPORT if out is None else Path(out)
        with self._unchanging() if out is None else nullcontext():
            recording = read_motion(self.folder / MOTION)  # afresh: what was read before may have been replaced
            if not recording.worlds and (self.folder / "run.json").is_file():
                recording = with_worlds(recording, self.record)
            return exporters.export(
                recording, folder, format_name, wishes=wishes, force=force,
                scenery=lambda: kept_scenery(self.folder, recording),
            )  # fmt: skip

    def _unchanging(self) -> AbstractContextManager[None]:
        """While nobody else writes the folder. InputError if the writing of it broke off."""
        from humanmm.storage.run_folder.run_record import FILE, LOCK, read_run_record
        from humanmm.storage.store.files import OTHER_FOLDER
        from humanmm.storage.store.locks import FileLock

        if (self.folder / FILE).is_file():
            read_run_record(self.folder)
        waiting = f"another run is writing {self.folder}; waiting for it"
        return FileLock(self.folder / LOCK, waiting=waiting, other=OTHER_FOLDER).held()

    def draw(self, *, force: bool = False) -> tuple[Path, ...]:
        """Draw the pictures in `folder/view` that are missing, with `force` all of them; paths of all pictures."""
        from humanmm.tasks.pictures import draw_again

        with counted("overlay.mp4") as progress:
            return draw_again(self.folder, force=force, progress=progress)

    def view(
        self,
        kind: Literal["page", "world", "side-by-side", "rerun"] = "page",
        *,
        out: "str | os.PathLike[str] | None" = None,
        opacity: float | None = None,
        force: bool = False,
    ) -> Path:
        """The run to look at, as one file (docs/view.md): an HTML page with the video beside the world in 3D, a film of
        the world, one with the original, the overlay and the world, or an .rrd for rerun's viewer; its path.

        The page that `recover` wrote is taken as it is, unless `out`, `opacity` or `force` wants another. `opacity`
        (0..1) is that of the bodies on the video. InputError if a file exists already and `force` is not given.
        """
        from humanmm.tasks.views import FILES, write_view

        path = self.folder / "view" / FILES[kind]
        if kind == "page" and path.is_file() and out is None and opacity is None and not force:
            return path
        path = path if out is None else Path(out)
        with self._unchanging() if out is None else nullcontext(), counted(path.name) as progress:
            return write_view(self.folder, kind, path, opacity=opacity, force=force, progress=progress)

    def _repr_png_(self) -> bytes | None:
        """The view from above, for notebooks; None if it was not drawn."""
        try:
            return (self.folder / "view" / "top.png").read_bytes()
        except OSError:
            return None

    def _repr_html_(self) -> str:
        """Folder, contents, warnings and the view from above, for notebooks."""
        import base64
        from html import escape

        try:
            record, shots, warnings = self.record, len(self.shots), [*map(str, self.failures), *self.warnings]
        except InputError as error:
            return f"<p>{escape(str(error))}</p>"
        people, frames = len(record["people"]), record["video"]["num_frames"]
        facts = f"{record['state']}: {frames} frames, {shots} shots, {people} people"
        more = len(warnings) - _SHOWN_WARNINGS
        rows = [*warnings[:_SHOWN_WARNINGS], *([f"and {more} more in run.json"] if more > 0 else [])]
        png = self._repr_png_()
        picture = base64.b64encode(png).decode() if png else ""
        return (
            f"<p><b>{escape(os.fspath(self.folder))}</b> {escape(facts)}</p>"
            + (f"<ul>{''.join(f'<li>{escape(row)}</li>' for row in rows)}</ul>" if rows else "")
            + (f'<img alt="view from above" src="data:image/png;base64,{picture}">' if picture else "")
        )


def load(folder: "str | os.PathLike[str]") -> Run:
    """The run in a folder that `recover` wrote. InputError if the folder holds no run."""
    run = Run(Path(folder))
    if not (run.folder / "run.json").is_file() and not (run.folder / "motion.zarr").is_dir():
        raise InputError(f"{run.folder} is no run folder: it has neither run.json nor motion.zarr")
    return run


def evaluate(run: "Run | str | os.PathLike[str]", truth: "Run | str | os.PathLike[str]") -> "Report":
    """Every metric of a run against its truth (docs/metrics.md), a run folder or an `.npz` file; also of each person
    (`report.people`) and of each shot (`report.shots`).

    Raises TruthError, also if the truth is that of another video.
    """
    from humanmm.models.evaluation.evaluate import evaluate as figures_of
    from humanmm.models.evaluation.evaluate import shot_reports
    from humanmm.storage.readers.same_video import check_same_video
    from humanmm.storage.readers.truth import read_sequence, read_truth

    folder, other = (side.folder if isinstance(side, Run) else Path(side) for side in (run, truth))
    prediction, reference = read_sequence(folder), read_truth(other, folder)
    check_same_video(folder, other, prediction, reference)
    return replace(figures_of(prediction, reference), shots=shot_reports(prediction, reference))
