"""Processes that are forks of a template: what they take over, how they end, and when there are none."""

import os
import signal
import subprocess
import sys
import time
import uuid
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

from humanmm.flows.service.video_process import TEMPLATE

SOURCE = Path(__file__).resolve().parents[3] / "src"
BODY = """
import os, socket, sys, time
began_ns = time.time_ns()
import some_code
from humanmm.flows.service.fork_server import Template, become
import prefect.context
listener = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
listener.bind("\\0" + os.environ["HUMANMM_TEMPLATE"])
listener.listen()
asked = Template(listener, began_ns).forks()
if asked is not None:
    become(asked)
    exec(os.environ["TOLD"])
"""


@dataclass
class Nest:
    """A template, and the processes that ask it."""

    folder: Path
    name: str
    template: subprocess.Popen[bytes]

    def ask(self, told: str) -> subprocess.Popen[str]:
        """Have a fork run some lines of Python."""
        environment = {**os.environ, TEMPLATE: self.name, "TOLD": told, "PYTHONPATH": str(SOURCE)}
        command = [sys.executable, "-m", "humanmm.flows.service.video_process"]
        return subprocess.Popen(
            command, env=environment, cwd=self.folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        )


@pytest.fixture
def nest(tmp_path: Path) -> Iterator[Nest]:
    (tmp_path / "some_code.py").write_text("answer = 42\n")
    name = f"humanmm-test-{uuid.uuid4().hex}"
    path = os.pathsep.join([str(SOURCE), str(tmp_path)])
    template = subprocess.Popen(
        [sys.executable, "-c", BODY],
        env={**os.environ, TEMPLATE: name, "PYTHONPATH": path, "PREFECT_HOME": str(tmp_path / "prefect")},
        stdin=subprocess.PIPE, stdout=subprocess.PIPE,
    )  # fmt: skip
    _until(lambda: f"@{name}" in Path("/proc/net/unix").read_text())
    yield Nest(tmp_path, name, template)
    template.kill()
    template.wait()


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


def _first_line(asking: subprocess.Popen[str]) -> str:
    assert asking.stdout is not None
    return asking.stdout.readline().strip()


def test_a_fork_has_the_code_the_folder_the_streams_and_the_end_of_what_it_stands_for(nest: Nest) -> None:
    told = "print(sys.modules['some_code'].answer, os.getcwd(), os.getppid(), flush=True); sys.exit('gone')"
    asking = nest.ask(told)
    output, errors = asking.communicate(timeout=60)
    assert output.split() == ["42", str(nest.folder), str(nest.template.pid)]
    assert (errors, asking.returncode) == ("gone\n", 1)
    assert nest.ask("sys.exit(0)").wait(timeout=60) == 0
    assert nest.ask("os.kill(os.getpid(), 9)").wait(timeout=60) == -signal.SIGKILL


def test_a_signal_is_passed_on_to_the_fork(nest: Nest) -> None:
    told = "import signal, time; signal.signal(15, lambda *_: os._exit(3)); print('ready', flush=True); time.sleep(60)"
    asking = nest.ask(told)
    assert _first_line(asking) == "ready"
    asking.send_signal(signal.SIGTERM)
    assert asking.wait(timeout=60) == 3


def test_who_is_killed_takes_its_fork_along_and_the_template_all_of_them(nest: Nest) -> None:
    waits = "import time; print(os.getpid(), flush=True); time.sleep(60)"
    first, second = nest.ask(waits), nest.ask(waits)
    forks = [int(_first_line(asking)) for asking in (first, second)]
    first.kill()
    _until(lambda: not _is_there(forks[0]))
    assert _is_there(forks[1])
    nest.template.kill()
    _until(lambda: not _is_there(forks[1]))
    assert second.wait(timeout=60) == -signal.SIGKILL


def test_a_template_that_is_to_leave_forks_no_more_and_waits_for_its_forks(nest: Nest) -> None:
    told = "import time; print('ready', flush=True)\nwhile not os.path.exists('over'): time.sleep(0.05)"
    asking = nest.ask(told)
    assert _first_line(asking) == "ready"
    nest.template.send_signal(signal.SIGTERM)
    assert nest.template.stdout is not None and nest.template.stdout.read() == b"", "the worker sees it"
    assert nest.template.poll() is None and asking.poll() is None
    (nest.folder / "over").touch()
    assert asking.wait(timeout=60) == 0
    assert nest.template.wait(timeout=60) == 0


def test_a_template_whose_code_has_changed_forks_no_more_and_a_fresh_process_is_started(nest: Nest) -> None:
    (nest.folder / "some_code.py").write_text("answer = 'another'\n")
    asking = nest.ask("print('a fork')")
    output, errors = asking.communicate(timeout=60)
    assert output == "" and "Invalid flow run id" in errors, "it is Prefect's own engine, which was told no flow run"
    assert nest.template.stdout is not None and nest.template.stdout.read() == b""
    assert nest.template.wait(timeout=60) == 0
