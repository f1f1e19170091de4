"""What verbs print where nobody reads, where a name is no text, and where a machine has no screen."""

import io
import json
import os
import sys
import webbrowser
from pathlib import Path

import pytest

from humanmm.cli import terminal


def test_results_go_to_standard_output_and_remarks_to_standard_error(capsys: pytest.CaptureFixture[str]) -> None:
    terminal.write("one", 2)
    terminal.write_json({"a": [1.5]}, indent=None)
    terminal.say("many\n  words")
    captured = capsys.readouterr()
    assert captured.out == 'one\n2\n{"a": [1.5]}\n' and captured.err == "humanmm: many words\n"


def test_json_holds_no_number_that_json_does_not_have() -> None:
    with pytest.raises(ValueError, match="Out of range"):
        terminal.write_json({"a": float("nan")})


def test_a_path_is_written_byte_by_byte(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    stream = io.TextIOWrapper(io.BytesIO(), encoding="ascii")
    monkeypatch.setattr(sys, "stdout", stream)
    terminal.write_path(Path(os.fsdecode(b"caf\xe9")))
    assert stream.buffer.getvalue() == b"caf\xe9\n"  # type: ignore[attr-defined]


def test_a_pipe_that_nobody_reads_ends_no_command() -> None:
    reading, writing = os.pipe()
    os.close(reading)
    with os.fdopen(writing, "w") as stream:
        with terminal.even_unread(stream):
            stream.write("lost")
            stream.flush()
        stream.write("lost too")  # to /dev/null from now on
        stream.flush()
        with pytest.raises(OSError, match="another"), terminal.even_unread(stream):
            raise OSError(5000, "another fault")


def test_what_a_stream_cannot_encode_is_escaped(monkeypatch: pytest.MonkeyPatch) -> None:
    stream = io.TextIOWrapper(io.BytesIO(), encoding="ascii")
    monkeypatch.setattr(sys, "stderr", stream)
    terminal.accept_all_characters()
    terminal.say("1 × 2")
    assert stream.buffer.getvalue() == b"humanmm: 1 \\xd7 2\n"  # type: ignore[attr-defined]


def test_a_browser_opens_for_a_user_with_a_screen_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    opened: list[str] = []
    monkeypatch.setattr(webbrowser, "open", opened.append)
    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True, raising=False)
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    terminal.open_in_browser(tmp_path / "page.html")
    assert opened == []
    monkeypatch.setenv("DISPLAY", ":0")
    terminal.open_in_browser(tmp_path / "page.html")
    assert opened == [(tmp_path / "page.html").as_uri()] and json.dumps(opened).startswith('["file:///')
