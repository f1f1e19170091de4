"""`humanmm correct`: what it writes, what it says will be computed, and what `recover` then makes of it."""

import json
import tomllib
from pathlib import Path
from typing import Any

import pytest

FILE = "runs/film/corrections.toml"


@pytest.fixture
def finished(toy: Any) -> Any:
    """A toy with a run folder."""
    toy.run()
    assert toy.main("recover", "film.mp4")[0] == 0
    toy.executed()
    return toy


def _ok(toy: Any, *words: str) -> list[str]:
    status, out, message = toy.main(*words)
    assert status == 0, message
    return list(out.splitlines())


def test_a_correction_is_written_and_what_it_changes_is_said(finished: Any) -> None:
    lines = _ok(finished, "correct", "runs/film", "floor", "--lower", "0.4")
    assert lines[0] == "correction 1: the floor is 0.4 m below the one that is found"
    assert lines[1] == "will be computed: refine" and lines[2] == "then, as far as their inputs change: deliver"
    assert lines[3].startswith("kept: decode, scenes, people, ") and lines[-1] == FILE
    assert 'kind = "floor"\nmetres = -0.4\n' in (finished.folder / FILE).read_text()
    stale = json.loads(_ok_text(finished, "status", "runs/film", "--json"))
    assert not stale["up_to_date"]
    assert _ok(finished, "correct", "runs/film") == [
        "1  the floor is 0.4 m below the one that is found  [not computed yet]"
    ]


def _ok_text(toy: Any, *words: str) -> str:
    return "\n".join(_ok(toy, *words))


def test_recover_finds_the_corrections_of_its_folder_and_a_floor_adds_to_what_was_corrected(finished: Any) -> None:
    _ok(finished, "correct", "runs/film", "floor", "--lower", "0.4")
    finished.run(corrections={"correction": [{"kind": "floor", "metres": -0.4}]})
    assert finished.executed() == ["deliver", "refine"]
    status, _, message = finished.main("recover", "film.mp4", "-o", "runs/film")
    assert status == 0 and "1 correction of runs/film/corrections.toml" in message
    record = json.loads((finished.folder / "runs/film/run.json").read_text())
    assert [(one["text"], one["applied"]) for one in record["corrections"]] == [
        ("the floor is 0.4 m below the one that is found", True)
    ]
    assert _ok(finished, "correct", "runs/film") == ["1  the floor is 0.4 m below the one that is found  [applied]"]
    lines = _ok(finished, "correct", "runs/film", "floor", "--raise", "0.1")
    assert lines[:2] == [
        "taken out: the floor is 0.4 m below the one that is found",
        "correction 1: the floor is 0.3 m below the one that is found",
    ]


def test_a_correction_that_does_not_fit_is_reported_at_the_end_of_every_run(finished: Any) -> None:
    (finished.folder / FILE).write_text('[[correction]]\nkind = "remove-cut"\nframe = 31\n')
    finished.run(corrections={"correction": [{"kind": "remove-cut", "frame": 31}]})
    for _ in range(2):  # written from the store, then found unchanged
        status, _, message = finished.main("recover", "film.mp4")
        assert status == 0
        assert "warning: correction 1 does not fit (no cut at frame 31): no cut is found there; the nearest" in message
    assert "[does not fit: no cut is found there" in _ok_text(finished, "correct", "runs/film")
    assert "correction 1 does not fit" in _ok_text(finished, "status", "runs/film")


def test_a_correction_is_taken_out_by_undo_and_by_its_contrary(finished: Any) -> None:
    _ok(finished, "correct", "runs/film", "add-cut", "50")
    _ok(finished, "correct", "runs/film", "static-shot", "2")
    _ok(finished, "correct", "runs/film", "focal", "900")
    assert _ok(finished, "correct", "runs/film", "focal", "950")[0] == "taken out: the focal length is 900 px"
    assert _ok(finished, "correct", "runs/film", "undo")[0] == "taken out: the focal length is 950 px"
    assert (
        _ok(finished, "correct", "runs/film", "undo", "2")[0]
        == "taken out: the camera is static in the shot of frame 50"
    )
    assert _ok_text(finished, "correct", "runs/film").startswith("1  a cut at frame 50")
    assert _ok(finished, "correct", "runs/film", "undo")[0] == "taken out: a cut at frame 50"
    _ok(finished, "correct", "runs/film", "remove-cut", "20")
    assert _ok(finished, "correct", "runs/film", "add-cut", "20")[0] == "taken out: no cut at frame 20"
    status, out, message = finished.main("correct", "runs/film")
    assert (status, out) == (0, "") and "has no corrections" in message
    assert finished.main("correct", "runs/film", "undo")[0] == 1


