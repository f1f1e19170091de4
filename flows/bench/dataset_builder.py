"""`humanmm dataset build ms-aist | ms-h36m`: multi-shot videos with truths, cut from data that the user owns.

As in the paper (section 4): a performance that several cameras filmed at once is cut at random times, and every clip is
taken from a random camera other than the last. The videos and truths are what `bench ms-real --data` reads.
"""

import functools
import logging
from collections.abc import Iterator, Sequence
from pathlib import Path

import cv2
import numpy as np

from humanmm.errors import InputError
from humanmm.models.benchmark.tables.statistics import SetStatistics, statistics_of
from humanmm.models.synthetic.multishot import cut_times, split_name
from humanmm.models.video.colors import BT601, read_colors
from humanmm.models.video.frames import joined, planar_frames, planar_size
from humanmm.models.video.reading import read_facts
from humanmm.storage.readers.datasets.multiview import MultiviewSequence
from humanmm.storage.readers.datasets.recording import ImageRecording
from humanmm.storage.run_folder.picture_files import write_video
from humanmm.storage.store.files import replace_file

log = logging.getLogger(__name__)

RATE_HZ = 30.0
"""Sequences at about a multiple of this are thinned out to it, as the paper's videos are."""
QUALITY = 18
"""x264's constant rate factor: hardly to be told from the source."""
SHORTEST_S = 0.6


def build_clip(sequence: MultiviewSequence, num_cuts: int, folder: Path, *, seed: int) -> tuple[Path, int, float]:
    """Write `<name>-<cuts>.mp4` beside its `_gt.npz`; the video's path, frames and rate. Same seed, same cuts."""
    step = max(1, round(sequence.fps / RATE_HZ))
    fps = sequence.fps / step
    rows = np.arange(0, _common_length(sequence), step)
    if len(rows) < (num_cuts + 1) * SHORTEST_S * fps:
        raise InputError(f"{sequence.name} is too short for {num_cuts} cuts: {len(rows)} frames at {fps:g} a second")
    rng = np.random.default_rng([seed, num_cuts, *sequence.name.encode()])
    cuts = cut_times(len(rows), num_cuts, fps, rng)
    spans = list(zip([0, *cuts], [*cuts, len(rows)], strict=True))
    cameras = [int(rng.integers(len(sequence.videos)))]
    for _ in cuts:
        cameras.append((cameras[-1] + int(rng.integers(1, len(sequence.videos)))) % len(sequence.videos))
    path = folder / f"{sequence.name}-{num_cuts}.mp4"
    replace_file(path, functools.partial(_write_clip, sequence, cameras, spans, step, fps))
    camera_of = np.repeat(cameras, [end - start for start, end in spans])
    truth = _truth(sequence, rows, camera_of, cuts, fps, _size(sequence.videos[cameras[0]]))
    replace_file(path.with_name(f"{path.stem}_gt.npz"), lambda fresh: _save(fresh, truth))
    return path, len(rows), fps


def build_set(
    sequences: Iterator[MultiviewSequence], folder: Path, *, transitions: Sequence[int], seed: int
) -> SetStatistics:
    """Each sequence once with every number of cuts; one that is too short for some is left out there, and told."""
    lengths, rates, counts = [], [], []
    for sequence in sequences:
        for count in transitions:
            try:
                path, num_frames, fps = build_clip(sequence, count, folder, seed=seed)
            except InputError as error:
                log.warning("left out with %s: %s", split_name(count), error)
                continue
            log.info("%s: %d frames", path.name, num_frames)
            lengths.append(num_frames)
            rates.append(fps)
            counts.append(count)
    if not lengths:
        raise InputError("no clip could be made: every sequence is missing files or too short")
    return statistics_of(lengths, rates, counts)


def _common_length(sequence: MultiviewSequence) -> int:
    """Frames that the joints and all videos have."""
    lengths = [sequence.num_frames]
    for video in sequence.videos:
        with video.open("rb") as stream:
            lengths.append(read_facts(stream).num_frames)
    return min(lengths)


def _size(video: Path) -> tuple[int, int]:
    with video.open("rb") as stream:
        return planar_size(read_facts(stream), None)


