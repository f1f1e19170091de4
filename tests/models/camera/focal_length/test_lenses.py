"""Shots share one lens unless their evidence says clearly that they do not."""

import pytest

from humanmm.models.camera.focal_length.evidence import FocalEvidence
from humanmm.models.camera.focal_length.lenses import groups_of, with_own_lens


def own_lenses(*shots: tuple[float, float] | None, frames: int = 50) -> list[int]:
    """The shots with a lens of their own; of each the focal length and its uncertainty, or nothing."""
    evidence = [[] if shot is None else [FocalEvidence(*shot)] for shot in shots]
    groups = groups_of(evidence, {}, [frames + k for k in range(len(shots))])
    return sorted(shot for group in with_own_lens(groups, 500.0) for shot in group.ratios)


def test_shots_that_agree_share_a_lens() -> None:
    assert own_lenses((600.0, 0.01), (612.0, 0.02), None, (590.0, 0.05)) == []


def test_a_shot_that_is_surely_different_has_its_own() -> None:
    assert own_lenses((600.0, 0.005), (840.0, 0.005), (605.0, 0.005)) == [1]


def test_what_is_uncertain_shares_the_lens_of_the_others() -> None:
    assert own_lenses((600.0, 0.005), (840.0, 0.3), (605.0, 0.005)) == []


def test_of_two_that_contradict_one_another_the_shorter_leaves() -> None:
    assert own_lenses((600.0, 0.004), (900.0, 0.004)) == [0]


def test_of_many_lenses_the_commonest_is_the_videos() -> None:
    assert own_lenses((400.0, 0.004), (600.0, 0.004), (604.0, 0.004), (900.0, 0.004)) == [0, 3]


def test_enlarged_shots_have_one_unknown_lens() -> None:
    evidence = [[FocalEvidence(600.0, 0.01)], [FocalEvidence(840.0, 0.01)], [], [FocalEvidence(600.0, 0.01)]]
    groups = groups_of(evidence, {1: 1.4, 2: 1 / 1.395}, [50] * 4)
    assert [group.ratios for group in groups] == [{0: 1.0, 1: pytest.approx(1.4), 2: 1.0}, {3: 1.0}]
    assert [one.focal_px for one in groups[0].evidence if isinstance(one, FocalEvidence)] == pytest.approx([600, 600])
    assert with_own_lens(groups, 500.0) == []


def test_a_shot_that_is_closer_than_the_one_before_is_the_longer_lens() -> None:
    (group,) = groups_of([[], []], {1: 0.5}, [10, 10])
    assert group.ratios == {0: 2.0, 1: 1.0}
