"""Which flow runs are computed by a process that lives: each holds a flock, which the kernel frees when it dies.

Prefect never learns that a process was killed: such a flow run would stay `Running`. Our server looks through these
files now and then, and ends as `Crashed` what nobody holds. Nothing here imports Prefect.
"""

import contextlib
import datetime
import fcntl
import http.client
import json
import logging
import os
import uuid
from collections.abc import Iterator
from pathlib import Path
from typing import Any, TextIO

log = logging.getLogger(__name__)

FINAL = ("COMPLETED", "FAILED", "CRASHED", "CANCELLED")
PAGE = 200
LOST = "its process was lost: it was killed, ran out of memory, or the machine went down"
TELLING_S = 45.0
"""A task of a flow run that ended so long ago has told all that it will ever tell."""


class Alive:
    """Says that a flow run's process lives, from now until `end`, or until the process is gone."""

    def __init__(self, home: Path, flow_run: str) -> None:
        self._path = home / "alive" / flow_run
        self._file: TextIO | None = None
        with contextlib.suppress(OSError):  # a full disk is no reason to stop here
            self._path.parent.mkdir(exist_ok=True)
            fresh = self._path.with_name(f".{uuid.uuid4().hex}")
            self._file = fresh.open("w")
            fcntl.flock(self._file, fcntl.LOCK_EX)
            fresh.rename(self._path)  # under this name it is never seen without its lock

    def end(self) -> None:
        """The flow run ends by itself now."""
        if self._file is not None:
            self._path.unlink(missing_ok=True)
            self._file.close()
            self._file = None


def lost(home: Path) -> Iterator[str]:
    """Flow runs whose process died before it could end them; each is forgotten when it was dealt with."""
    for path in sorted(home.glob("alive/[!.]*")):
        with contextlib.suppress(OSError), path.open("r+") as file:
            try:
                fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError:
                continue
            yield path.name
            path.unlink(missing_ok=True)


def crash_lost(home: Path, host: str, port: int) -> None:
    """Set what is lost to `Crashed` on our server, tasks included."""
    for flow_run in lost(home):
        found = _ask(host, port, "GET", f"/api/flow_runs/{flow_run}")
        if found is None or found.get("state_type") in FINAL:
            continue
        log.warning("the process of the flow run %s (%s) was lost", found.get("name"), flow_run)
        _set_state(host, port, f"flow_runs/{flow_run}", "CRASHED", LOST)
        for task in _tasks_at_work(host, port, {"id": {"any_": [flow_run]}}):
            _set_state(host, port, f"task_runs/{task}", "CRASHED", LOST)


def end_lost_tasks(host: str, port: int) -> None:
    """End the tasks of flow runs that have ended.

    A task tells its states in passing, without waiting for an answer: what was under way when its process or the server
    was killed never arrived, and it would stay `Running`.
    """
    before = datetime.datetime.now(datetime.UTC) - datetime.timedelta(seconds=TELLING_S)
    for ended, state, message in (
        (["COMPLETED"], "COMPLETED", "its end was never told; its flow run is completed"),
        (["FAILED", "CRASHED", "CANCELLED"], "CRASHED", "its end was never told; its flow run has ended"),
    ):
        flow_runs = {"state": {"type": {"any_": ended}}, "end_time": {"before_": before.isoformat()}}
        for task in _tasks_at_work(host, port, flow_runs):
            _set_state(host, port, f"task_runs/{task}", state, message)


def _tasks_at_work(host: str, port: int, flow_runs: dict[str, Any]) -> list[str]:
    at_work = {"state": {"type": {"any_": ["SCHEDULED", "PENDING", "RUNNING"]}}}
    asked = {"flow_runs": flow_runs, "task_runs": at_work, "limit": PAGE}
    return [str(task["id"]) for task in _ask(host, port, "POST", "/api/task_runs/filter", asked) or ()]


def _set_state(host: str, port: int, run: str, kind: str, message: str) -> None:
    state = {"type": kind, "name": kind.capitalize(), "message": message}
    _ask(host, port, "POST", f"/api/{run}/set_state", {"state": state, "force": True})


def _ask(host: str, port: int, method: str, path: str, body: dict[str, Any] | None = None) -> Any:
    """The answer, decoded; None if the server does not know what it was asked for."""
    connection = http.client.HTTPConnection(host, port, timeout=30)
    try:
        headers = {"Content-Type": "application/json"}
        connection.request(method, path, json.dumps(body) if body is not None else None, headers)
        response = connection.getresponse()
        text = response.read()
        return json.loads(text) if response.status < 300 else None
    finally:
        connection.close()


def home_of_our_server() -> Path | None:
    """Where runs of this process are noted: $PREFECT_HOME if our own server is asked, else nowhere."""
    home = os.environ.get("PREFECT_HOME")
    return Path(home) if home and (Path(home) / "server.json").exists() else None
