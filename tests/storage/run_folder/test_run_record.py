"""What run.json says of guesses, and which of them are warnings."""

import math
from dataclasses import replace

import numpy as np
import pytest
from three_shots import results

from humanmm.models.motion.world.align import align
from humanmm.models.records.camera import Intrinsics
from humanmm.models.records.recording import Guesses, IdentityGuess, OffFloor
from humanmm.models.records.shots import Appearance, Shot, ShotList
from humanmm.models.records.video import VideoFacts
from humanmm.storage.run_folder.run_record import (
    CorrectionRecord,
    _disputed,
    _doubts,
    _floor,
    _people,
    _scale,
    _shots,
    _unlikely_heights,
)

SURE = Guesses(0.02, 300, (IdentityGuess(0, 1, 0.97),))
SHOTS = ShotList(
    60,
    tuple(
        Shot(k, 20 * k, 20 * (k + 1), k, None, tuple(Appearance(person, n) for n, person in enumerate(here)))
        for k, here in enumerate([(0, 1), (0, 2), (0, 1, 3)])
    ),
    (),
)


def _intrinsics(uncertainty: float, source: str = "estimated") -> Intrinsics:
    return Intrinsics(900.0, 1280, 720, source, uncertainty)  # type: ignore[arg-type]


def _correction(kind: str, *, applied: bool = True) -> CorrectionRecord:
    return CorrectionRecord({"kind": kind}, kind, applied, "")


def test_what_is_sure_has_no_warning() -> None:
    assert list(_doubts(_intrinsics(0.05), SURE, (), SHOTS)) == []
    assert _floor(SURE, ()) == {"source": "feet", "uncertainty_m": 0.02, "standing_soles": 300}


@pytest.mark.parametrize(
    ("uncertainty", "guesses", "message"),
    [
        (0.31, SURE, "the focal length is uncertain by 31 %"),
        (0.05, Guesses(math.nan, 3), "hardly anybody is seen standing"),
        (0.05, Guesses(0.14, 300), r"standing feet differ in height by ± 0.14 m"),
        (
            0.05,
            Guesses(0.02, 300, off_floor=(OffFloor(1, 5, 30, 0.22),)),
            "person 1 stands 0.22 m above the floor, frames 5",
        ),
        (
            0.05,
            Guesses(0.02, 300, (IdentityGuess(1, 2, 0.55),)),
            "person 1 in shot 2 may be somebody who was not seen before (probability 0.55 that it is not)",
        ),
        (
            0.05,
            Guesses(0.02, 300, (IdentityGuess(2, 1, 0.61, other=1),)),
            "person 2 in shot 1 may be person 1 (probability 0.61 that it is not): if so, `humanmm correct RUN "
            "same-person 1 2`",
        ),
        (
            0.05,
            Guesses(0.02, 300, (IdentityGuess(1, 2, 0.61, other=0),)),
            "if so, `humanmm correct RUN swap 0 1 --from 40 --to 60`",
        ),
    ],
)
def test_what_is_doubtful_is_a_warning(uncertainty: float, guesses: Guesses, message: str) -> None:
    (warning,) = _doubts(_intrinsics(uncertainty), guesses, (), SHOTS)
    assert message in warning


def test_a_focal_length_that_feet_and_paths_contradict_is_uncertain() -> None:
    motion = replace(align(results()), focal_dispute=0.34)
    assert _disputed(_intrinsics(0.1), None).relative_uncertainty == 0.1
    assert list(_doubts(_disputed(_intrinsics(0.1), replace(motion, focal_dispute=0.0)), SURE, (), SHOTS)) == []
    (warning,) = _doubts(_disputed(_intrinsics(0.1), motion), SURE, (), SHOTS)
    assert "the focal length is uncertain by 34 %" in warning


def test_a_correction_takes_its_warning_away_if_it_fits() -> None:
    doubtful = Guesses(math.nan, 3, (IdentityGuess(1, 2, 0.55),))
    assert len(list(_doubts(_intrinsics(0.05), doubtful, (), SHOTS))) == 2
    assert list(_doubts(_intrinsics(0.05), doubtful, [_correction("floor"), _correction("swap")], SHOTS)) == []
    assert len(list(_doubts(_intrinsics(0.05), doubtful, [_correction("floor", applied=False)], SHOTS))) == 2
    assert _floor(doubtful, [_correction("floor")])["source"] == "given"
    assert _floor(doubtful, ())["source"] == "assumed"


def test_a_height_that_hardly_any_adult_has_is_a_warning_unless_it_was_given() -> None:
    people = [
        {"person": 0, "height_m": 1.207, "height_uncertainty_m": 0.097},
        {"person": 1, "height_m": 1.75, "height_uncertainty_m": 0.14},
        {"person": 2, "height_m": 1.1, "height_uncertainty_m": 0.0},
        {"person": 3, "height_m": 2.2, "height_uncertainty_m": 0.176},
        {"person": 4},
    ]
    small, tall = _unlikely_heights(people)
    assert "person 0 is taken to be 1.21 m tall" in small and "humanmm correct RUN height 0 METRES" in small
    assert "person 3 is taken to be 2.20 m tall" in tall


def test_one_known_height_tells_the_scale() -> None:
    bones = {"height_m": 1.75, "height_uncertainty_m": 0.14}
    assert _scale([bones]) == {"source": "bones", "relative_uncertainty": 0.08}
    assert _scale([bones, {**bones, "height_uncertainty_m": 0.0}]) == {"source": "given", "relative_uncertainty": 0.0}
    assert _scale([{"person": 0}])["source"] == "assumed"


def test_a_given_height_is_that_of_the_person_it_was_given_for_alone() -> None:
    whole = results()
    (only,) = whole.shots.people
    motion = align(whole)
    assert _people(whole.shots, motion, None)[0]["height_uncertainty_m"] > 0
    known = replace(whole.shots, people=(replace(only, height_known=True),))
    assert _people(known, motion, None)[0]["height_uncertainty_m"] == 0.0
    assert _people(known, motion, None)[0]["height_m"] == _people(whole.shots, motion, None)[0]["height_m"]


def test_every_shot_says_how_dark_its_scene_was_and_what_is_drawn_over_it() -> None:
    whole = results()
    F = len(whole.time_s)
    light = np.full(F, 200, np.uint8)
    light[: F // 3] = 60
    facts = VideoFacts(640, 360, whole.time_s, whole.time_s == 0, 0, "h264", "mp4", light=light)
    first, *others = whole.shots.shots
    shots = replace(whole.shots, shots=(replace(first, burned_in=((0.0, 0.0, 64.0, 36.5),)), *others))
    told = _shots(facts, shots, whole.cameras, None, ())
    assert [one["gain"] for one in told] == [3.0, 1.0, 1.0]
    assert [one["burned_in"] for one in told] == [[[0.0, 0.0, 64.0, 36.5]], [], []]
