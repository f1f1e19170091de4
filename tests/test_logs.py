"""Log lines for machines."""

import io
import json
import logging
import sys
from pathlib import Path
from typing import Any

import pytest

from humanmm.cli.terminal import say, write, write_path
from humanmm.logs import JsonLines, printable, to_standard_error


def test_a_line_is_one_object_with_what_the_caller_knows() -> None:
    record = logging.makeLogRecord(
        {
            "name": "humanmm.x",
            "levelname": "INFO",
            "msg": "a %s\nb",
            "args": ("line",),
            "stage": "camera",
            "seconds": 1.5,
        }
    )
    text = JsonLines().format(record)
    assert "\n" not in text
    entry = json.loads(text)
    assert (entry["message"], entry["stage"], entry["seconds"], entry["level"]) == ("a line\nb", "camera", 1.5, "INFO")
    assert entry["time"].endswith("Z") and "args" not in entry and "error" not in entry


def test_an_error_says_where_it_came_from() -> None:
    try:
        raise ValueError("a reason")
    except ValueError as error:
        record = logging.makeLogRecord({"msg": "it failed", "exc_info": (type(error), error, error.__traceback__)})
    assert "ValueError: a reason" in json.loads(JsonLines().format(record))["error"]


@pytest.mark.usefixtures("server_cache")
def test_a_run_tells_every_stage_to_machines_and_nothing_to_people(toy: Any) -> None:
    reported = toy.main("recover", "film.mp4", HUMANMM_LOG="json")[2].splitlines()
    lines = [line for line in reported if line.startswith("{")]
    entries = [json.loads(line) for line in lines]
    stages = {(entry.get("stage"), entry.get("unit")) for entry in entries}
    assert {("decode", "video"), ("camera", "shot 1"), ("people", "scene 0")} <= stages
    assert all(line.startswith("humanmm: ") for line in reported if line not in lines)
    plain = toy.main("recover", "film.mp4", "--out", "again")[2]
    assert not any(line.startswith("{") for line in plain.splitlines())


def test_a_line_goes_where_standard_error_is_now(monkeypatch: pytest.MonkeyPatch) -> None:
    """A run that is shown on a terminal replaces sys.stderr, so that lines do not tear what is shown."""
    logger = logging.getLogger("humanmm")
    before = logger.handlers, logger.level, logger.propagate
    try:
        to_standard_error(verbose=False)
        shown = io.StringIO()
        monkeypatch.setattr(sys, "stderr", shown)
        logger.warning("the disk is slow")
        assert shown.getvalue() == "humanmm: the disk is slow\n"
    finally:
        logger.handlers, logger.level, logger.propagate = before


def test_a_standard_error_that_was_closed_does_not_matter(monkeypatch: pytest.MonkeyPatch) -> None:
    before, now = io.StringIO(), io.StringIO()
    logger = logging.getLogger("humanmm")
    kept = logger.handlers, logger.level, logger.propagate
    monkeypatch.setattr(sys, "stderr", before)
    to_standard_error(verbose=False)
    try:
        before.close()
        monkeypatch.setattr(sys, "stderr", now)
        logger.warning("the lamp is out")
    finally:
        logger.handlers, logger.level, logger.propagate = kept
    assert now.getvalue() == "humanmm: the lamp is out\n"


def test_what_a_terminal_obeys_is_written_as_escapes(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert printable("a\tb\n\x1b]0;title\x07 \u202e \udcff é") == "a\tb\n\\x1b]0;title\\x07 \\u202e \\udcff é"
    say("no such video: \x1b[31m.mp4")
    assert capsys.readouterr().err == "humanmm: no such video: \\x1b[31m.mp4\n"
    write("\x1b[31m.mp4")
    assert capsys.readouterr().out == "\x1b[31m.mp4\n", "the next program gets what there is"
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True)
    write("\x1b[31m.mp4")
    write_path(Path("\x1b[31m.mp4"))
    assert capsys.readouterr().out == "\\x1b[31m.mp4\n" * 2
