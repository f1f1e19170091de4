"""Known motion seen at irregular times, through shots, cameras, bodies, alignment and refinement."""

from dataclasses import replace

import numpy as np

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
        side_votes=track.side_votes[rows] if len(track.side_votes) else track.side_votes,
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


def test_a_walk_has_its_true_speed_in_the_world_where_frames_are_dense_and_where_they_are_sparse(
    sequences: tuple[MocapSequence, ...],
) -> None:
    video = build_video(sequences[0], plan_videos(sequences[:1], 1, seed=4, transitions=(2,))[0])
    dense = np.arange(100) < 50
    kept = np.flatnonzero(dense | (np.arange(100) % 3 == 0))
    (done,) = run_methods(with_frames(video, kept), Config(), ("humanmm",)).motions
    assert done.motion is not None, done.reason
    person = done.motion.people[0]
    time_s = video.facts.time_s[kept][person.frame]
    shot = np.searchsorted([t.start for t in with_frames(video, kept).scenes.transitions], person.frame, side="right")

    def speed(rows: np.ndarray, at_s: np.ndarray) -> float:
        """Horizontal, metres a second, over steps inside shots."""
        steps = rows[:-1] & rows[1:] & (shot[:-1] == shot[1:])
        moved = np.linalg.norm(np.diff(person.pelvis_world[:, :2], axis=0), axis=1)
        return float(moved[steps].sum() / np.diff(at_s)[steps].sum())

    is_dense = dense[kept][person.frame]
    evenly_s = np.linspace(time_s[0], time_s[-1], len(time_s))
    for rows in (is_dense, ~is_dense):
        # the body walks at 1 m/s; one camera tells its size within a tenth or two
        assert abs(speed(rows, time_s) - 1.0) < 0.25
    assert speed(is_dense, evenly_s) < 0.75  # as if frames were evenly apart
