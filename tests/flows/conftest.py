"""A server of a test's own, its processes, and toy films for it to run."""

import json
import os
import signal
import sqlite3
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

PATIENCE = 4
"""Limits are for a quiet machine; a busy one is waited for longer."""


@dataclass(frozen=True)
class Place:
    """The cache folder of one test: its server and its `humanmm serve`, found by their environment."""

    folder: Path

    def pids(self, command: str) -> list[int]:
        """Processes of this test by a part of their command line, or by their name."""
        found = []
        for process in Path("/proc").glob("[0-9]*"):
            try:
                environment = (process / "environ").read_bytes()
                line = (process / "cmdline").read_bytes().replace(b"\0", b" ").decode(errors="replace")
                line += (process / "comm").read_text()
            except OSError:
                continue
            if f"HUMANMM_CACHE={self.folder}\0".encode() in environment and command in line:
                found.append(int(process.name))
        return [pid for pid in found if pid != os.getpid()]

    def end(self, command: str, number: int = signal.SIGKILL) -> None:
        """Send a signal to processes of this test, and wait until they are gone."""
        pids = self.pids(command)
        for pid in pids:
            try:
                os.kill(pid, number)
            except ProcessLookupError:
                continue
        self.until(lambda: not any(Path(f"/proc/{pid}/exe").exists() for pid in pids), 40)

    @staticmethod
    def until(condition: Callable[[], object], limit_s: float) -> None:
        """Wait for something; the test fails if it takes longer."""
        deadline = time.monotonic() + PATIENCE * limit_s
        while not condition():
            assert time.monotonic() < deadline, "it took too long"
            time.sleep(0.2)

    def ask(self, query: str, *values: object) -> list[Any]:
        """Rows of Prefect's database."""
        (file,) = self.folder.glob("prefect-*/prefect.db")
        with sqlite3.connect(file, timeout=30) as connection:
            return connection.execute(query, values).fetchall()

    def change(self, statement: str) -> None:
        """Change Prefect's database behind its back."""
        (file,) = self.folder.glob("prefect-*/prefect.db")
        with sqlite3.connect(file, timeout=30) as connection:
            connection.execute(statement)

    def flow_runs(self) -> list[tuple[str, str]]:
        """Name and state of every flow run that Prefect knows."""
        return sorted(self.ask("select name, state_type from flow_run"))

    @property
    def url(self) -> str:
        """Address of its server's API."""
        return str(json.loads(next(self.folder.glob("prefect-*/server.json")).read_text())["url"])

    def client(self, script: str, *arguments: str, timeout_s: float = 120) -> str:
        """What a script prints that has `client` of this server, in a process of its own."""
        lines = "".join(f"        {line}\n" for line in script.strip().splitlines())
        whole = (
            "import asyncio, sys\nfrom prefect import get_client\n\n\nasync def main():\n"
            f"    async with get_client() as client:\n{lines}\n\nasyncio.run(main())\n"
        )
        environment = {**os.environ, "PREFECT_API_URL": self.url, "PREFECT_HOME": str(self.folder / "client")}
        environment["PYTHONPATH"] = str(Path(__file__).resolve().parents[2] / "src")
        done = subprocess.run(
            [sys.executable, "-c", whole, *arguments], env=environment, capture_output=True, text=True,
            timeout=timeout_s, check=False,
        )  # fmt: skip
        assert done.returncode == 0, done.stderr
        return done.stdout.strip()


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Place]:
    """A cache folder, and so a server and a `humanmm serve`, of this test alone."""
    found = Place(tmp_path / "cache")
    monkeypatch.setenv("HUMANMM_CACHE", str(found.folder))
    monkeypatch.setenv("HUMANMM_SERVER_IDLE_S", "20")
    yield found
    found.end("-m toyline", signal.SIGTERM)
    found.end("humanmm.flows.service.serve", signal.SIGTERM)
    found.end("humanmm.flows.", signal.SIGKILL)
    found.end("prefect.engine", signal.SIGKILL)


@pytest.fixture
def farm(any_toy: Any, place: Place) -> Any:
    """The toy, whose stages are also those of processes that a worker starts; three films and one that is empty."""
    toy = any_toy
    (toy.folder / "sitecustomize.py").write_text(
        "from humanmm.tasks import pipeline\nfrom toyline.table import STAGES\npipeline.STAGES = STAGES\n"
    )
    (toy.folder / "films").mkdir()
    for number in range(3):
        film = toy.folder / f"films/{number}.mp4"
        film.write_text(json.dumps({"num_frames": 60 + number, "cuts": [20, 40]}))
    (toy.folder / "films/empty.mp4").touch()
    return toy


@pytest.fixture
def states(farm: Any) -> Callable[[], dict[str, dict[str, Any]]]:
    """What `batch status --json` tells of each video, by its stem."""

    def ask() -> dict[str, dict[str, Any]]:
        answer = farm.main("batch", "status", "--json")
        assert answer[0] == 0, answer
        return {Path(video["video"]).stem: video for video in json.loads(answer[1])["videos"]}

    return ask
