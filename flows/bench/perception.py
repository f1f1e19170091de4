"""`humanmm bench identity | lifting`: who is who across cuts, and where lifters have landmarks, on clips whose people
are known.

Who is who is known in clips beside a truth with boxes, and in whole videos of the golden set, by the boxes that
somebody set; landmarks where a truth has bodies. Scenes, people and shots come from the stages of `humanmm recover`, on
the same store.
"""

import logging
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from humanmm.config import Config
from humanmm.errors import HumanMMError, InputError
from humanmm.flows.bench.clips import video_beside
from humanmm.flows.bench.golden import golden_list
from humanmm.flows.bench.motion import without_lifter
from humanmm.models.benchmark.expectations import GoldenClip
from humanmm.models.benchmark.identity import Boxes, View, views_of
from humanmm.models.evaluation.landmarks import LandmarkErrors, landmark_errors, shown_by, true_bodies
from humanmm.models.geometry.intrinsics import K_from_focal, default_focal_px
from humanmm.models.perception.lifting.features import view_axes
from humanmm.models.perception.lifting.lifted import person_frames
from humanmm.models.records.landmarks import COCO_LANDMARKS
from humanmm.models.records.shots import ShotList
from humanmm.models.records.tracks import ScenePeople
from humanmm.models.records.video import VideoFacts
from humanmm.parts import load
from humanmm.storage.readers.truth import read_boxes, read_sequence
from humanmm.storage.store.store import Store
from humanmm.tasks.engine.some_stages import results_of, run_stages
from humanmm.tasks.people import lifter_of
from humanmm.tasks.units.process import prepare_process

log = logging.getLogger(__name__)

STAGES = ("decode", "scenes", "people", "shots")


@dataclass(frozen=True)
class KnownClip:
    """A video, and where its people are known from."""

    video: Path
    recording: str
    source: Path | GoldenClip

    def boxes(self, facts: VideoFacts) -> Boxes:
        """Everybody's box in every frame."""
        if isinstance(self.source, Path):
            return read_boxes(self.source, facts.num_frames) or {}
        size = np.array([facts.width, facts.height] * 2)
        return {one.who: one.boxes(facts.num_frames) * size for one in self.source.people if not one.crowd}


def identity_views(folder: Path, config: Config, store: Store) -> tuple[list[View], list[str]]:
    """What is seen of the known people of a folder's clips; and a sentence for each clip that failed."""
    prepare_process()
    clips = list(known_clips(folder))
    if not clips:
        raise InputError(f"{folder} holds no video beside a <name>_gt.npz, and none of the golden set's")
    views, failed = [], []
    for number, clip in enumerate(clips, start=1):
        try:
            run = run_stages(clip.video, STAGES, config, store)
            (facts,), (shots,) = results_of(run, "decode", VideoFacts), results_of(run, "shots", ShotList)
            scenes = results_of(run, "people", ScenePeople)
            views += views_of(clip.recording, shots.shots, scenes, clip.boxes(facts), facts.time_s)
        except HumanMMError as error:
            failed.append(f"{clip.video.relative_to(folder)}: {error}")
        log.info("%s: %d of %d videos", clip.video.stem, number, len(clips))
    return views, failed


def lifted_landmarks(folder: Path, config: Config, store: Store) -> tuple[dict[str, list[LandmarkErrors]], list[str]]:
    """The errors of every track in the folder's clips whose truth has bodies, by what says where its landmarks are: the
    pose network, or a lifter of the configuration; and a sentence for each clip that failed."""
    prepare_process()
    truths = sorted(path for path in folder.rglob("*_gt.npz") if video_beside(path).is_file())
    if not truths:
        raise InputError(f"{folder} holds no video beside a <name>_gt.npz")
    found: dict[str, list[LandmarkErrors]] = {}
    failed = []
    for number, truth in enumerate(truths, start=1):
        try:
            for name, errors in _errors_in(truth, config, store):
                found.setdefault(name, []).append(errors)
        except HumanMMError as error:
            failed.append(f"{video_beside(truth).relative_to(folder)}: {error}")
        log.info("%s: %d of %d videos", video_beside(truth).stem, number, len(truths))
    return found, failed


def _errors_in(truth: Path, config: Config, store: Store) -> Iterator[tuple[str, LandmarkErrors]]:
    """The same of one clip, track by track."""
    lifter = lifter_of(config.lifting)
    keypoint_lifter = load("lifting.keypoints", config.lifting.keypoints)
    run = run_stages(video_beside(truth), STAGES[:3], without_lifter(config), store)
    (facts,), bodies = results_of(run, "decode", VideoFacts), true_bodies(read_sequence(truth))
    K = K_from_focal(default_focal_px(facts.width, facts.height), facts.width, facts.height)
    for track in (track for scene in results_of(run, "people", ScenePeople) for track in scene.tracks):
        frames = person_frames(track, facts.time_s)
        shown = shown_by(track, frames, bodies)
        if shown is None:
            continue
        in_camera = keypoint_lifter(frames.keypoints[:, list(COCO_LANDMARKS)], frames.time_s, K).landmarks3d
        for name, landmarks in (
            ("pose network", frames.landmarks3d),
            ("lifter", lifter(frames, K).landmarks3d),
            ("keypoint lifter", in_camera @ view_axes(frames.centre, K)),
        ):
            yield name, landmark_errors(landmarks[shown.rows], shown.landmarks)


def known_clips(folder: Path) -> Iterator[KnownClip]:
    """Clips of a folder whose people are known, by name."""
    for truth in sorted(folder.rglob("*_gt.npz")):
        video = video_beside(truth)
        if video.is_file() and read_boxes(truth, 0) is not None:
            yield KnownClip(video, str(video.relative_to(folder).with_suffix("")), truth)
    for clip in golden_list(folder):
        name = clip.parts[0].video
        # people of a video that joins several recordings are also in these
        joined = any(not cut.linked for cut in clip.cuts)
        if not clip.is_cut and not joined and (folder / name).is_file():
            yield KnownClip(folder / name, str(Path(name).parent) if "/" in name else name, clip)
