"""Numbers of people become places in pictures."""

import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from two_people import CUT, recording

from humanmm.correcting import Corrector, contrary, pending_of
from humanmm.corrections import AddCut, Correction, Exclude, Floor, RemoveCut, Sides, Swap, Who
from humanmm.errors import ConfigError, InputError
from humanmm.models.records.landmarks import INDEX
from humanmm.models.records.recording import Recording
from humanmm.storage.run_folder.corrections_file import FILE, begin, remove
from humanmm.storage.run_folder.run_record import SCHEMA

SHOTS = [
    {"start": 0, "end": CUT, "transition": None},
    {"start": CUT, "end": 40, "transition": {"type": "cut", "start": CUT, "end": CUT}},
]


def boxed(before: np.ndarray, *, seen: slice) -> Recording:
    """Person 0 stands at x = 200 all the time; person 1 passes him at frame 15 on his way from 600 to 100."""
    two = recording()
    people = []
    for person, centre in zip(
        two.people, (np.full(40, 200.0), np.interp(np.arange(5, 35), [5, 15, 34], before)), strict=True
    ):
        keypoints = np.zeros_like(person.keypoints2d)
        keypoints[seen, :, 2] = 0.9
        keypoints[:, INDEX["left_ankle"], 0], keypoints[:, INDEX["right_ankle"], 0] = centre + 15, centre - 15
        box = np.stack([centre - 50, np.full_like(centre, 100), centre + 50, np.full_like(centre, 300)], axis=1)
        people.append(replace(person, bbox=box.astype(np.float32), keypoints2d=keypoints))
    return replace(two, people=tuple(people))


@pytest.fixture
def corrector() -> Corrector:
    return Corrector(boxed(np.array([600.0, 200.0, 100.0]), seen=slice(None)), {"shots": SHOTS, "config": {}})


def test_a_person_is_named_by_a_place_where_he_is_seen_away_from_all_others(corrector: Corrector) -> None:
    for number in (0, 1):
        who = corrector.place(number)
        person = corrector.recording.people[number]
        row = who.frame - int(person.frame[0])
        assert who.number == number and person.observed[row]
        assert who.x == pytest.approx(person.bbox[row, [0, 2]].mean(), abs=0.1)
        other = corrector.recording.people[1 - number]
        apart = (
            abs(who.x - float(other.bbox[who.frame - int(other.frame[0]), [0, 2]].mean())) if who.frame >= 5 else 400.0
        )
        assert apart > 150


def test_it_is_not_chosen_where_people_changed_places_by_hand(corrector: Corrector) -> None:
    who = corrector.place(1)
    swap = {"kind": "swap", "start": who.frame - 3, "end": who.frame + 3}
    record = {"shots": SHOTS, "config": {"corrections": {"correction": [swap]}}}
    assert not who.frame - 3 <= Corrector(corrector.recording, record).place(1).frame < who.frame + 3


def test_nor_where_a_correction_that_is_not_computed_yet_makes_somebody_else_of_whoever_is_there(
    corrector: Corrector,
) -> None:
    plain = corrector.place(1)
    span = {"start": plain.frame - 3, "end": plain.frame + 3}
    swap = Swap(who=corrector.place(0), other=plain, **span)
    for one in (swap, Exclude(who=plain, **span), Exclude(**span)):
        assert not one.start <= replace(corrector, pending=(one,)).place(1).frame < one.end
    assert replace(corrector, pending=(Exclude(who=corrector.place(0), **span),)).place(1) == plain, "not about him"
    with pytest.raises(InputError, match=r"person 1 is seen in no frame outside the swaps .* compute them first"):
        replace(corrector, pending=(swap.model_copy(update={"start": 0, "end": 40}),)).place(1)


def test_corrections_are_pending_from_when_they_are_written_or_taken_out_until_the_run_is_computed_with_them(
    tmp_path: Path,
) -> None:
    floor, cut = Floor(metres=0.1), AddCut(frame=9)

    def computed_with(*given: Correction) -> None:
        entries = [one.model_dump(mode="json") for one in given]
        corrections = {"of_run_folder": True, "correction": entries}
        record = {"schema": SCHEMA, "config": {"corrections": corrections}}
        (tmp_path / "run.json").write_text(json.dumps(record))

    computed_with()
    begin(tmp_path / FILE, [floor, cut], video="0")
    assert pending_of(tmp_path) == (floor, cut)
    computed_with(floor, cut)
    assert pending_of(tmp_path) == ()
    remove(tmp_path / FILE, 1)
    assert pending_of(tmp_path) == (floor,)


