"""Who is who in the pictures of calibrated cameras, and where his joints are."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from humanmm.models.evaluation.rig_truth import RigTrack, people_of, smooth
from humanmm.models.geometry.projection import project, world_to_camera

C, F, FPS = 4, 60, 30.0
R = np.stack([Rotation.from_euler("xz", [-100, 90 * k + 20], degrees=True).as_matrix() for k in range(C)])
R = np.array([matrix @ np.diag([1.0, -1, -1]) if matrix[2, 1] > 0 else matrix for matrix in R])
T = -5.0 * R[:, :, 2]


def walker(seed: int, start: tuple[float, float]) -> np.ndarray:
    """(F, 12, 3) joints of a stiff body that moves a metre."""
    body = np.random.default_rng(seed).normal(scale=[0.2, 0.2, 0.5], size=(12, 3))
    return body + np.array([*start, 0.0]) + np.linspace([0, 0, 0], [1.0, 0.3, 0.0], F)[:, None]


def tracks_of(joints: np.ndarray, *, cameras: range = range(C), noise: float = 0.0) -> list[RigTrack]:
    found = []
    for camera in cameras:
        in_camera = world_to_camera(joints, R[[camera]], T[[camera]])
        assert (in_camera[..., 2] > 1).all()
        xy = project(in_camera, np.eye(3), near_m=0.1)
        xy = xy + np.random.default_rng(camera).normal(scale=noise, size=xy.shape)
        height = np.full(F, np.ptp(xy[..., 1]))
        found.append(RigTrack(camera, np.arange(F), xy, np.ones((F, 12)), height))
    return found


def test_each_person_is_put_together_from_all_cameras_whatever_the_order_of_the_tracks() -> None:
    one, other = walker(0, (-0.8, -0.5)), walker(1, (-0.4, 0.6))
    tracks = [*tracks_of(one, noise=0.002), *tracks_of(other, noise=0.002)]
    order = np.random.default_rng(3).permutation(len(tracks))
    people = people_of([tracks[k] for k in order], R, T, F, FPS)
    assert [person.cameras for person in people] == [(0, 1, 2, 3)] * 2
    for truth in (one, other):
        error = min(np.linalg.norm(person.joints - truth, axis=-1).max() for person in people)
        assert error < 0.03
    assert max(person.spread for person in people) < 0.02


def test_whom_two_cameras_see_is_nobody_of_the_truth() -> None:
    tracks = [*tracks_of(walker(0, (-0.5, 0.0))), *tracks_of(walker(1, (0.3, 0.4)), cameras=range(2))]
    people = people_of(tracks, R, T, F, FPS)
    assert len(people) == 1 and people[0].spread == pytest.approx(0.0, abs=1e-9)


def test_a_camera_whose_track_breaks_has_both_its_parts_in_the_person() -> None:
    whole = tracks_of(walker(0, (-0.5, 0.0)))
    part = {name: getattr(whole[1], name) for name in ("frame", "xy", "visibility", "height")}
    parts = [
        replace(whole[1], **{name: value[rows] for name, value in part.items()})
        for rows in (slice(25), slice(30, None))
    ]
    people = people_of([whole[0], *parts, *whole[2:]], R, T, F, FPS)
    assert [person.cameras for person in people] == [(0, 1, 2, 3)]
    assert np.isfinite(people[0].joints).all()


def test_a_joint_on_which_cameras_disagree_for_long_is_not_known() -> None:
    tracks = tracks_of(walker(0, (-0.5, 0.0)))
    for track, shift in zip(tracks, (0.2, -0.2, 0.4, -0.4), strict=True):
        track.xy[20:40, 3] += shift
    joints = people_of(tracks, R, T, F, FPS)[0].joints
    assert (
        np.isnan(joints[20:40, 3]).all() and np.isfinite(joints[:, [0, 5]]).all() and np.isfinite(joints[:19, 3]).all()
    )


def test_short_holes_are_filled_and_tremor_is_taken_out() -> None:
    path = np.zeros((F, 1, 3))
    path[:, 0, 0] = np.sin(2 * np.pi * np.arange(F) / FPS)  # one beat a second
    trembling = path + 0.05 * np.cos(np.pi * np.arange(F))[:, None, None]  # fifteen
    trembling[30:33], trembling[45:55] = np.nan, np.nan
    smoothed = smooth(trembling, FPS)
    assert np.isfinite(smoothed[:45]).all() and np.isnan(smoothed[45:55]).all()
    assert np.abs(smoothed - path)[5:28].max() < 0.02
