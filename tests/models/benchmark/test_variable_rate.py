"""Known motion seen at irregular times, through shots, cameras, bodies, alignment and refinement."""

from dataclasses import replace

import numpy as np
import pytest

from humanmm.config import Config
from humanmm.models.benchmark.methods import run_methods
from humanmm.models.records.camera import PointTracks
from humanmm.models.records.shots import Scenes
from humanmm.models.records.tracks import PersonTrack, ScenePeople
from humanmm.models.synthetic.mocap import MocapSequence
from humanmm.models.synthetic.multishot import BenchVideo, build_video, plan_videos


def kept_track(track: PersonTrack, kept: np.ndarray) -> PersonTrack:
    rows = np.flatnonzero(np.isin(track.frame, kept))
    names = ("keypoints2d", "landmarks3d", "bbox", "confidence", "mask_affine")
    return replace(
        track,
        frame=np.searchsorted(kept, track.frame[rows]).astype(np.int32),
        color_frame=np.searchsorted(kept, track.color_frame).astype(np.int32),
        masks=track.masks.chosen(rows),
        **{name: getattr(track, name)[rows] for name in names},
    )


def kept_points(points: PointTracks, kept: np.ndarray) -> PointTracks:
    rows = np.isin(points.frame, kept)
    start, end = np.searchsorted(kept, (points.start, points.end)).tolist()
    frame = np.searchsorted(kept, points.frame[rows]).astype(np.int32)
    return replace(points, start=start, end=end, track=points.track[rows], frame=frame, xy=points.xy[rows],
                   confidence=points.confidence[rows])  # fmt: skip


def with_frames(video: BenchVideo, kept: np.ndarray) -> BenchVideo:
    """The same observations, of some frames only: a variable-rate video."""

    def number(frame: int) -> int:
        return int(np.searchsorted(kept, frame))

    transitions = tuple(replace(t, start=number(t.start), end=number(t.end)) for t in video.scenes.transitions)
    return replace(
        video,
        facts=replace(video.facts, time_s=video.facts.time_s[kept], keyframe=video.facts.keyframe[kept]),
        scenes=Scenes(len(kept), transitions),
        people=tuple(
            ScenePeople(number(scene.start), number(scene.end), tuple(kept_track(t, kept) for t in scene.tracks))
            for scene in video.people
        ),
        points=tuple(kept_points(points, kept) for points in video.points),
    )


def speed_ratios(sequence: MocapSequence, seed: int) -> tuple[float, float, float, float]:
    """Found over true speed where frames are dense and where they are sparse, then the same as if frames were evenly
    apart."""
    video = build_video(sequence, plan_videos((sequence,), 1, seed=seed, transitions=(1,), longest=60)[0])
    true_path = video.truth.people[0].joints[:, 0, :2]
    true_speed = np.linalg.norm(np.diff(true_path, axis=0), axis=1).mean() * 30
    dense = np.arange(60) < 24
    kept = np.flatnonzero(dense | (np.arange(60) % 3 == 0))
    (done,) = run_methods(with_frames(video, kept), Config(), ("humanmm without refine",)).motions
    assert done.motion is not None, done.reason
    person = done.motion.people[0]
    moved = np.linalg.norm(np.diff(person.pelvis_world[:, :2], axis=0), axis=1)
    time_s = video.facts.time_s[kept][person.frame]
    is_dense = dense[kept][person.frame][1:]

    def ratio(steps: np.ndarray, at_s: np.ndarray) -> float:
        return float(moved[steps].sum() / np.diff(at_s)[steps].sum() / true_speed)

    evenly_s = np.linspace(time_s[0], time_s[-1], len(time_s))
    return ratio(is_dense, time_s), ratio(~is_dense, time_s), ratio(is_dense, evenly_s), ratio(~is_dense, evenly_s)


@pytest.mark.slow
def test_a_walk_has_its_true_speed_in_the_world_where_frames_are_dense_and_where_they_are_sparse(
    sequences: tuple[MocapSequence, ...],
) -> None:
    # one camera and three quarters of a second tell a walker's speed within a third: hence the middle of nine
    middle = np.median([speed_ratios(sequences[0], seed) for seed in range(9)], axis=0)
    dense, sparse, dense_evenly, sparse_evenly = middle.tolist()
    assert 0.85 < dense < 1.15
    assert 0.85 < sparse < 1.15
    # as if frames were evenly apart, the body would speed up where they are sparse
    assert sparse_evenly > 1.5
    assert sparse_evenly > 2.5 * dense_evenly
