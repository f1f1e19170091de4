"""Identities: IDF1 counts boxes that bear one identity throughout."""

from dataclasses import replace

import numpy as np
import pytest

from humanmm.models.evaluation.people import identity_f1
from humanmm.models.records.sequence import MotionSequence, PersonSequence


def somebody(sequence: MotionSequence, x: float, frames: slice = slice(None)) -> PersonSequence:
    """The sequence's person with boxes at x, over some of its frames."""
    person = sequence.people[0]
    boxes = np.tile([x, 0.0, x + 10.0, 20.0], (len(person.frame), 1))
    return replace(
        person, frame=person.frame[frames], observed=np.ones(len(person.frame), bool)[frames],
        joints=person.joints[frames], bbox_xyxy=boxes[frames], R_world_root=None, contacts=None, body=None,
    )  # fmt: skip


def test_the_same_people_have_an_idf1_of_one(sequence: MotionSequence) -> None:
    both = (somebody(sequence, 0.0), somebody(sequence, 50.0))
    assert identity_f1(both, both[::-1]) == 1.0
    assert identity_f1((), ()) == 1.0


def test_an_identity_that_changes_halfway_counts_half(sequence: MotionSequence) -> None:
    half = len(sequence.people[0].frame) // 2
    one = somebody(sequence, 0.0)
    halves = (somebody(sequence, 0.0, slice(half)), somebody(sequence, 0.0, slice(half, None)))
    assert identity_f1(halves, (one,)) == pytest.approx(0.5, abs=0.02)


def test_who_is_missed_and_who_is_invented_count_against_it(sequence: MotionSequence) -> None:
    one, two = somebody(sequence, 0.0), somebody(sequence, 50.0)
    assert identity_f1((one,), (one, two)) == pytest.approx(2 / 3)
    assert identity_f1((one, two), (one,)) == pytest.approx(2 / 3)
    assert identity_f1((somebody(sequence, 8.0),), (one,)) == 0.0
    assert identity_f1((replace(one, bbox_xyxy=None),), (one,)) == 0.0
