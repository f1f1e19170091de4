"""How far a batch is, in words."""

import json
from dataclasses import replace
from pathlib import Path

from humanmm.storage.batches.video_row import VideoRow
from humanmm.tasks.batches.status import status_lines, video_lines


def _row(number: int, state: str, **more: object) -> VideoRow:
    return VideoRow("night", f"/v/{number}.mp4", number, f"/r/{number}", "{}", "normal", "[]", "", "", 1, state, **more)  # type: ignore[arg-type]


def test_the_speed_is_that_of_the_videos_that_ended_and_stages_come_in_their_order() -> None:
    rows = [
        _row(0, "done", seconds=20.0), _row(1, "done", seconds=40.0), _row(2, "running", stage="hmr · shot 1"),
        _row(3, "running", stage="people · scene 0"), _row(4, "scheduled"),
        _row(5, "failed", stage="decode", reason="it is empty", changed=1.0), _row(6, "failed", changed=2.0),
    ]  # fmt: skip
    assert list(status_lines("night", rows)) == [
        "batch night: 7 videos, 1 scheduled, 2 running, 2 done, 2 failed",
        "  30.0 s a video, 240 videos an hour, about 1 min left",
        "  running: 1 in people, 1 in hmr",
        "  failed: 1 in decode, 1 in no stage",
        "  failed: /v/6.mp4 (no stage): ",
        "  failed: /v/5.mp4 (decode): it is empty",
    ]


def test_of_many_failures_the_newest_ten_are_named() -> None:
    lines = list(status_lines("night", [_row(k, "failed", changed=float(k)) for k in range(12)]))
    assert "/v/11.mp4" in lines[2] and lines[-1] == "  and 2 more" and len(lines) == 13
    assert list(status_lines("empty", [])) == ["batch empty: nothing submitted yet"]


def test_who_is_done_with_warnings_is_counted_and_each_video_has_a_line(tmp_path: Path) -> None:
    for number, warnings in ((0, ["it is dark"]), (1, []), (2, ["it is dark", "it shakes"])):
        record = {"schema": "humanmm.run/1", "state": "done", "people": [{}], "shots": [{}, {}], "warnings": warnings}
        (tmp_path / str(number)).mkdir()
        (tmp_path / str(number) / "run.json").write_text(json.dumps(record))
    rows = [replace(_row(number, "done"), run_dir=str(tmp_path / str(number))) for number in range(4)]
    rows.append(_row(4, "failed", stage="people", reason="nobody is in it"))
    assert next(status_lines("night", rows)) == "batch night: 5 videos, 4 done (2 with warnings), 1 failed"
    assert list(video_lines(rows)) == [
        "/v/0.mp4  done: 1 person, 2 shots, 1 warning",
        "/v/1.mp4  done: 1 person, 2 shots, nothing doubtful",
        "/v/2.mp4  done: 1 person, 2 shots, 2 warnings",
        "/v/3.mp4  done",
        "/v/4.mp4  failed: people: nobody is in it",
    ]