WRONG = (
    (["runs/film", "remove-cut", "33"], 1, "the run has no cut at frame 33; its cuts are at 20, 40"),
    (["runs/film", "add-cut", "60"], 1, "the video has no frame 60; it has 0 to 59"),
    (["runs/film", "static-shot", "3"], 1, "the run has no shot 3; it has 3, numbered from 0"),
    (["runs/film", "same-person", "0", "4"], 1, "person 0 was nowhere seen"),
    (["runs/film", "nobody", "4"], 1, "the run has no person 4; it has 0"),
    (["runs/film", "swap", "0", "1", "--from", "9", "--to", "9"], 1, "frames 9 to 9 are none"),
    (["runs/film", "main", "4", "4"], 2, "give --time S or --frame FRAME, one of them"),
    (["runs/film", "main", "4", "4", "--time", "99"], 1, "99 s is outside"),
    (["runs/film", "floor"], 2, "give --raise M or --lower M, one of them"),
    (["runs/film", "flor", "--raise", "1"], 2, "Did you mean 'floor'?"),
    (["runs/film", "exclude", "9"], 2, "Missing argument 'TO'"),
    (["runs/film", "floor", "--lower", "500"], 1, "floor: metres must be at least -10 and at most 10, not -500"),
    (["runs/film", "floor", "--raise", "nan"], 1, "floor: metres must be at least -10 and at most 10, not nan"),
    (["runs/film", "focal", "0"], 1, "focal: px must be more than 0 and at most 1,000,000, not 0"),
    (["runs/film", "focal", "inf"], 1, "focal: px must be more than 0 and at most 1,000,000, not inf"),
    (["nowhere"], 1, "nowhere is no run folder"),
    ([], 2, "Missing argument 'RUN_DIR'"),
)


def test_what_the_run_does_not_have_is_reported_in_one_line_and_nothing_is_written(finished: Any) -> None:
    for words, status, message in WRONG:
        answer = finished.main("correct", *words)
        (line,) = answer[2].splitlines()
        assert (answer[0], answer[1]) == (status, "") and message in line, answer
    assert not (finished.folder / FILE).exists()


def test_a_run_whose_video_was_replaced_is_not_corrected(finished: Any) -> None:
    _ok(finished, "correct", "runs/film", "floor", "--lower", "0.4")
    before = (finished.folder / FILE).read_text()
    finished.video.write_bytes(finished.video.read_bytes() + b" ")
    for words in (["add-cut", "50"], ["undo"]):
        status, out, message = finished.main("correct", "runs/film", *words)
        assert (status, out) == (1, "") and "film.mp4 is not the video of this run any more" in message
    assert (finished.folder / FILE).read_text() == before


def test_a_mistake_in_the_file_ends_recover_with_a_sentence_and_none_leaves_it_aside(finished: Any) -> None:
    Path(finished.folder / FILE).write_text('[[correction]]\nkind = "flor"\nmetres = 1.0\n')
    status, _, message = finished.main("recover", "film.mp4")
    assert status == 1 and message == (f"humanmm: {FILE}, correction 1: kind 'flor' is unknown; did you mean floor?\n")
    assert finished.main("recover", "film.mp4", "--corrections", "none")[0] == 0
    (finished.folder / "mine.toml").write_text('[[correction]]\nkind = "floor"\nmetres = 1.0\n')
    out = _ok(finished, "recover", "film.mp4", "--corrections", "mine.toml", "--dry-run")
    assert any(line.startswith("refine") and "will run: setting changed: corrections.1" in line for line in out)
    assert "there is no file gone.toml; " in finished.main("recover", "film.mp4", "--corrections", "gone.toml")[2]


def test_corrections_that_a_run_was_given_from_elsewhere_stay_when_another_one_is_written(toy: Any) -> None:
    mine = toy.folder / "mine.toml"
    mine.write_text('[[correction]]\nkind = "focal"\npx = 900.0\n\n[[correction]]\nkind = "remove-cut"\nframe = 3\n')
    toy.run(corrections={"origin": "mine.toml", **tomllib.loads(mine.read_text())})
    assert toy.main("recover", "film.mp4", "--corrections", "mine.toml")[0] == 0
    listed = _ok(toy, "correct", "runs/film")
    assert [line.split("  ")[1] for line in listed] == ["the focal length is 900 px", "no cut at frame 3"]
    status, out, message = toy.main("correct", "runs/film", "floor", "--lower", "0.4")
    assert status == 0 and out.startswith("correction 3: the floor is 0.4 m below"), message
    assert "2 corrections of mine.toml written into runs/film/corrections.toml, which counts" in message
    assert [line[:3] for line in _ok(toy, "correct", "runs/film")] == ["1  ", "2  ", "3  "]
    assert "will be computed: refine" in out, "nothing that the others concern"
    (toy.folder / FILE).unlink()
    assert toy.main("correct", "runs/film", "undo", "1")[0] == 0
    assert [line.split("  ")[1] for line in _ok(toy, "correct", "runs/film")] == ["no cut at frame 3"]