def _write_clip(
    sequence: MultiviewSequence,
    cameras: Sequence[int],
    spans: Sequence[tuple[int, int]],
    step: int,
    fps: float,
    path: Path,
) -> None:
    first = sequence.videos[cameras[0]]
    width, height = _size(first)
    with first.open("rb") as stream:
        colors = read_colors(stream)

    def pictures() -> Iterator[tuple[float, np.ndarray]]:
        for camera, (start, end) in zip(cameras, spans, strict=True):
            video = sequence.videos[camera]
            with video.open("rb") as stream:
                facts = read_facts(stream)
                if planar_size(facts, None) != (width, height):
                    raise InputError(f"{video} is {facts.width} x {facts.height}, {first.name} {width} x {height}")
                for frame in planar_frames(stream, facts, start * step, (end - 1) * step + 1):
                    if frame.index % step == 0:
                        yield frame.index / step / fps, joined(frame.planes)

    write_video(path, pictures(), width=width, height=height, fps=fps, colors=colors, quality=QUALITY)


def write_recording(recording: ImageRecording, folder: Path) -> Path:
    """Write a data set's pictures as `<name>.mp4` beside their `_gt.npz`; the video's path."""
    height, width = _read_picture(recording.pictures[0]).shape[:2]
    width, height = width // 2 * 2, height // 2 * 2

    def planes() -> Iterator[tuple[float, np.ndarray]]:
        for number, path in enumerate(recording.pictures):
            picture = _read_picture(path)[:height, :width]
            yield number / recording.fps, cv2.cvtColor(picture, cv2.COLOR_BGR2YUV_I420)

    path = folder / f"{recording.name}.mp4"
    count = len(recording.pictures)
    replace_file(
        path,
        lambda fresh: write_video(
            fresh, planes(), width=width, height=height, fps=recording.fps, colors=BT601, quality=QUALITY
        ),
    )
    cameras = {
        "cameras/K": np.tile(recording.K, (count, 1, 1)),
        "cameras/R_world_cam": recording.R_world_cam,
        "cameras/t_world_cam": recording.t_world_cam,
    }
    truth = _header(recording.joint_names, count, (), recording.fps, (width, height)) | cameras
    for number, (joints, observed) in enumerate(zip(recording.people, recording.observed, strict=True)):
        truth |= _person(number, joints, observed)
    replace_file(path.with_name(f"{path.stem}_gt.npz"), lambda fresh: _save(fresh, truth))
    return path


def _read_picture(path: Path) -> np.ndarray:
    picture = cv2.imread(str(path))
    if picture is None:
        raise InputError(f"{path} cannot be read as a picture")
    return np.asarray(picture)


def _truth(
    sequence: MultiviewSequence,
    rows: np.ndarray,
    camera_of: np.ndarray,
    cuts: Sequence[int],
    fps: float,
    size: tuple[int, int],
) -> dict[str, np.ndarray]:
    """The truth's arrays, named as in motion.zarr."""
    joints = sequence.joints[rows]
    return {
        **_header(sequence.joint_names, len(rows), cuts, fps, size),
        "cameras/K": sequence.K[camera_of],
        "cameras/R_world_cam": sequence.R_world_cam[camera_of],
        "cameras/t_world_cam": sequence.t_world_cam[camera_of],
        **_person(0, joints, np.isfinite(joints).all(axis=(1, 2))),
    }


def _header(
    joint_names: Sequence[str], num_frames: int, cuts: Sequence[int], fps: float, size: tuple[int, int]
) -> dict[str, np.ndarray]:
    return {
        "schema": np.array("humanmm.truth/1"),
        "fps": np.array(fps),
        "width": np.array(size[0]),
        "height": np.array(size[1]),
        "num_frames": np.array(num_frames),
        "cut_frames": np.array(cuts, np.int32),
        "joint_names": np.array(joint_names),
        "parents": np.full(len(joint_names), -1, np.int32),  # points, no tree
        "time_s": np.arange(num_frames) / fps,
    }


def _person(number: int, joints: np.ndarray, observed: np.ndarray) -> dict[str, np.ndarray]:
    prefix = f"people/{number:02d}"
    return {
        f"{prefix}/frame": np.arange(len(joints), dtype=np.int32),
        f"{prefix}/joints": joints,
        f"{prefix}/observed": observed,
        f"{prefix}/visibility": np.isfinite(joints).all(axis=2).mean(axis=1).astype(np.float32),
    }


def _save(path: Path, arrays: dict[str, np.ndarray]) -> None:
    with path.open("wb") as file:
        np.savez_compressed(file, **arrays)  # type: ignore[arg-type]
