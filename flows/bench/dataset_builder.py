"""`humanmm dataset build ms-aist | ms-h36m | 3dpw | emdb | rich`: videos and truths from data that the user owns.

They are what `bench ms-real --data` reads.
"""

import functools
import logging
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path

import cv2
import numpy as np

from humanmm.errors import InputError
from humanmm.models.benchmark.recordings import ImageRecording, MultishotCut, MultiviewSequence, cut_performance
from humanmm.models.benchmark.tables.statistics import SetStatistics, statistics_of
from humanmm.models.synthetic.multishot import split_name
from humanmm.models.video.colors import BT601, Colors, read_colors
from humanmm.models.video.frames import joined, planar_frames, planar_size
from humanmm.models.video.reading import read_facts
from humanmm.storage.readers.datasets import aistpp
from humanmm.storage.run_folder.clip_files import write_arrays
from humanmm.storage.run_folder.picture_files import write_video
from humanmm.storage.store.files import replace_file

log = logging.getLogger(__name__)

QUALITY = 18
"""x264's constant rate factor: hardly different from the source."""
TRANSITIONS = (2, 3, 4)
SEED = 2025


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
    lengths = [sequence.num_frames]
    for video in sequence.videos:
        with video.open("rb") as stream:
            lengths.append(read_facts(stream).num_frames)
    cut = cut_performance(sequence, min(lengths), num_cuts, seed=seed)
    first = sequence.videos[cut.shots[0][0]]
    with first.open("rb") as stream:
        size, colors = planar_size(read_facts(stream), None), read_colors(stream)
    path = folder / f"{sequence.name}-{num_cuts}.mp4"
    _write(path, _cut_pictures(cut, size), cut.fps, size, colors, cut.truth(size))
    return path, cut.num_frames, cut.fps


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


def _cut_pictures(cut: MultishotCut, size: tuple[int, int]) -> Iterator[tuple[float, np.ndarray]]:
    """Time and planes of every frame of the cut video."""
    for camera, start, end in cut.shots:
        video = cut.sequence.videos[camera]
        with video.open("rb") as stream:
            facts = read_facts(stream)
            if planar_size(facts, None) != size:
                raise InputError(f"{video} is {facts.width} x {facts.height}, the first shot's {size[0]} x {size[1]}")
            for frame in planar_frames(stream, facts, start * cut.step, (end - 1) * cut.step + 1):
                if frame.index % cut.step == 0:
                    yield frame.index / cut.step / cut.fps, joined(frame.planes)


def _read_picture(path: Path) -> np.ndarray:
    picture = cv2.imread(str(path))
    if picture is None:
        raise InputError(f"{path} cannot be read as a picture")
    return np.asarray(picture)
