"""The stages before the shots are joined."""

from dataclasses import replace

from humanmm.config import Config
from humanmm.models.benchmark.beginning import begin, points_of_shots, without_swap_correction
from humanmm.models.synthetic.multishot import BenchVideo


def test_only_shots_with_sides_put_right_are_fitted_again_without_that(video: BenchVideo) -> None:
    start = begin(video, Config())
    assert not any(appearance.left_right_swapped for shot in start.shots.shots for appearance in shot.people)
    first = start.shots.shots[0]
    span = ((first.start, first.start + 5),)
    people = tuple(replace(one, left_right_swapped=span) for one in first.people)
    shots = replace(start.shots, shots=(replace(first, people=people), *start.shots.shots[1:]))
    again = without_swap_correction(video, Config(), replace(start, shots=shots))
    assert again.shots == start.shots
    assert again.motions[0] is not start.motions[0]
    assert all(new is old for new, old in zip(again.motions[1:], start.motions[1:], strict=True))


def test_points_of_a_shot_are_those_seen_outside_gradual_transitions(video: BenchVideo) -> None:
    shots = begin(video, Config()).shots
    for shot, points in zip(shots.shots, points_of_shots(video, shots), strict=True):
        assert (points.start, points.end) == (shot.start, shot.end)
        first, end = shot.outside_transitions
        assert ((points.frame >= first) & (points.frame < end)).all()
