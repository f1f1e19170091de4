"""What the dashboard shows of a video and of a batch."""

import base64
import re
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from humanmm.storage.batches.video_row import VideoRow
from humanmm.storage.pages.video_page import SHOWN_ROWS, batch_table, failure_page, video_page

RECORD: dict[str, Any] = {
    "state": "partial",
    "seconds": 12.25,
    "video": {"path": "/films/a <b>*.mp4", "fps": 25.0, "num_frames": 100, "width": 640, "height": 360},
    "shots": [
        {"start": 0, "end": 60, "transition": None, "linked": True, "people": [0], "failed": False},
        {"start": 60, "end": 100, "transition": {"type": "cut"}, "linked": False, "people": [], "failed": True},
    ],
    "people": [{"person": 0, "shots": [0], "start": 0, "end": 60, "observed_frames": 55}],
    "failures": [{"stage": "camera", "unit": "shot 1", "shot": 1, "reason": "no | points"}],
    "fallbacks": ["shot 1: how the camera moves is not known, and a guess is given (`cameras/source` 4, fallback)"],
    "warnings": [f"hmr: warning {number}" for number in range(30)],
    "stages": [
        {"stage": "camera", "unit": "shot 0", "state": "computed", "reason": "", "seconds": 1.5},
        {"stage": "camera", "unit": "shot 1", "state": "failed", "reason": "no | points", "seconds": 0.25},
        {"stage": "hmr", "unit": "shot 1", "state": "skipped", "reason": "camera failed", "seconds": 0.0},
    ],
}


def test_a_page_tells_failures_shots_stages_and_the_first_warnings(tmp_path: Path) -> None:
    page = video_page(RECORD, tmp_path)
    assert "Run folder: `" in page
    assert page.startswith("# a \\<b\\>\\*.mp4: partial\n")
    assert "- **camera, shot 1**: no \\| points" in page
    assert "- 1 more were skipped because of that" in page
    assert "| 1 | 60 to 99 | cut | nobody | no | failed |" in page
    assert "person 0 is observed in 55 of 60 frames" in page
    assert "| camera | 2 | 1 | 0 | 1 | 0 | 1.8 |" in page
    assert "| hmr | 1 | 0 | 0 | 0 | 1 | 0.0 |" in page
    assert "- hmr: warning 18\n" in page and "warning 19\n" in page and "warning 20" not in page
    assert "and 10 more in run.json" in page


def test_a_video_that_failed_has_a_page_that_says_why_how_far_it_came_and_what_to_do(tmp_path: Path) -> None:
    page = failure_page(Path("/films/dark.mp4"), "no usable person", RECORD["stages"], tmp_path / "dark")
    assert page.startswith("# dark.mp4: failed\n") and "**no usable person**" in page
    assert "- **camera, shot 1**: no \\| points" in page and "| hmr | 1 | 0 | 0 | 0 | 1 | 0.0 |" in page
    assert "humanmm batch retry-failed" in page and "data:image" not in page
    cv2.imwrite(str(tmp_path / "dark.seen.png"), np.zeros((90, 160, 3), np.uint8))
    assert "![who was seen](data:image" in failure_page(Path("/films/dark.mp4"), "no", [], tmp_path / "dark")


def test_its_pictures_are_small_and_whole(tmp_path: Path) -> None:
    (tmp_path / "view").mkdir()
    noise = np.random.default_rng(0).integers(0, 255, (900, 1600, 3), np.uint8)
    cv2.imwrite(str(tmp_path / "view/top.png"), cv2.GaussianBlur(noise, (0, 0), 8))
    page = video_page(RECORD, tmp_path)
    ((title, data),) = re.findall(r"!\[(.*?)\]\(data:image/jpeg;base64,(.*?)\)", page)
    picture = cv2.imdecode(np.frombuffer(base64.b64decode(data), np.uint8), cv2.IMREAD_COLOR)
    assert title == "top view" and picture is not None and picture.shape[:2] == (270, 480)
    assert len(page) < 100_000


def test_a_table_has_what_needs_somebody_first_and_is_bounded() -> None:
    row = VideoRow("b", "/films/0.mp4", 0, "/runs/0", "{}", "normal", "[]", "", "", state="done", seconds=1.26)
    many = [replace(row, video=f"/films/{number}.mp4", changed=float(number)) for number in range(SHOWN_ROWS + 9)]
    failed = replace(row, video="/films/bad.mp4", state="failed", reason="no people", stage="people · scene 0")
    table = batch_table([*many, failed])
    assert len(table) == SHOWN_ROWS
    assert (table[0]["video"], table[0]["reason"]) == ("bad.mp4", "no people")
    assert table[1]["video"] == f"{SHOWN_ROWS + 8}.mp4" and table[1]["seconds"] == 1.3


def test_nothing_that_a_user_named_marks_anything_up(tmp_path: Path) -> None:
    evil = "<img src=x onerror=alert(1)> [x](http://evil.example) `"
    failure = {"stage": "camera", "unit": evil, "shot": 1, "state": "failed", "reason": evil, "seconds": 1.0}
    video = {**RECORD["video"], "path": f"/films/{evil.replace('/', '')}.mp4"}
    page = video_page({**RECORD, "video": video, "stages": [failure], "warnings": [evil]}, tmp_path / "a`b<i>")
    page += failure_page(Path(video["path"]), evil, [failure, {**failure, "reason": f"2 {evil}"}], tmp_path / "a`b<i>")
    outside_code = re.sub(r"(`+) .*? \1", "", page)
    assert not re.search(r"(?<!\\)<", outside_code)
    assert not re.search(r"(?<!\\)\]\(http", outside_code)
