"""What all verbs have in common: how they are spelled, what a wrong word is answered with, what --help costs."""

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import pytest

from humanmm.cli import main
from humanmm.cli.results import FORMATS
from humanmm.cli.verb import app, verb
from humanmm.flows.bench import tables
from humanmm.flows.bench.tables import TableRequest

ROOT = Path(__file__).resolve().parents[2]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["recovr"], "Did you mean 'recover'?"),
        (["recover", "film.mp4", "--focl-px", "3"], "Did you mean '--focal-px'"),
        (["recover", "film.mp4", "--from", "cam"], "Did you mean 'camera'?"),
        (["export", "runs/film", "--format", "bhv"], "Did you mean 'bvh'?"),
        (["batch", "submt"], "Did you mean 'submit'?"),
        (["recover", "film.mp4", "--people.max_peeple", "3"], "--people.max_people"),
        (["explain", "runs/film", "camra"], "'camera'"),
        (["recover"], "Missing argument 'VIDEO…'"),
        (["recover", "film.mp4", "--focal-px", "long"], "--focal-px"),
        (["batch", "status", "--limit", "1"], "No such option"),
        (["serve", "--limit", "0"], "--limit"),
        (["dataset", "build"], "Missing command"),
        ([], "Missing command"),
    ],
)
def test_a_wrong_word_is_answered_in_one_line_with_what_was_meant(
    capsys: pytest.CaptureFixture[str], arguments: list[str], message: str
) -> None:
    assert main(arguments) == 2
    captured = capsys.readouterr()
    assert captured.out == ""
    (line,) = captured.err.splitlines()
    assert line.startswith("humanmm: ") and message in line and "--help`)" in line


def test_the_version_is_one_line(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["--version"]) == 0
    assert capsys.readouterr().out.startswith("humanmm 0.")


def test_help_groups_verbs_and_settings_and_loads_no_science() -> None:
    script = (
        "import sys\n"
        "from humanmm.cli import main\n"
        "assert main(sys.argv[1:]) == 0\n"
        "heavy = {'numpy', 'prefect', 'torch', 'cv2', 'av', 'scipy', 'zarr', 'sqlalchemy'}\n"
        "assert not heavy & set(sys.modules), heavy & set(sys.modules)\n"
    )
    for arguments, shown in (
        (["--help"], ["One video", "Results", "Many videos", "Benchmark", "Store and machine", "recover", "doctor"]),
        (
            ["recover", "-h"],
            [
                "people: Person detection",
                "--people.max_people",
                "≥ 1, ≤ 32",
                "true|false",
                "scenes|boxes|keypoints",
                "default: 8.0",
                "[run.stages.c",
                "Examples",
            ],
        ),
    ):
        command = [sys.executable, "-c", script, *arguments]
        environment = {**os.environ, "PYTHONPATH": str(ROOT / "src"), "COLUMNS": "100"}
        done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr
        assert all(text in done.stdout for text in shown), done.stdout


