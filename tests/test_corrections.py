"""What a file of corrections may say, and how a mistake in it is told."""

import pytest

from humanmm.corrections import NAMES, AddCut, Corrections, Floor, make, read_corrections
from humanmm.errors import ConfigError

WHO = {"frame": 5, "x": 100.0, "y": 50.0}
ONE_OF_EACH = (
    {"kind": "add-cut", "frame": 120},
    {"kind": "remove-cut", "frame": 84},
    {"kind": "same-person", "who": WHO, "other": {**WHO, "x": 300.0}},
    {"kind": "nobody", "who": WHO},
    {"kind": "swap", "who": WHO, "other": {**WHO, "x": 300.0}, "start": 80, "end": 120},
    {"kind": "sides", "who": WHO, "start": 0, "end": 9, "joint": "hip", "left": [1.0, 2.0], "right": [3.0, 4.0]},
    {"kind": "static-shot", "frame": 50},
    {"kind": "focal", "px": 1100.0},
    {"kind": "height", "who": WHO, "metres": 1.82},
    {"kind": "floor", "metres": -0.4},
    {"kind": "exclude", "start": 40, "end": 52},
    {"kind": "main", "who": WHO},
)


def test_every_kind_can_be_read_and_says_what_it_means() -> None:
    found = read_corrections({"correction": list(ONE_OF_EACH)}, origin="corrections.toml")
    assert tuple(one.kind for one in found.correction) == NAMES
    assert all(str(one) and one.facts["kind"] == one.kind for one in found.correction)
    assert Corrections.model_validate_json(found.model_dump_json()) == found


@pytest.mark.parametrize(
    ("entries", "message"),
    [
        ([{"kind": "focal", "px": 9}, {"kind": "add_cut", "frame": 3}], "correction 2: kind 'add_cut' is unknown; did"),
        ([{"frame": 3}], "correction 1: it has no kind; kinds are add-cut, "),
        ([{"kind": "add-cut"}], "correction 1 (add-cut): frame is missing; add it"),
        ([{"kind": "add-cut", "frame": 3, "fps": 2}], "(add-cut): unknown key fps; keys are kind, frame, end"),
        ([{"kind": "height", "who": WHO, "metres": 182}], "(height): metres: input should be less than or"),
        ([{"kind": "nobody", "who": {"frame": 5, "z": 1, "x": 1, "y": 2}}], "unknown key who.z; keys are frame, x"),
        ([{"kind": "exclude", "start": 52, "end": 40}], "end = 40 is not after start = 52; end is the first frame"),
        ([{"kind": "focal", "px": 9}, {"kind": "focal", "px": 8}], "there are 2 corrections of kind focal; keep one"),
        ([{"kind": "sides", "who": WHO, "start": 0, "end": 9, "joint": "hip"}], "joint, left and right go together"),
        ([{"kind": "main", "who": {**WHO, "x": float("nan")}}], "(main): who.x: input should be a finite number"),
        ([{"kind": "add-cut", "frame": "soon"}], "(add-cut): frame: input should be a valid integer"),
    ],
)  # fmt: skip
def test_a_mistake_is_reported_in_one_sentence_that_names_the_file_and_the_correction(
    entries: list[dict[str, object]], message: str
) -> None:
    with pytest.raises(ConfigError) as caught:
        read_corrections({"correction": entries}, origin="runs/film/corrections.toml")
    assert str(caught.value).startswith("runs/film/corrections.toml") and message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_setting_among_the_corrections_is_refused() -> None:
    with pytest.raises(ConfigError, match=r"unknown key 'focal_px'; corrections stand in tables \[\[correction\]\]"):
        read_corrections({"focal_px": 900})


def test_a_number_that_only_people_read_is_no_part_of_the_facts() -> None:
    one, other = (
        read_corrections({"correction": [{"kind": "nobody", "who": {**WHO, "number": number}}]}).correction[0]
        for number in (2, 3)
    )
    assert one != other and one.identity == other.identity


def test_a_stage_gets_its_kinds_alone_and_a_shot_its_own() -> None:
    found = read_corrections({"correction": list(ONE_OF_EACH)})
    assert [one.kind for one in found.chosen(("focal", "floor")).correction] == ["focal", "floor"]
    assert (
        found.chosen(("static-shot",), (40, 60)).correction and not found.chosen(("static-shot",), (60, 90)).correction
    )


def test_corrections_are_left_aside_as_a_whole_for_another_video() -> None:
    found = read_corrections({"video": "ab12", "correction": [{"kind": "floor", "metres": 1.0}]})
    assert found.for_video("ab12") is found and found.for_video(None) is found
    other = found.for_video("cd34")
    assert other.correction == () and other.left_aside == found.correction and other.facts == {}
    assert read_corrections({"correction": []}).for_video("cd34").left_aside == ()


def test_a_value_beyond_its_limits_is_one_sentence_with_them() -> None:
    assert make(Floor, metres=1.0) == Floor(metres=1.0)
    with pytest.raises(ConfigError, match=r"^floor: metres must be at least -10 and at most 10, not 500$"):
        make(Floor, metres=500.0)
    with pytest.raises(ConfigError, match=r"^add-cut: end = 3 is not after frame = 9; leave it out for a hard cut$"):
        make(AddCut, frame=9, end=3)
