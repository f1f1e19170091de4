"""A finished run in five lines."""

from pathlib import Path
from typing import Any

from humanmm.models.records import shots
from humanmm.storage.run_folder import summary
from humanmm.storage.run_folder.summary import certainty, five_lines, one_line

RECORD: dict[str, Any] = {
    "state": "partial",
    "video": {"num_frames": 100},
    "focal": {"px": 1106.6, "source": "estimated", "relative_uncertainty": 0.02},
    "scale": {"source": "bones", "relative_uncertainty": 0.08},
    "floor": {"source": "feet", "uncertainty_m": 0.021, "standing_soles": 300},
    "shots": [
        {"start": 0, "end": 60, "linked": True, "failed": False, "join": None},
        {"start": 60, "end": 80, "linked": True, "failed": False, "join": {"uncertainty_deg": 1.5}},
        {"start": 80, "end": 100, "linked": False, "failed": True, "join": {"uncertainty_deg": 180.0}},
    ],
    "people": [
        {"person": 0, "probability": 0.99, "start": 0, "end": 100, "observed_frames": 90,
         "identity": [{"shot": 1, "probability": 0.96}]},
        {"person": 1, "probability": 0.4, "start": 60, "end": 100, "observed_frames": 20,
         "identity": [{"shot": 2, "probability": 0.71}]},
    ],
    "warnings": ["camera, shot 1: dark", "align: far"],
    "stages": [
        {"stage": "hmr", "unit": "shot 2", "state": "failed", "reason": "no legs"},
        {"stage": "refine", "unit": "video", "state": "skipped", "reason": "hmr"},
    ],
}  # fmt: skip


def test_five_lines_tell_who_where_how_sure_what_to_look_at_and_where_it_is() -> None:
    people, shots_line, sure, look, result = five_lines(RECORD, Path("runs/film"))
    assert people == (
        "people   2: person 0 seen in 90 of 100 frames, person 1 seen in 20 of 40 frames, doubtful (40 %)"
    )
    assert "3: shot 0 frames 0 to 59, shot 1 frames 60 to 79, shot 2 frames 80 to 99, a world of its own, failed" in (
        shots_line
    )
    assert sure == (
        "sure     focal 1107 px ± 2 % (estimated); scale ± 8 % (of bones); floor ± 2 cm (of feet); "
        "cameras at cuts ± 2° at worst; who is who 71 % at least"
    )
    assert look == "look at  hmr, shot 2 failed: no legs (and 2 more in run.json)"
    assert "humanmm view runs/film" in result


def test_many_people_and_shots_stay_one_line() -> None:
    many = {**RECORD, "people": RECORD["people"] * 20, "shots": RECORD["shots"] * 40}
    people, shots_line, *_ = five_lines(many, Path("runs/film"))
    assert "and 36 more" in people and "and 116 more" in shots_line
    assert max(map(len, (people, shots_line))) < 250


def test_nothing_doubtful_is_said_where_there_is_no_warning() -> None:
    calm = {**RECORD, "state": "done", "warnings": [], "stages": []}
    assert five_lines(calm, Path("r"))[3] == "look at  nothing is doubtful"
    assert one_line(calm) == "done: 2 people, 3 shots, nothing doubtful"
    assert one_line(RECORD) == "partial: 2 people, 3 shots, 2 warnings"


def test_a_run_of_an_earlier_version_lacks_what_was_not_measured_then() -> None:
    old = {**RECORD, "people": [{"person": 0, "probability": 1.0}]}
    for name in ("scale", "floor", "focal"):
        del old[name]
    assert certainty(old) == ["cameras at cuts ± 2° at worst"]


def test_who_is_doubtful_is_the_same_everywhere() -> None:
    assert summary.DOUBTFUL == shots.DOUBTFUL
