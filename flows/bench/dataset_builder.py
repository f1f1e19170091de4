"""`humanmm dataset build ms-aist | ms-h36m | pose2sim | 3dpw | emdb | rich`: videos and truths from data that the user
owns.

They are what `bench ms-real --data` reads.
"""

import functools
import logging
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

import cv2
import numpy as np

from humanmm.config import Config
from humanmm.errors import InputError
from humanmm.models.benchmark.recordings import (
    ImageRecording,
    MultishotCut,
    MultiviewSequence,
    cut_in_turns,
    cut_performance,
)
from humanmm.models.benchmark.tables.statistics import SetStatistics, statistics_of
from humanmm.models.evaluation.rig_truth import CAMERAS, JOINT_NAMES, RigPerson, RigTrack, people_of
from humanmm.models.records.landmarks import LIMBS
from humanmm.models.records.tracks import ScenePeople
from humanmm.models.records.video import VideoFacts
from humanmm.models.synthetic.multishot import split_name
from humanmm.models.video.colors import BT601, Colors, read_colors
from humanmm.models.video.frames import joined, planar_frames, planar_size
from humanmm.models.video.reading import read_facts
from humanmm.storage.readers.datasets import aistpp
from humanmm.storage.readers.datasets.pose2sim import Rig
from humanmm.storage.run_folder.clip_files import write_arrays
from humanmm.storage.run_folder.picture_files import write_video
from humanmm.storage.store.files import replace_file
from humanmm.storage.store.store import Store
from humanmm.tasks.engine.some_stages import results_of, run_stages

log = logging.getLogger(__name__)

QUALITY = 18
"""x264's constant rate factor: hardly different from the source."""
TRANSITIONS = (2, 3, 4)
SEED = 2025
ROOM_PX = 16
"""Cameras of a rig may differ by so much, as one rounded to whole macroblocks does."""
SAME_RATE = 0.01


def write_sequences(root: Path, names: Sequence[str], folder: Path) -> None:
    """The annotations of AIST++ below `root`, one file for each sequence: what `bench ms-aist --data` reads."""
    for name in names:
        replace_file(folder / f"{name}.npz", functools.partial(write_arrays, arrays=aistpp.read_arrays(root, name)))


def build_set(sequences: Iterable[MultiviewSequence], folder: Path) -> SetStatistics:
    """Each performance once with every number of cuts; where it is too short it is left out, with a warning."""
    built = []
    for sequence in sequences:
        for count in TRANSITIONS:
            try:
                path, num_frames, fps = build_clip(sequence, count, folder, seed=SEED)
            except InputError as error:
                log.warning("left out with %s: %s", split_name(count), error)
                continue
            log.info("%s: %d frames", path.name, num_frames)
            built.append((num_frames, fps, count))
    if not built:
        raise InputError("no clip could be made: every sequence is missing files or too short")
    return statistics_of(*zip(*built, strict=True))


def build_clip(sequence: MultiviewSequence, num_cuts: int, folder: Path, *, seed: int) -> tuple[Path, int, float]:
    """Write `<name>-<cuts>.mp4` beside its `_gt.npz`; the video's path, frames and rate. Same seed, same cuts."""
    facts = _facts_of(sequence.videos)
    num_frames = min(sequence.num_frames, *(one.num_frames for one in facts))
    cut = cut_performance(sequence, num_frames, num_cuts, seed=seed)
    path = folder / f"{sequence.name}-{num_cuts}.mp4"
    _write_cut(path, cut, facts)
    return path, cut.num_frames, cut.fps


def build_rig_set(rig: Rig, folder: Path, config: Config, store: Store) -> list[str]:
    """A clip for every two cameras, from the one to the other and back, beside what they all see of everybody; what
    there is to say of the set."""
    facts = _facts_of(rig.videos)
    fps, num_frames = facts[0].fps, min(one.num_frames for one in facts)
    if any(abs(one.fps / fps - 1) > SAME_RATE for one in facts):
        rates = ", ".join(f"{one.fps:g}" for one in facts)
        raise InputError(f"{rig.name}: the videos have {rates} frames a second; synchronised ones have the same")
    for video, one, size in zip(rig.videos, facts, rig.size, strict=True):
        if np.abs(size - [one.width, one.height]).max() > ROOM_PX:
            raise InputError(
                f"{video} is {one.width} x {one.height}, its camera was calibrated for {size[0]:g} x {size[1]:g}"
            )
    tracks = [track for camera in range(len(facts)) for track in _seen_by(rig, camera, num_frames, config, store)]
    people = people_of(tracks, rig.R_world_cam, rig.t_world_cam, num_frames, fps)
    if not people:
        raise InputError(f"{rig.name}: no {CAMERAS} of its cameras see the same person where the calibration has them")
    sequence = MultiviewSequence(
        name=rig.name, fps=fps, joint_names=JOINT_NAMES, people=tuple(person.joints for person in people), K=rig.K,
        R_world_cam=rig.R_world_cam, t_world_cam=rig.t_world_cam, videos=rig.videos,
    )  # fmt: skip
    cuts = cut_in_turns(sequence, num_frames)
    for cut in cuts:
        names = "-".join(rig.videos[camera].stem for camera, _, _ in cut.shots)
        _write_cut(folder / f"{rig.name}-{names}.mp4", cut, facts)
    facts_of_set = statistics_of(*zip(*((cut.num_frames, cut.fps, len(cut.shots) - 1) for cut in cuts), strict=True))
    return [
        *(_sentence(number, person) for number, person in enumerate(people)),
        f"the lenses bend by up to {rig.bend_px():.1f} px, which the truths leave out",
        facts_of_set.sentence(),
    ]


