"""Processes of videos: forks of the fork server, what they take over, how they end, and when fresh ones start."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

SOURCE = Path(__file__).resolve().parents[3] / "src"
WORKER = """
import os, sys, threading
from pathlib import Path
from multiprocessing import forkserver
from humanmm.flows.service import fork_server
import bodies

fork_server.PRELOAD = "preloaded"
fork_server.launch()
print(forkserver._forkserver._forkserver_pid, flush=True)
def wait(process, number):
    process.join()
    print(number, "ended", process.exitcode, flush=True)
for number, line in enumerate(sys.stdin):
    process = fork_server.start(dict(BODY=line.strip(), HUMANMM_GONE=None), Path(os.environ["FOLDER"]), bodies.run)
    if "at once" in line:
        process.terminate()
    print(number, "pid", process.pid, flush=True)
    threading.Thread(target=wait, args=(process, number), daemon=True).start()
os._exit(0)
"""
BODIES = """
import os, sys, time
def wait():
    while not os.path.exists("over"):
        time.sleep(0.02)
def write(*facts):
    with open("message", "w") as file:
        print(*facts, file=file)
def run():
    exec(os.environ["BODY"], globals())
"""
PRELOADED = """
from humanmm.flows.service import fork_server
fork_server.PRELOAD = "preloaded"
fork_server._import_everything = lambda: __import__("some_code")
PRELOADED = fork_server.Preloaded()
"""


@dataclass
class Worker:
    """A process that starts others as a worker does, and prints what becomes of them."""

    folder: Path
    process: subprocess.Popen[str]

    def line(self) -> list[str]:
        assert self.process.stdout is not None
        return self.process.stdout.readline().split()

    def start(self, body: str) -> int:
        """Have a process run a line of Python; its process id."""
        assert self.process.stdin is not None
        self.process.stdin.write(body + "\n")
        self.process.stdin.flush()
        _, what, pid = self.line()
        assert what == "pid"
        return int(pid)


@pytest.fixture
def worker(tmp_path: Path) -> Iterator[Worker]:
    for name, text in (("some_code", "answer = 42\n"), ("bodies", BODIES), ("preloaded", PRELOADED)):
        (tmp_path / f"{name}.py").write_text(text)
    (tmp_path / "films").mkdir()
    time.sleep(0.02)  # code that was written while it was loaded is not trusted
    environment = {
        **os.environ, "PYTHONPATH": os.pathsep.join([str(SOURCE), str(tmp_path)]), "FOLDER": str(tmp_path / "films"),
        "HUMANMM_GONE": "1", "TMPDIR": str(tmp_path), "PYTHONDONTWRITEBYTECODE": "1",
    }  # fmt: skip
    with subprocess.Popen(
        [sys.executable, "-c", WORKER], env=environment, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
        start_new_session=True,
    ) as process:  # fmt: skip
        yield Worker(tmp_path, process)
        os.killpg(process.pid, signal.SIGKILL)


def _until(condition: Callable[[], object]) -> None:
    deadline = time.monotonic() + 60
    while not condition():
        assert time.monotonic() < deadline
        time.sleep(0.02)


def _is_there(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def test_a_fork_has_the_code_the_environment_and_the_folder_that_it_should_have(worker: Worker) -> None:
    server = int(worker.line()[0])
    facts = "sys.modules['some_code'].answer, os.getcwd(), os.getppid(), 'HUMANMM_GONE' in os.environ"
    pid = worker.start(f"write({facts}); sys.exit('gone')")
    assert worker.line() == ["0", "ended", "1"]
    films = worker.folder / "films"
    assert (films / "message").read_text().split() == ["42", str(films), str(server), "False"]
    assert not _is_there(pid)
    worker.start("sys.exit(0)")
    assert worker.line() == ["1", "ended", "0"]
    worker.start("os.kill(os.getpid(), 9)")
    assert worker.line() == ["2", "ended", "-9"]


def test_nothing_of_ours_listens_where_another_user_could(worker: Worker) -> None:
    server = int(worker.line()[0])
    worker.start("wait()")
    inodes = {
        link.removeprefix("socket:[").rstrip("]")
        for pid in (server, worker.process.pid)
        for link in (str(fd.readlink()) for fd in Path(f"/proc/{pid}/fd").iterdir() if fd.is_symlink())
        if link.startswith("socket:[")
    }
    rows = [line.split() for line in Path("/proc/net/unix").read_text().splitlines()[1:]]
    paths = [row[7] for row in rows if row[6] in inodes and len(row) > 7]
    assert len(paths) == 1 and paths[0].startswith(str(worker.folder)), "no name in the abstract namespace"
    assert Path(paths[0]).parent.stat().st_mode & 0o777 == 0o700


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGHUP, signal.SIGQUIT, signal.SIGUSR1])
def test_a_signal_reaches_the_fork_as_the_one_that_flows_note(worker: Worker, number: int) -> None:
    worker.line()
    pid = worker.start("import signal; signal.signal(15, lambda *_: os._exit(3)); open('ready', 'w'); wait()")
    _until((worker.folder / "films/ready").exists)
    os.kill(pid, number)
    assert worker.line() == ["0", "ended", "3"]


def test_a_fork_ends_by_a_signal_that_comes_as_soon_as_it_is_known(worker: Worker) -> None:
    worker.line()
    for number in range(5):
        worker.start("time.sleep(5)  # is ended at once")
        assert worker.line() == [str(number), "ended", "-15"]


def test_the_fork_server_takes_its_forks_along_and_later_videos_start_without_it(worker: Worker) -> None:
    server = int(worker.line()[0])
    first, second = (worker.start("wait()") for _ in range(2))
    os.kill(first, signal.SIGKILL)
    assert worker.line() == ["0", "ended", "-9"]
    assert _is_there(second)
    os.kill(server, signal.SIGKILL)
    _until(lambda: not _is_there(second))
    assert worker.line()[:2] == ["1", "ended"]
    worker.start("os._exit(7)")
    assert worker.line() == ["2", "ended", "7"]


def test_the_end_of_a_worker_leaves_its_videos_and_then_its_fork_server_ends(worker: Worker) -> None:
    server = int(worker.line()[0])
    video = worker.start("wait()")
    worker.process.kill()
    worker.process.wait()
    os.kill(server, signal.SIGTERM)
    time.sleep(0.5)
    assert _is_there(video) and _is_there(server), "SIGTERM to the session is meant for the videos"
    (worker.folder / "films/over").touch()
    _until(lambda: not _is_there(video) and not _is_there(server))


def test_a_fork_server_whose_code_has_changed_forks_no_more_and_ends_after_its_forks(worker: Worker) -> None:
    server = int(worker.line()[0])
    before = worker.start("wait()")
    (worker.folder / "some_code.py").write_text("answer = 'another'\n")
    message = "import some_code; write(os.getppid(), some_code.answer)"
    worker.start(message)
    assert worker.line() == ["1", "ended", "0"]
    assert (worker.folder / "films/message").read_text().split() == [str(worker.process.pid), "another"], (
        "a fresh process"
    )
    assert _is_there(server) and _is_there(before)
    (worker.folder / "films/over").touch()
    assert worker.line() == ["0", "ended", "0"]
    _until(lambda: not _is_there(server))
    worker.start(message)
    assert worker.line() == ["2", "ended", "0"]
    parent, answer = (worker.folder / "films/message").read_text().split()
    assert int(parent) not in (server, worker.process.pid) and answer == "another", "a fork of a new fork server"


def test_a_fork_server_with_a_second_thread_does_not_fork(worker: Worker) -> None:
    worker.line()
    worker.start("pass")  # once it has ended, the fork server has read the files as they were
    assert worker.line() == ["0", "ended", "0"]
    (worker.folder / "preloaded.py").write_text(
        PRELOADED + "import threading\nthreading.Thread(target=threading.Event().wait, daemon=True).start()\n"
    )
    time.sleep(0.02)
    (worker.folder / "some_code.py").write_text("answer = 'another'\n")
    for number in (1, 2):
        worker.start("write(os.getppid())")
        assert worker.line() == [str(number), "ended", "0"]
        assert int((worker.folder / "films/message").read_text()) == worker.process.pid
