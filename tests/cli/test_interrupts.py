"""Ctrl-C where a library makes another error of it, or none."""

import signal
import sys
import time
from typing import Any

import pytest

from humanmm.cli import main


def _as_in_a_compiled_module() -> None:
    try:
        signal.raise_signal(signal.SIGINT)
    except KeyboardInterrupt:
        raise ImportError("initialization failed") from None


def _as_an_object_goes() -> None:
    class Closing:
        def __del__(self) -> None:
            signal.raise_signal(signal.SIGINT)

    goes = Closing()
    del goes


def _by_the_system() -> None:
    signal.raise_signal(signal.SIGTERM)


@pytest.mark.parametrize(
    ("lose", "words"),
    [(_as_in_a_compiled_module, "interrupted"), (_as_an_object_goes, "interrupted"), (_by_the_system, "SIGTERM")],
)
@pytest.mark.parametrize("before_a_verb", [True, False])
def test_an_interruption_is_told_as_one(
    lose: Any, words: str, before_a_verb: bool, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted(*arguments: Any) -> Any:
        lose()
        time.sleep(0.2)
        raise AssertionError("goes on")

    hook, handlers = sys.unraisablehook, [signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)]
    monkeypatch.setattr("humanmm.cli.terminal.open_standard_streams" if before_a_verb else "humanmm.load", interrupted)
    assert main(["view", "."]) == 130
    (line,) = capsys.readouterr().err.strip().splitlines()
    assert line.startswith("humanmm: ") and words in line and "resumable with the same command" in line
    assert sys.unraisablehook is hook
    assert [signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)] == handlers


def test_an_error_after_an_interrupted_command_is_an_error(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("humanmm.load", lambda *arguments: _as_in_a_compiled_module())
    assert main(["view", "."]) == 130
    monkeypatch.setattr("humanmm.load", lambda *arguments: 1 / 0)
    assert main(["view", "."]) == 1
    assert "ZeroDivisionError" in capsys.readouterr().err


def test_keys_pressed_at_once_are_one_interruption(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    taken_down = []

    def interrupted(*arguments: Any) -> None:
        try:
            signal.raise_signal(signal.SIGINT)
        finally:
            signal.raise_signal(signal.SIGINT)
            taken_down.append(True)

    monkeypatch.setattr("humanmm.load", interrupted)
    assert main(["view", "."]) == 130
    assert taken_down
    assert len(capsys.readouterr().err.strip().splitlines()) == 1
