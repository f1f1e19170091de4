"""The processes of videos are found by the mark of their worker, with /proc and without it."""

import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from humanmm import machine
from humanmm.flows.service import video_processes
from humanmm.flows.service.video_processes import MARK, videos_of

ROOT = Path(__file__).resolve().parents[3]
BEGUN = """
import time
from humanmm.flows.service.video_processes import begin_video
begin_video()
print("begun", flush=True)
time.sleep(600)
"""


@pytest.fixture(params=["linux", "darwin"])
def system(request: pytest.FixtureRequest, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    monkeypatch.setattr(sys, "platform", request.param)
    if request.param == "darwin":
        monkeypatch.setattr(machine, "PROC", Path("/nowhere"))
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    return str(request.param)


@pytest.fixture
def begin(system: str, tmp_path: Path) -> Iterator[Callable[[str], int]]:
    """Starts a process of a video for workers with a mark; its number."""
    begun: list[subprocess.Popen[str]] = []
    path = os.pathsep.join([str(ROOT / "src"), *([str(ROOT / "tests/no_linux")] if system == "darwin" else [])])

    def start(mark: str) -> int:
        environment = {**os.environ, MARK: mark, "PYTHONPATH": path, "TMPDIR": str(tmp_path)}
        command = [sys.executable, "-c", BEGUN]
        begun.append(subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, text=True))
        assert (stream := begun[-1].stdout) is not None and stream.readline() == "begun\n"
        return begun[-1].pid

    yield start
    for process in begun:
        process.kill()
        process.communicate()


def test_living_videos_of_one_mark_are_found(begin: Callable[[str], int]) -> None:
    one, two, other = begin("one"), begin("one"), begin("other")
    assert sorted(videos_of("one")) == sorted([one, two])
    assert videos_of("other") == [other]
    assert videos_of("nobody") == []
    os.kill(one, 9)
    os.waitid(os.P_PID, one, os.WEXITED | os.WNOWAIT)
    assert videos_of("one") == [two], "one that has ended is none, also before its parent has looked"


def test_a_process_that_has_got_the_number_of_a_video_is_none(
    begin: Callable[[str], int], system: str, tmp_path: Path
) -> None:
    if system == "linux":
        pytest.skip("its environment says what it is")
    (folder,) = (begin("one") and tmp_path).glob("humanmm-videos-*")
    (folder / f"one.{os.getpid()}").write_text("1")
    assert os.getpid() not in videos_of("one")
    begin("two")
    assert not (folder / f"one.{os.getpid()}").exists(), "what a killed one left is removed by the next"


def test_a_folder_of_another_user_is_not_trusted(system: str, monkeypatch: pytest.MonkeyPatch) -> None:
    if system == "linux":
        pytest.skip("no folder is used")
    videos_of("one")
    user = os.getuid()
    monkeypatch.setattr(video_processes.os, "getuid", lambda: user + 1)
    (Path(tempfile.gettempdir()) / f"humanmm-videos-{user}").rename(
        Path(tempfile.gettempdir()) / f"humanmm-videos-{user + 1}"
    )
    with pytest.raises(PermissionError, match="belongs to another user"):
        videos_of("one")
