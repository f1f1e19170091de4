"""Whether somebody goes on across a cut as before it."""

from dataclasses import replace

import numpy as np
import pytest

from humanmm.models.cuts.continuity import USUAL_M, goes_on, pose_jumps
from humanmm.models.records.motion import PersonShotMotion

FPS, CUT, FRAMES = 30.0, 15, 30
TIME_S = np.arange(FRAMES) / FPS


def walking(frames: slice, lost_s: float = 0.0, fps: float = FPS) -> dict[int, PersonShotMotion]:
    """Legs and arms that swing once a second, as they are `lost_s` later than the time stamps say."""
    frame = np.arange(FRAMES, dtype=np.int32)[frames]
    phase = 2 * np.pi * (frame / fps + lost_s)
    pose = np.zeros((len(frame), 23, 3), np.float32)
    pose[:, [0, 16], 0] = 0.6 * np.sin(phase)[:, None]
    pose[:, [1, 15], 0] = -0.6 * np.sin(phase)[:, None]
    n = len(frame)
    one = PersonShotMotion(
        0, frame, np.ones(n, bool), np.tile(np.eye(3), (n, 1, 1)), pose, np.zeros(10), np.zeros((n, 3)),
        np.zeros(n, np.float32), np.ones(n, np.float32), np.zeros(n, np.float32), np.full(n, 0.03, np.float32),
    )  # fmt: skip
    return {0: one}


BEFORE, AFTER = slice(0, CUT), slice(CUT, FRAMES)


def test_limbs_that_swing_on_are_where_they_were_going() -> None:
    (jump,) = pose_jumps(walking(BEFORE), walking(AFTER), TIME_S)
    assert jump.person == 0 and jump.jump_m < 0.02
    assert jump.expected_m == pytest.approx(np.hypot(0.03, 0.03))
    assert goes_on(jump.jump_m, jump.expected_m)


def test_half_a_step_that_was_left_out_is_seen() -> None:
    (jump,) = pose_jumps(walking(BEFORE), walking(AFTER, lost_s=0.4), TIME_S)
    assert jump.jump_m > 0.2
    assert not goes_on(jump.jump_m, jump.expected_m)


@pytest.mark.parametrize("fps", [10.0, 12.5, 15.0, 20.0, 24.0, 25.0, 50.0])
def test_lost_time_is_seen_at_every_frame_rate(fps: float) -> None:
    for first in (0.0, 3.7, 1234.567):
        time_s = first + np.arange(FRAMES) / fps
        jumps = [
            pose_jumps(walking(BEFORE, fps=fps), walking(AFTER, lost_s=lost_s, fps=fps), time_s)
            for lost_s in (0.25, 0.5)  # a quarter and half of a swing: one of them shows whatever the phase is
        ]
        assert not all(goes_on(one.jump_m, one.expected_m) for (one,) in jumps)


@pytest.mark.parametrize(("fps", "said"), [(24.0, 0), (10.0, 1)])
def test_the_span_is_longer_only_where_frames_are_far_apart(fps: float, said: int) -> None:
    """Where a frame of a faster video is missing, too few are left."""
    time_s = np.arange(FRAMES) / fps
    ending = walking(BEFORE, fps=fps)[0]
    gap = replace(ending, observed=ending.frame != CUT - 2) if fps > 20 else ending
    assert len(pose_jumps({0: gap}, walking(AFTER, fps=fps), time_s)) == said


def test_where_somebody_was_not_seen_at_the_cut_nothing_is_said() -> None:
    hidden = walking(AFTER)[0]
    late = replace(hidden, observed=hidden.frame >= CUT + 8)
    assert pose_jumps(walking(BEFORE), {0: late}, TIME_S) == ()
    assert pose_jumps(walking(BEFORE), {0: replace(hidden, observed=hidden.frame < 0)}, TIME_S) == ()
    assert pose_jumps(walking(BEFORE), {1: hidden}, TIME_S) == ()


def test_a_pose_whose_error_nothing_foretells_has_a_usual_one() -> None:
    silent = replace(walking(AFTER)[0], pose_error_m=np.full(FRAMES - CUT, np.nan, np.float32))
    (jump,) = pose_jumps(walking(BEFORE), {0: silent}, TIME_S)
    assert jump.expected_m == pytest.approx(np.hypot(0.03, USUAL_M))
