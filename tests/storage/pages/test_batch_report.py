"""The report of a batch: safe for the browser and the spreadsheet, whatever videos and messages are called."""

import csv
import io
from pathlib import Path

from humanmm.storage.batches.video_row import VideoRow
from humanmm.storage.pages.batch_report import COLUMNS, write_report

ROW = VideoRow("b", "/films/0.mp4", 0, "/runs/0", "{}", "normal", "[]", "", "", state="done", seconds=1.26)


def _row(name: str, state: str, reason: str = "") -> VideoRow:
    return VideoRow("b", f"/films/{name}", 0, f"/runs/{name}", "{}", "normal", "[]", "", "", state=state, reason=reason)


def test_names_and_reasons_are_text_in_html_and_in_csv(tmp_path: Path) -> None:
    evil = "=cmd()<script>'\""
    page, table = write_report(tmp_path, "<b>", [_row(evil, "failed", evil), _row("a#?%.mp4", "done")])
    text = page.read_text()
    assert "<script>" not in text and "<b>" not in text
    assert text.count("=cmd()&lt;script&gt;&#39;&#34;") == 3, "path, name and reason"
    head, first, second = csv.reader(io.StringIO(table.read_text()))
    assert tuple(head) == COLUMNS
    assert first[3] == f"'{evil}"
    assert second[8] == "1", "the run folder cannot be read"


def test_links_are_relative_and_quoted_and_only_of_finished_videos(tmp_path: Path) -> None:
    page, _ = write_report(tmp_path / "runs" / "report", "b", [_row("a#?.mp4", "done"), _row("c.mp4", "running")])
    text = page.read_text()
    assert text.count("<a href") == 1
    assert "a%23%3F.mp4" in text


def test_a_name_that_is_no_unicode_is_written_as_escapes(tmp_path: Path) -> None:
    page, table = write_report(tmp_path, "b", [_row("caf\udce9.mp4", "done")])
    assert "caf\\udce9.mp4" in page.read_text(encoding="utf-8")
    assert "caf%E9.mp4" in page.read_text(encoding="utf-8"), "the link has the bytes of the name"
    assert "caf\\udce9.mp4" in table.read_text(encoding="utf-8")