def _sentence(number: int, person: RigPerson) -> str:
    known = np.isfinite(person.joints).all(axis=(1, 2)).mean()
    return (
        f"person {number}: {len(person.cameras)} cameras see joints within {100 * person.spread:.1f} % of the height "
        f"(median), {100 * known:.0f} % of the frames are known"
    )


def _seen_by(rig: Rig, camera: int, num_frames: int, config: Config, store: Store) -> Iterator[RigTrack]:
    """Whom a camera's video shows."""
    run = run_stages(rig.videos[camera], ("decode", "scenes", "people"), config, store)
    for track in (track for scene in results_of(run, "people", ScenePeople) for track in scene.tracks):
        rows = track.frame < num_frames
        keypoints = track.keypoints2d[rows][:, LIMBS]
        yield RigTrack(
            camera=camera,
            frame=track.frame[rows],
            xy=rig.ideal(camera, keypoints[..., :2]),
            visibility=keypoints[..., 2].astype(np.float64),
            height=(track.bbox[rows, 3] - track.bbox[rows, 1]).astype(np.float64) / rig.K[camera, 1, 1],
        )


def write_recording(recording: ImageRecording, folder: Path) -> Path:
    """Write a data set's pictures as `<name>.mp4` beside their `_gt.npz`; the video's path."""
    height, width = (side // 2 * 2 for side in _read_picture(recording.pictures[0]).shape[:2])

    def pictures() -> Iterator[tuple[float, np.ndarray]]:
        for number, path in enumerate(recording.pictures):
            picture = _read_picture(path)[:height, :width]
            yield number / recording.fps, cv2.cvtColor(picture, cv2.COLOR_BGR2YUV_I420)

    path = folder / f"{recording.name}.mp4"
    _write(path, pictures(), recording.fps, (width, height), BT601, recording.truth((width, height)))
    return path


def _write(
    path: Path,
    pictures: Iterator[tuple[float, np.ndarray]],
    fps: float,
    size: tuple[int, int],
    colors: Colors,
    truth: dict[str, np.ndarray],
) -> None:
    replace_file(
        path,
        functools.partial(
            write_video, pictures=pictures, width=size[0], height=size[1], fps=fps, colors=colors, quality=QUALITY
        ),
    )
    replace_file(path.with_name(f"{path.stem}_gt.npz"), functools.partial(write_arrays, arrays=truth))


def _write_cut(path: Path, cut: MultishotCut, facts: Sequence[VideoFacts]) -> None:
    """The video and its truth, as wide and high as the smallest camera's; `facts`: of each camera's video."""
    sizes = [planar_size(facts[camera], None) for camera, _, _ in cut.shots]
    size = min(width for width, _ in sizes), min(height for _, height in sizes)
    if max(np.subtract(one, size).max() for one in sizes) > ROOM_PX:
        raise InputError(
            f"{path.stem}: its cameras' pictures are of several sizes: {', '.join(f'{w} x {h}' for w, h in sizes)}"
        )
    with cut.sequence.videos[cut.shots[0][0]].open("rb") as stream:
        colors = read_colors(stream)
    _write(path, _cut_pictures(cut, facts, size), cut.fps, size, colors, cut.truth(size))


def _facts_of(videos: Sequence[Path]) -> list[VideoFacts]:
    """Of every camera's video; each is decoded once for them."""
    facts = []
    for video in videos:
        with video.open("rb") as stream:
            facts.append(read_facts(stream))
    return facts


def _cut_pictures(
    cut: MultishotCut, facts: Sequence[VideoFacts], size: tuple[int, int]
) -> Iterator[tuple[float, np.ndarray]]:
    """Time and planes of every frame of the cut video; what is too wide or high is cut off at the right and below."""
    width, height = size
    for camera, start, end in cut.shots:
        with cut.sequence.videos[camera].open("rb") as stream:
            for frame in planar_frames(stream, facts[camera], start * cut.step, (end - 1) * cut.step + 1):
                if frame.index % cut.step == 0:
                    luma, *chroma = frame.planes
                    blue, red = (plane[: height // 2, : width // 2] for plane in chroma)
                    yield frame.index / cut.step / cut.fps, joined((luma[:height, :width], blue, red))


def _read_picture(path: Path) -> np.ndarray:
    picture = cv2.imread(str(path))
    if picture is None:
        raise InputError(f"{path} cannot be read as a picture")
    return np.asarray(picture)