def test_the_shell_completes_verbs_flags_and_formats(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setenv("_HUMANMM_COMPLETE", "complete_bash")

    def completed(words: str) -> list[str]:
        monkeypatch.setenv("COMP_WORDS", words)
        monkeypatch.setenv("COMP_CWORD", str(len(words.split()) - (not words.endswith(" "))))
        with pytest.raises(SystemExit) as ended:
            main([])
        assert ended.value.code == 0
        return capsys.readouterr().out.split()

    assert completed("humanmm rec") == ["recover"]
    assert completed("humanmm recover --camera.st") == ["--camera.static"]
    assert completed("humanmm recover --camera.static ") == ["true", "false"]
    assert completed("humanmm recover --people.pose b") == ["best", "blazepose-heavy", "blazepose-full"]
    assert completed("humanmm recover --from c") == ["camera"]
    assert completed("humanmm export runs/film --format ") == list(FORMATS)
    assert completed("humanmm export runs/film --format b") == ["bvh", "blender"]


def test_the_traceback_is_for_those_who_ask(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["status", str(tmp_path)]) == 1
    assert "Traceback" not in capsys.readouterr().err
    assert main(["status", str(tmp_path), "-v"]) == 1
    lines = capsys.readouterr().err.splitlines()
    assert any("Traceback" in line for line in lines) and lines[-1].startswith("humanmm: ")


def test_ctrl_c_before_a_verb_begins_is_one_line(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def interrupted() -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("humanmm.cli.terminal.open_standard_streams", interrupted)
    assert main(["recover", "film.mp4"]) == 130
    assert capsys.readouterr().err == "\rhumanmm: interrupted; resumable with the same command\n"


def test_an_unexpected_error_and_an_interrupt_are_one_line(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    for error, status, message in (
        (ZeroDivisionError("a defect"), 1, "a defect"),
        (KeyboardInterrupt(), 130, "stays in"),
    ):

        def fail(*arguments: Any, error: BaseException = error) -> Any:
            raise error

        monkeypatch.setattr("humanmm.load", fail)
        assert main(["view", "."]) == status
        (line,) = capsys.readouterr().err.splitlines()
        assert line.startswith("humanmm: ") and message in line


def test_a_reader_that_leaves_is_no_error() -> None:
    done = subprocess.run(
        f"{sys.executable} -m humanmm.cli recover --help | head -1", shell=True, capture_output=True, text=True,
        env={**os.environ, "PYTHONPATH": str(ROOT / "src")}, check=False,
    )  # fmt: skip
    assert done.stderr == ""


def test_a_list_takes_its_values_one_after_the_other(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    seen: list[TableRequest] = []
    monkeypatch.setattr(tables, "own_data", lambda request, config: seen.append(request) or tmp_path)
    assert main(["bench", "speed", "--minutes", "1", "10", "--imported", "a=b", "--imported", "c=d"]) == 1
    assert main(["bench", "--minutes", "2", "--minutes", "3", "--runs", "4", "speed"]) == 2
    assert (seen[0].minutes, seen[0].imported) == ([1.0, 10.0], ["a=b", "c=d"])
    assert seen[1].minutes == [2.0, 3.0]


def test_every_verb_has_a_sentence() -> None:
    import typer

    def leaves(command: Any) -> list[Any]:
        inner = getattr(command, "commands", {}).values()
        return [leaf for one in inner for leaf in leaves(one)] or [command]

    assert main(["--version"]) == 0  # declares all verbs
    found = leaves(typer.main.get_command(app))
    assert len(found) >= 22 and all(command.help for command in found)
    assert callable(verb)


@pytest.mark.parametrize("verbs", ["--version", "store du", "doctor --json"])
def test_a_reader_that_has_left_costs_no_error(verbs: str, tmp_path: Path) -> None:
    command = [sys.executable, "-c", "import sys; from humanmm.cli import main; sys.exit(main())", *verbs.split()]
    environment = {**os.environ, "PYTHONPATH": str(ROOT / "src"), "HUMANMM_STORE": str(tmp_path), "BASH_ENV": ""}
    shell = 'set -o pipefail; "$@" | sleep 0'
    done = subprocess.run(
        ["bash", "-c", shell, "bash", *command], env=environment, capture_output=True, text=True, check=False
    )
    assert "Traceback" not in done.stderr and "Broken" not in done.stderr


def test_an_interrupted_command_does_not_wait_for_its_threads(tmp_path: Path) -> None:
    """Ctrl-C that is pressed again while the first is being reported reaches `main` as Typer's status."""
    (tmp_path / "pressed.py").write_text(
        "import sys, threading, time\nfrom humanmm import cli\n"
        "threading.Thread(target=time.sleep, args=(60,)).start()\n"
        "cli._run = lambda arguments: 130\n"
        "sys.exit(cli.main())"
    )
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT / "src"), str(tmp_path)])}
    assert subprocess.run([sys.executable, "-m", "pressed"], env=environment, timeout=30, check=False).returncode == 130


def test_ctrl_c_inside_a_text_that_is_executed_ends_with_the_status_of_ctrl_c(tmp_path: Path) -> None:
    """As in an import that makes dataclasses: `python -m` would kill itself with SIGINT at its end."""
    (tmp_path / "pressed.py").write_text(
        "import sys\nfrom humanmm import cli\n"
        "cli._run = lambda arguments: exec('raise KeyboardInterrupt')\n"
        "sys.exit(cli.main())"
    )
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join([str(ROOT / "src"), str(tmp_path)])}
    command = [sys.executable, "-m", "pressed"]
    ended = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert ended.returncode == 130 and "resumable with the same command" in ended.stderr
