"""Scores of cuts."""

from humanmm.models.evaluation.cuts import score_cuts


def test_two_frames_off_is_right_and_three_is_wrong() -> None:
    assert score_cuts([52], [(50, 50)]).f1 == 1.0
    assert score_cuts([53], [(50, 50)]).f1 == 0.0


def test_a_dissolve_is_found_anywhere_in_it_and_counts_once() -> None:
    assert score_cuts([210], [(213, 225)]).f1 == 1.0
    twice = score_cuts([215, 222], [(213, 225)])
    assert (twice.precision, twice.recall) == (0.5, 1.0)


def test_matching_is_one_to_one_and_the_best_possible() -> None:
    # 51 fits both; only giving it to 53 lets 49 have 50
    scores = score_cuts([51, 49], [(50, 50), (53, 53)])
    assert (scores.precision, scores.recall) == (1.0, 1.0)


def test_nothing_to_find_and_nothing_found_is_perfect() -> None:
    assert score_cuts([], []).f1 == 1.0
    assert score_cuts([5], []).f1 == 0.0
    assert score_cuts([], [(5, 5)]).f1 == 0.0
