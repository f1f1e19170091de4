"""The stages of a video up to its cameras: what `humanmm camera` computes."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from humanmm.config import Config
from humanmm.models.records.camera import Intrinsics, ShotCamera
from humanmm.models.records.shots import ShotList
from humanmm.models.records.video import VideoFacts
from humanmm.storage.store.store import Store
from humanmm.tasks.engine.run import VideoRun
from humanmm.tasks.engine.some_stages import results_of, run_stages

STAGES = ("decode", "scenes", "people", "points", "shots", "keyframes", "intrinsics", "camera")


@dataclass(frozen=True)
class Cameras:
    """The cameras of a video, shot by shot."""

    facts: VideoFacts
    shots: ShotList
    intrinsics: Intrinsics
    cameras: Sequence[ShotCamera]

    @property
    def warnings(self) -> tuple[str, ...]:
        """What is doubtful; shots are numbered from 0."""
        of_shots = (f"shot {n}: {text}" for n, camera in enumerate(self.cameras) for text in camera.warnings)
        return (*self.facts.warnings, *self.shots.warnings, *self.intrinsics.warnings, *of_shots)


def recover_cameras(
    video: Path, config: Config, store: Store, *, follow: Callable[[VideoRun], None] = lambda run: None
) -> Cameras:
    """Compute what the store does not have; `follow` gets the run before it begins.

    Raises StageError if a stage fails on a part of the video, HumanMMError what its stages raise.
    """
    run = run_stages(video, STAGES, config, store, follow=follow)
    (facts,), (shots,) = results_of(run, "decode", VideoFacts), results_of(run, "shots", ShotList)
    (intrinsics,) = results_of(run, "intrinsics", Intrinsics)
    return Cameras(facts, shots, intrinsics, results_of(run, "camera", ShotCamera))
