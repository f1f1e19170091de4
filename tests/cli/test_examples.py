"""The examples of --help can be typed as they stand."""

import shlex
from typing import Any

import pytest
import typer

from humanmm.cli import main
from humanmm.cli.examples import EXAMPLES
from humanmm.cli.verb import app

LINES = [(command, line) for command, lines in EXAMPLES.items() for line, _ in lines]


@pytest.mark.parametrize(("command", "line"), LINES, ids=[line for _, line in LINES])
def test_an_example_is_read_as_a_command_of_its_verb(command: str, line: str) -> None:
    main(["--version"])  # declares all verbs
    program, *words = shlex.split(line)
    found: Any = typer.main.get_command(app)
    for word in command.split():
        assert words.pop(0) == word
        found = found.commands[word]
    assert program == "humanmm"
    found.make_context(command, words)  # an unknown flag or a wrong value raises


def test_help_ends_with_the_examples(capsys: pytest.CaptureFixture[str]) -> None:
    main(["export", "--help"])
    shown = capsys.readouterr().out
    assert "Examples" in shown and "humanmm export runs/film --format bvh" in shown