def test_wrong_sides_are_reported_in_each_shot_by_where_the_farthest_joint_truly_is(
    corrector: Corrector,
) -> None:
    first, second = corrector.sides(0, 10, 40)
    assert (first.start, first.end, second.start, second.end) == (10, CUT, CUT, 40)
    assert first.joint == "ankle" and first.start <= first.who.frame < first.end
    assert first.left is not None and first.right is not None
    assert (first.left[0], first.right[0]) == (185.0, 215.0), "what was called right is left"


def test_who_was_not_seen_in_a_span_cannot_be_corrected_there() -> None:
    corrector = Corrector(boxed(np.array([600.0, 200.0, 100.0]), seen=slice(0, 9)), {"shots": SHOTS, "config": {}})
    with pytest.raises(InputError, match="person 1 is not seen in frames 20 to 24"):
        corrector.sides(1, 20, 25)


def test_the_main_person_gets_the_number_of_whoever_is_there(corrector: Corrector) -> None:
    frame = corrector.frame_at(float(corrector.recording.time_s[7]) + 0.01)
    assert frame == 7
    assert corrector.main(200.0, 150.0, frame).who == Who(frame=7, x=200.0, y=150.0, number=0)
    assert corrector.main(900.0, 150.0, frame).who.number is None
    with pytest.raises(InputError, match="not in the picture"):
        corrector.main(2000.0, 150.0, frame)


def test_times_count_from_the_first_frame_as_on_the_page(corrector: Corrector) -> None:
    late = replace(corrector.recording, time_s=corrector.recording.time_s + 1.4)
    times = corrector.recording.time_s
    assert Corrector(late, corrector.record).frame_at(float(times[7])) == 7
    with pytest.raises(InputError, match=f"lasts from 0.00 to {times[-1]:.2f} s"):
        Corrector(late, corrector.record).frame_at(float(times[-1]) + 1.2)


def test_a_suspected_cut_is_removed_as_its_warning_says(corrector: Corrector) -> None:
    record = {**corrector.record, "suspected_cuts": [14]}
    assert Corrector(corrector.recording, record).remove_cut(14).frame == 14
    with pytest.raises(InputError, match="the run has no cut at frame 14"):
        corrector.remove_cut(14)


def test_a_floor_is_relative_to_the_world_that_was_delivered(corrector: Corrector) -> None:
    before: dict[str, Any] = {"corrections": {"correction": [{"kind": "floor", "metres": -0.5}]}}
    assert Corrector(corrector.recording, {"shots": SHOTS, "config": before}).floor(0.2) == Floor(metres=-0.3)


def test_a_height_is_written_down_and_the_one_before_is_known(corrector: Corrector) -> None:
    assert corrector.height(1, 1.8).metres == 1.8 and 1.4 < corrector.height_of(1) < 2.1


def test_adding_and_removing_a_cut_are_contraries() -> None:
    sides = Sides(who=Who(frame=1, x=1, y=1), start=0, end=5)
    assert contrary(AddCut(frame=9), [sides, RemoveCut(frame=8), RemoveCut(frame=9)]) == 3
    assert contrary(RemoveCut(frame=8), [sides, RemoveCut(frame=8)]) is None and contrary(sides, [sides]) is None


@pytest.mark.parametrize("metres", [18.0, 0.1, float("nan")])
def test_a_height_beyond_the_limits_is_refused_with_them(corrector: Corrector, metres: float) -> None:
    with pytest.raises(ConfigError, match=rf"height: metres must be at least 0.5 and at most 2.6, not {metres:g}"):
        corrector.height(0, metres)


def test_a_focal_length_that_no_lens_has_is_refused_with_the_limits(corrector: Corrector) -> None:
    width = corrector.recording.width
    assert corrector.focal(float(width)).px == width
    for px in (0.004 * width, 60.0 * width):
        with pytest.raises(InputError, match=rf"focal: px must be between .* a picture {width} pixels wide"):
            corrector.focal(px)
    with pytest.raises(ConfigError, match="must be more than 0 and at most 1,000,000, not -3"):
        corrector.focal(-3.0)
