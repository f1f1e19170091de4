"""Discontinuities at cuts: closed where they are, and nothing else is touched."""

import numpy as np
import pytest

from humanmm.models.motion.refine.discontinuities import FADE_S, LONGEST_STEP_S, close_discontinuities

N, CUT, FPS = 120, 60, 30.0
TIME = np.arange(N) / FPS
FRAME = np.arange(N)
JUMP = np.array([0.2, -0.1, 0.15])


def poses(*, bias: np.ndarray = JUMP) -> np.ndarray:
    """Two joints that move slowly, with the second shot's pose off by a bias."""
    moving = 0.2 * np.sin(TIME)[:, None, None] * np.array([[1.0, 0.5, 0.0], [0.0, 0.3, 0.8]])
    return moving + np.where(FRAME >= CUT, 1.0, 0.0)[:, None, None] * bias


def closed(vectors: np.ndarray, observed: np.ndarray | None = None, cuts: tuple[int, ...] = (CUT,)) -> np.ndarray:
    seen = np.ones(N, bool) if observed is None else observed
    return close_discontinuities(vectors, frame=FRAME, observed=seen, time_s=TIME, cut_frames=cuts)


def test_both_sides_meet_at_the_cut_and_each_gives_half() -> None:
    before, after = poses(), closed(poses())
    step = np.linalg.norm(after[CUT] - after[CUT - 1], axis=-1)
    assert step.max() < 0.05 * np.linalg.norm(JUMP) + 0.01  # one frame's own motion is left
    moved = np.linalg.norm(after - before, axis=-1)
    np.testing.assert_allclose(moved[CUT - 1], np.linalg.norm(JUMP) / 2, rtol=0.1)
    np.testing.assert_allclose(moved[CUT], np.linalg.norm(JUMP) / 2, rtol=0.1)


def test_further_away_than_the_fade_nothing_changes() -> None:
    far = np.abs(TIME - (CUT - 0.5) / FPS) > FADE_S + 1 / FPS
    np.testing.assert_allclose(closed(poses())[far], poses()[far], atol=1e-12)


def test_a_continuous_motion_stays_as_it_is() -> None:
    smooth = poses(bias=np.zeros(3))
    np.testing.assert_allclose(closed(smooth), smooth, atol=2e-3)  # a straight line through 0.1 s of a sine


def test_a_gap_at_the_cut_is_left_to_be_filled_in() -> None:
    observed = np.ones(N, bool)
    observed[CUT : CUT + int(LONGEST_STEP_S * FPS) + 1] = False
    np.testing.assert_array_equal(closed(poses(), observed), poses())


@pytest.mark.parametrize("rate_hz", [30.0, 5.0, 4.0, 3.0])
def test_a_cut_is_closed_however_far_apart_frames_are_and_a_frame_that_is_missing_there_is_a_gap(
    rate_hz: float,
) -> None:
    vectors = np.where(FRAME >= CUT, 1.0, 0.0)[:, None, None] * np.tile(JUMP, (N, 2, 1))
    step = {}
    for missing in (0, int(max(LONGEST_STEP_S * rate_hz, 1))):
        observed = np.ones(N, bool)
        observed[CUT : CUT + missing] = False
        after = close_discontinuities(
            vectors, frame=FRAME, observed=observed, time_s=FRAME / rate_hz, cut_frames=(CUT,)
        )
        step[missing > 0] = np.linalg.norm(after[CUT + missing] - after[CUT - 1], axis=-1).max() / np.linalg.norm(JUMP)
    assert step[False] < 0.5  # the frames next to the cut are some way into the fade at 3 Hz
    assert step[True] == pytest.approx(1.0)


def test_cuts_around_a_short_shot_without_the_person_are_closed_once() -> None:
    observed = np.ones(N, bool)
    observed[CUT - 3 : CUT] = False
    twice = closed(poses(), observed, cuts=(CUT - 3, CUT))
    np.testing.assert_array_equal(twice, closed(poses(), observed))
    step = np.linalg.norm(twice[CUT] - twice[CUT - 4], axis=-1)
    assert step.max() < 0.05 * np.linalg.norm(JUMP) + 0.04  # four frames' own motion is left


def test_a_side_is_carried_on_from_its_own_shot_alone() -> None:
    late = poses() + np.where(FRAME >= CUT + 2, 1.0, 0.0)[:, None, None] * 10 * JUMP
    moved = closed(late, cuts=(CUT, CUT + 2)) - late
    np.testing.assert_allclose(np.linalg.norm(moved[CUT - 1], axis=-1), np.linalg.norm(JUMP) / 2, rtol=0.1)


def test_without_a_cut_there_is_nothing_to_close() -> None:
    np.testing.assert_array_equal(closed(poses(), cuts=()), poses())
