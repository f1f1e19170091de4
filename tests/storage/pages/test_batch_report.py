"""The report of a batch: safe for the browser and the spreadsheet, whatever videos and messages are called."""

import csv
import io
import json
from dataclasses import replace
from pathlib import Path

import av
import numpy as np
import pytest
from browser import Browser, find_browser

from humanmm.storage.batches.video_row import VideoRow
from humanmm.storage.pages.batch_report import COLUMNS, write_report

ROW = VideoRow("b", "/films/0.mp4", 0, "/runs/0", "{}", "normal", "[]", "", "", state="done", seconds=1.26)


def _row(name: str, state: str, reason: str = "") -> VideoRow:
    return VideoRow("b", f"/films/{name}", 0, f"/runs/{name}", "{}", "normal", "[]", "", "", state=state, reason=reason)


def test_names_and_reasons_are_text_in_html_and_in_csv(tmp_path: Path) -> None:
    evil = "=cmd()<script>'\""
    page, table = write_report(tmp_path, "<b>", [_row(evil, "failed", evil), _row("a#?%.mp4", "done")])
    text = page.read_text()
    assert text.count("<script>") == 1 and "<b>" not in text, "our own script alone"
    assert text.count("=cmd()&lt;script&gt;&#39;&#34;") == 3, "path, name and reason"
    head, first, second = csv.reader(io.StringIO(table.read_text()))
    assert tuple(head) == COLUMNS
    assert first[3] == f"'{evil}"
    assert second[8] == "1", "the run folder cannot be read"


def test_the_table_has_what_a_hand_off_asks_for(tmp_path: Path) -> None:
    run_dir = tmp_path / "run"
    (run_dir / "motion.zarr").mkdir(parents=True)
    pose = [{"person": 0, "error_mm": 52.5, "doubtful": [[10, 20]]}, {"person": 1, "error_mm": 61.25, "doubtful": []}]
    facing = [{"person": 0, "doubtful": [[15, 25]]}]
    record = {
        "schema": "humanmm.run/1",
        "video": {"num_frames": 60, "fps": 25.0},
        "people": [{"person": 0, "height_m": 1.75}, {"person": 1, "height_m": 1.62}, {"person": 2}],
        "shots": [
            {"join": None, "linked": True, "pose": pose, "facing": facing},
            {"join": {"probability": 0.97}, "linked": True, "pose": [], "facing": []},
            {"join": {"probability": 0.3}, "linked": False, "pose": [], "facing": []},
        ],
        "warnings": [],
    }
    (run_dir / "run.json").write_text(json.dumps(record))
    _, table = write_report(tmp_path / "report", "b", [replace(ROW, run_dir=str(run_dir)), _row("c.mp4", "failed")])
    first, second = csv.DictReader(io.StringIO(table.read_text()))
    assert [first[name] for name in COLUMNS[-6:]] == [
        "25.0", "0: 1.75; 1: 1.62", "61.25", "0.6", "0.97", str(run_dir / "motion.zarr")
    ]  # fmt: skip
    assert [second[name] for name in COLUMNS[-6:]] == [""] * 6


def test_links_are_relative_and_quoted_and_only_of_finished_videos(tmp_path: Path) -> None:
    page, _ = write_report(tmp_path / "runs" / "report", "b", [_row("a#?.mp4", "done"), _row("c.mp4", "running")])
    text = page.read_text()
    assert text.count("<a href") == 1
    assert "a%23%3F.mp4" in text


def test_a_video_in_which_nobody_was_found_links_the_picture_of_who_was_seen(tmp_path: Path) -> None:
    (tmp_path / "empty.seen.png").touch()
    rows = [replace(_row(name, "failed", "no usable person"), run_dir=str(tmp_path / name)) for name in ("empty", "c")]
    page, _ = write_report(tmp_path / "report", "b", rows)
    assert page.read_text().count("<a href") == 1
    assert 'href="../empty.seen.png"' in page.read_text()


def test_a_name_that_is_no_unicode_is_written_as_escapes(tmp_path: Path) -> None:
    page, table = write_report(tmp_path, "b", [_row("caf\udce9.mp4", "done")])
    assert "caf\\udce9.mp4" in page.read_text(encoding="utf-8")
    assert "caf%E9.mp4" in page.read_text(encoding="utf-8"), "the link has the bytes of the name"
    assert "caf\\udce9.mp4" in table.read_text(encoding="utf-8")


@pytest.mark.skipif(find_browser() is None, reason="no browser here")
def test_the_page_shows_pictures_and_warnings_filters_and_sorts(tmp_path: Path) -> None:
    rows = [
        _finished(tmp_path, "b.mp4", people=2, warnings=[]),
        _finished(tmp_path, "a.mp4", people=11, warnings=["dark"]),
    ]
    page, _ = write_report(tmp_path / "report", "b", [*rows, _row("c.mp4", "failed", "no usable person")])
    with Browser(tmp_path / "profile") as browser:
        browser.open(page)
        names = "[...document.querySelectorAll('tbody tr:not([hidden])')].map(row => row.cells[1].textContent.trim())"
        press = "document.querySelectorAll('th button')[{}].click()"
        assert browser.run(names) == ["b.mp4", "a.mp4", "c.mp4"]
        assert (
            browser.run("document.querySelector('img').decode().then(() => document.querySelector('img').naturalWidth)")
            == 160
        )
        assert browser.run("document.querySelector('details').textContent").endswith("dark")
        browser.run(press.format(0))
        assert browser.run(names) == ["a.mp4", "b.mp4", "c.mp4"]
        browser.run(press.format(6))
        assert browser.run(names) == ["b.mp4", "a.mp4", "c.mp4"], "as numbers; who has none is last"
        browser.run(press.format(6))
        assert browser.run(names) == ["a.mp4", "b.mp4", "c.mp4"]
        change = "document.querySelector('form').dispatchEvent(new Event('input'))"
        browser.run(f"document.querySelector('input[value=failed]').checked = false; {change}")
        assert browser.run(names) == ["a.mp4", "b.mp4"]
        browser.run(f"document.getElementById('words').value = 'DARK'; {change}")
        assert browser.run(names) == ["a.mp4"]
        browser.run(f"document.getElementById('words').value = ''; doubtful.checked = true; {change}")
        assert browser.run(names) == ["a.mp4"]
        assert browser.run("document.getElementById('shown').textContent") == "1 shown"
        assert browser.console == []


def _finished(folder: Path, name: str, *, people: int, warnings: list[str]) -> VideoRow:
    """A row whose run folder is there, with an overlay of ten frames."""
    run_dir = folder / "runs" / name
    (run_dir / "view").mkdir(parents=True)
    record = {
        "schema": "humanmm.run/1", "video": {"num_frames": 10}, "shots": [{}], "people": [{}] * people,
        "warnings": warnings,
    }  # fmt: skip
    (run_dir / "run.json").write_text(json.dumps(record))
    with av.open(str(run_dir / "view" / "overlay.mp4"), "w") as out:
        stream = out.add_stream("mpeg4", rate=10)
        stream.width, stream.height, stream.pix_fmt = 320, 180, "yuv420p"
        for level in range(10):
            frame = av.VideoFrame.from_ndarray(np.full((180, 320, 3), 20 * level, np.uint8), format="rgb24")
            out.mux(stream.encode(frame))
        out.mux(stream.encode(None))
    return replace(_row(name, "done"), run_dir=str(run_dir), seconds=12.0)
