"""The stages of one video, in order: what each reads, which settings it uses, and what it leaves.

This table is data only: importing it loads no science, so that `status`, `--dry-run` and an unchanged rerun are quick.
A stage's function is `humanmm.tasks.<name>:<name>(inputs: StageInputs) -> output`.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal

UnitKind = Literal["video", "scene", "shot"]


@dataclass(frozen=True)
class Resources:
    """What one unit of a stage may use while it computes. None of it is part of a key."""

    threads: int = 1
    """Processors that it keeps busy."""
    memory_mb: int = 100
    """Main memory that it takes at most, above what a process with the code of all stages loaded has."""
    memory_mb_per_mpx: int = 0
    """And for every million pixels of the video's picture."""
    memory_mb_per_kframe: int = 0
    """And for every thousand frames of its unit."""
    gpu: bool = False
    """Whether it needs one of the slots of the limit `gpu`."""
    limit_s: float | None = None
    """Seconds after which its process is killed."""

    def for_unit(self, megapixels: float, num_frames: int) -> "Resources":
        """The resources for a picture of this size and a unit of this many frames."""
        grown_mb = self.memory_mb_per_mpx * megapixels + self.memory_mb_per_kframe * num_frames / 1000
        return replace(
            self, memory_mb=self.memory_mb + math.ceil(grown_mb), memory_mb_per_mpx=0, memory_mb_per_kframe=0
        )

    def with_values(self, values: Mapping[str, Any]) -> "Resources":
        """The same with some figures replaced."""
        return replace(self, **values)


@dataclass(frozen=True)
class Stage:
    """One stage; `output` names the frozen dataclass that its function returns."""

    name: str
    per: UnitKind
    inputs: tuple[str, ...]
    """Stages whose artifacts it reads; a stage per shot reads the artifact of the scene or video that holds its shot,
    and of its own shot from another stage per shot; a stage per video reads all shots of a stage per shot."""
    settings: tuple[str, ...]
    """Sections of the configuration that are part of its key."""
    output: str
    corrections: tuple[str, ...] = ()
    """Kinds of the user's corrections that are part of its key; of those about one shot, a unit's own."""
    schema_version: int = 1
    reads_video: bool = False
    defines: Literal["scene", "shot"] | None = None
    """The kind of unit whose spans its artifact lists. A stage per that kind depends on its own span alone."""
    sees_people_of_shots: bool = True
    """Whether it reads who is in the shots; if not, a change of people alone is nothing to it."""
    module: str = ""
    """Where its function is; `humanmm.tasks.<name>` unless given."""
    resources: Resources = Resources()

    @property
    def function(self) -> tuple[str, str]:
        """Module and name of its function."""
        return self.module or f"humanmm.tasks.{self.name}", self.name


def _memory(least_mb: int, per_mpx: int = 0, per_kframe: int = 0) -> Resources:
    """What `scripts/measure_memory` measures, and a tenth to a fifth more."""
    return Resources(memory_mb=least_mb, memory_mb_per_mpx=per_mpx, memory_mb_per_kframe=per_kframe)


STAGES: tuple[Stage, ...] = (
    Stage(
        "decode", "video", (), ("decode",), "humanmm.models.records.video:VideoFacts",
        schema_version=4, reads_video=True, resources=_memory(10, 20, 1),
    ),
    Stage(
        "scenes", "video", ("decode",), ("scenes",), "humanmm.models.records.shots:Scenes",
        corrections=("add-cut", "remove-cut"),
        schema_version=6, reads_video=True, defines="scene", resources=_memory(20, 20, 15),
    ),
    Stage(
        "people", "scene", ("decode", "scenes"), ("people", "lifting"), "humanmm.models.records.tracks:ScenePeople",
        schema_version=9, reads_video=True, resources=_memory(620, 40, 5),
    ),
    Stage(
        "points", "scene", ("decode", "scenes"), ("points",), "humanmm.models.records.camera:PointTracks",
        schema_version=3, reads_video=True, resources=_memory(20, 20, 5),
    ),
    Stage(
        "shots", "video", ("decode", "scenes", "people"), ("shots",), "humanmm.models.records.shots:ShotList",
        corrections=("remove-cut", "same-person", "nobody", "swap", "sides", "height", "exclude", "main"),
        schema_version=10, defines="shot", resources=_memory(10, 0, 8),
    ),
    Stage(
        "keyframes", "video", ("decode", "people", "shots"), (),
        "humanmm.models.camera.background.keyframes:KeyFrameFeatures",
        schema_version=3, reads_video=True, sees_people_of_shots=False, resources=_memory(250, 20),
    ),
    Stage(
        "intrinsics", "video", ("decode", "people", "shots", "points", "keyframes"), ("intrinsics",),
        "humanmm.models.records.camera:Intrinsics",
        schema_version=5, corrections=("focal",), sees_people_of_shots=False, resources=_memory(10, 0, 6),
    ),
    Stage(
        "camera", "shot", ("people", "shots", "points", "intrinsics"), ("camera",),
        "humanmm.models.records.camera:ShotCamera",
        corrections=("static-shot",), schema_version=2, sees_people_of_shots=False, resources=_memory(10, 0, 6),
    ),
    Stage(
        "hmr", "shot", ("decode", "people", "shots", "camera"), ("hmr",), "humanmm.models.records.motion:ShotMotion",
        schema_version=2, resources=_memory(35, 0, 10),
    ),
    Stage(
        "align", "video", ("decode", "people", "shots", "keyframes", "intrinsics", "camera", "hmr"), ("align",),
        "humanmm.models.records.motion:WorldMotion",
        schema_version=5, resources=_memory(15, 0, 10),
    ),
    Stage(
        "refine", "video", ("decode", "people", "shots", "align"), ("refine",),
        "humanmm.models.records.motion:WorldMotion",
        corrections=("floor",), schema_version=5, resources=_memory(35, 0, 12),
    ),
    Stage(
        "deliver", "video", ("decode", "people", "shots", "align", "refine"), ("deliver",),
        "humanmm.models.records.recording:Delivery",
        schema_version=6, reads_video=True, resources=_memory(60, 20, 10),
    ),
)  # fmt: skip


def outputs() -> dict[tuple[str, int], str]:
    """Stage and schema version → the class of its result."""
    return {(stage.name, stage.schema_version): stage.output for stage in STAGES}
