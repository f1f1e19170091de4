"""What people see of a run while they wait; nothing is written where nobody watches."""

import io
import os
import re
import sys
from pathlib import Path
from typing import Any

import pytest
from rich.console import Console
from terminal import on_terminal

from humanmm.progress import Watch, counted, in_time, watching


class _Terminal(io.StringIO):
    def isatty(self) -> bool:
        return True


def _shown(watch: Watch) -> list[str]:
    console = Console(file=io.StringIO(), width=100, height=40, force_terminal=True, color_system=None)
    with console.capture() as captured:
        console.print(watch)
    return [line.rstrip() for line in captured.get().splitlines() if line.strip()]


def _line(watch: Watch, stage: str) -> str:
    return next(line for line in _shown(watch) if re.search(rf"\b{stage}\b", line))


@pytest.mark.parametrize("shown", [True, False])
def test_a_run_is_shown_on_a_terminal_unless_that_is_not_wanted(monkeypatch: pytest.MonkeyPatch, shown: bool) -> None:
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setattr(sys, "stderr", _Terminal())
    terminal = sys.stderr
    with watching("film.mp4", shown=shown) as watch:
        watch.step("reading the video")
    assert ("people" in terminal.getvalue()) is shown  # type: ignore[attr-defined]


def test_nothing_is_written_where_nobody_watches(capfd: pytest.CaptureFixture[str]) -> None:
    with watching("film.mp4") as watch:
        watch.step("reading the video")
    assert capfd.readouterr() == ("", "")


def test_what_is_drawn_frame_by_frame_has_a_bar_for_who_watches(
    monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]
) -> None:
    with counted("world.mp4") as progress:
        progress(3, 10)
    assert capfd.readouterr() == ("", "")
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.setattr(sys, "stderr", _Terminal())
    terminal = sys.stderr
    with counted("world.mp4") as progress:
        progress(5, 10)
    shown = terminal.getvalue()  # type: ignore[attr-defined]
    assert "world.mp4" in shown and "50%" in shown


def test_every_stage_and_shot_is_shown_with_its_frames_speed_and_time(toy: Any) -> None:
    run = toy.open()
    watch = Watch("film.mp4", [stage.name for stage in run.stages])
    watch.step("starting Prefect's server")
    assert "starting Prefect's server …" in _shown(watch)[-1]
    watch.follow(run)
    for name in ("decode", "scenes"):
        run.execute(run.unit(name))
    assert re.search(r"✓ +decode +60 of 60 frames +\d\.\d s", _line(watch, "decode"))
    assert not any("Prefect" in line for line in _shown(watch)), "a stage has begun"
    first, second = run.units(run.stage("people")) or ()
    watch.begin(first)
    watch.begin(second)
    watch._work[first.label].begun -= 10.0
    watch.report(first, 10, 20)
    assert re.search(r"▸ +people · 0 of 2 scenes +10 of 60 frames +1\.0 frames/s +0:50 left", _line(watch, "people"))
    assert re.search(r"scene 0 +10 of 20 frames +1\.0 frames/s +0:10 left", _line(watch, "scene 0"))
    assert re.search(r"scene 1 +0 of 40 frames +0:00", _line(watch, "scene 1"))
    assert _line(watch, "camera").split() == ["camera"], "it has not begun"
    assert "left" in _shown(watch)[0]


def test_what_failed_was_skipped_or_was_in_the_store_is_distinguished(
    toy: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    toy.run()
    monkeypatch.setenv("TOY_FAIL", "camera=stage")
    run = toy.open(camera={"static": True})
    watch = Watch("film.mp4", [stage.name for stage in run.stages])
    watch.follow(run)
    toy._through(run, expect_failure=True)
    assert "in the store" in _line(watch, "people")
    assert "✗" in _line(watch, "camera")
    assert "skipped" in _line(watch, "hmr")


def test_many_shots_do_not_push_the_rest_off_the_screen(toy: Any) -> None:
    run = toy.run()
    watch = Watch("film.mp4", [stage.name for stage in run.stages])
    watch.follow(run)
    for unit in run.units(run.stage("camera")) or ():
        watch.begin(unit)
    console = Console(file=io.StringIO(), width=100, height=10, force_terminal=True, color_system=None)
    with console.capture() as captured:
        console.print(watch)
    assert len(captured.get().splitlines()) <= 10


@pytest.mark.parametrize(("seconds", "message"), [(6.6, "0:07"), (750, "12:30"), (3723, "1:02:03")])
def test_times_are_as_people_read_them(seconds: float, message: str) -> None:
    assert in_time(seconds) == message


LONGEST_S = 2.0


@pytest.mark.server
def test_the_terminal_is_never_blank_not_even_while_a_server_starts(toy: Any, new_cache: Path) -> None:
    environment = toy.environment(HUMANMM_CACHE=str(new_cache), HUMANMM_SERVER_IDLE_S="1")
    session = on_terminal(toy.command_line("recover", "film.mp4"), cwd=toy.folder, env=environment)
    assert session.status == 0, session.text
    assert session.pieces[0][0] < LONGEST_S + _load()
    assert session.longest_silence_s < LONGEST_S + _load()
    assert "starting Prefect's server" in session.text and "60 of 60 frames" in session.text
    assert "Traceback" not in session.text


@pytest.mark.usefixtures("server_cache")
@pytest.mark.parametrize(
    ("seen", "sleep", "times"),
    [
        pytest.param("decode", "", 1, id="at the beginning"),
        pytest.param("Prefect", "", 1, id="at the server"),
        pytest.param("people", "people=30", 1, id="in a stage"),
        pytest.param("align", "align=30", 1, id="in the last stages"),
        pytest.param("people", "people=30", 3, id="thrice in a stage"),
        pytest.param("decode", "", 3, id="thrice at the beginning", marks=pytest.mark.slow),
        pytest.param("Prefect", "", 3, id="thrice at the server", marks=pytest.mark.slow),
        pytest.param("align", "align=30", 3, id="thrice in the last stages", marks=pytest.mark.slow),
    ],
)
def test_ctrl_c_ends_a_run_within_two_seconds_in_one_line(toy: Any, seen: str, sleep: str, times: int) -> None:
    def reached(text: str) -> bool:
        begun = not sleep or (toy.log.exists() and seen in toy.log.read_text())
        return seen in text and begun

    environment = toy.environment(TOY_SLEEP=sleep)
    command = toy.command_line("recover", "film.mp4")
    session = on_terminal(command, cwd=toy.folder, env=environment, press_when=reached, times=times)
    assert session.status == 130, session.text
    assert session.pressed is not None and session.ended - session.pressed < 2.0 + _load()
    assert "Traceback" not in session.text and "Exception" not in session.text
    (line,) = session.last_lines
    assert line.removeprefix("^C").lstrip("^C").startswith("humanmm: ") and "resumable with the same command" in line


def _load() -> float:
    """Seconds more on a machine on which others compute as well."""
    return 2.0 * max(0.0, os.getloadavg()[0] / (os.cpu_count() or 1) - 1)
