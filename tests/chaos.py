"""A machine on which everything goes wrong: two workers on a batch, faults at random times from one seed.

`humanmm serve` and a second worker run as they would under an operator's supervisor, which starts again what has died.
The store (or the copies of what is in a bucket), the run folders and Prefect's database share one small disk.
Executions are counted where they happen: in the child processes that compute one stage × unit each.
"""

import contextlib
import json
import os
import random
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from humanmm.flows.service.fork_server import PRELOAD
from humanmm.flows.service.video_processes import VIDEO

ROOT = Path(__file__).resolve().parents[1]
DISK_MB = 2000
FULL_S = (10.0, 30.0)
PATIENCE_S = 300.0
"""How long after the last fault it is looked whether losses are noticed."""
PAUSE_S = (3.0, 9.0)
"""Between two faults."""
END_S = 90.0
"""How long what is supervised may take to end after SIGTERM, as systemd's `TimeoutStopSec`."""
RESTART_S = 2.0
"""A supervisor waits so long before it starts again what has died."""
PROCESSES = {
    "task": "humanmm.tasks.engine.runners.processes",
    "video": VIDEO,
    "fork server": PRELOAD,
    "worker": "humanmm.flows.service.worker",
    "server": "humanmm.flows.server.server_process",
    "serve": "humanmm.cli serve",
}
"""What is killed → a part of its command line or its name."""
WEIGHTS = {"task": 5, "video": 3, "fork server": 1, "worker": 2, "server": 1, "serve": 1, "flip": 4, "full disk": 1}
SETTLED_S = 2.0
"""Seconds after which a worker has seen that its fork server and its videos were killed."""

COUNTING = """
import json, os, sys, time
if any("humanmm.tasks.engine.runners.processes" in part for part in sys.orig_argv):
    from humanmm.tasks.units.execute import UnitExecutor
    compute = UnitExecutor.compute
    def counted(executor, unit):
        def note(**what):
            facts = {"at": time.time(), "pid": os.getpid(), "unit": unit.label, **what}
            facts |= {"video": executor.video.path.name, "key": executor.keys.recipe(unit).key}
            with open(os.environ["CHAOS_EXECUTIONS"], "a") as file:
                file.write(json.dumps(facts) + "\\n")
        note(event="begun")
        try:
            result = compute(executor, unit)
        except Exception as error:
            note(event="failed", reason=str(error))
            raise
        note(event=result.state, reason=result.reason)
        return result
    UnitExecutor.compute = counted
"""


@dataclass
class Fault:
    """Something that was done to the machine."""

    kind: str
    at: float
    target: str = ""
    flow_runs: Mapping[int, str] = field(default_factory=dict)
    """What ended with it: process → its flow run."""
    noticed_s: float | None = None
    """Until it was noticed; None if nobody has to, or nobody has yet."""


class Supervised:
    """A command that is started again when it has died, as by systemd with `Restart=always`."""

    def __init__(self, command: list[str], environment: Callable[[], Mapping[str, str]], log: Path, cwd: Path) -> None:
        self._start = lambda output: subprocess.Popen(
            command, env=environment(), cwd=cwd, stdin=subprocess.PIPE, stdout=output, stderr=output,
            start_new_session=True,
        )  # fmt: skip
        self._log, self._over, self._is_late = log, threading.Event(), False
        self._thread = threading.Thread(target=self._keep_up, daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Tell it to stop, and start it no more; the test fails if it does not end in time."""
        self._over.set()
        self._thread.join()
        assert not self._is_late, f"{self._log.stem} did not end within {END_S:g} s of SIGTERM; it was killed"

    def _keep_up(self) -> None:
        with self._log.open("ab") as output:
            while not self._over.is_set():
                process = self._start(output)
                while process.poll() is None and not self._over.wait(0.2):
                    pass
                if process.poll() is None:
                    process.terminate()
                    try:
                        process.wait(END_S)
                    except subprocess.TimeoutExpired:
                        self._is_late = True
                        process.kill()
                        process.wait()
                if process.stdin is not None:
                    process.stdin.close()
                self._over.wait(RESTART_S)


@dataclass
class Machine:
    """One small disk with everything on it; what is counted lies in `folder`, outside."""

    folder: Path
    seed: int
    bucket: str | None = None
    """`s3://…` of the store, unless it lies on the disk."""
    faults: list[Fault] = field(default_factory=list)

    @property
    def disk(self) -> Path:
        return self.folder / "disk"

    @property
    def store(self) -> Path:
        return self.disk / "store"

    @property
    def execution_log(self) -> Path:
        return self.folder / "executions"

    @contextlib.contextmanager
    def mounted(self) -> Iterator[bool]:
        """Have the small disk; False where this process may not mount one, and then nothing fills it."""
        self.disk.mkdir(parents=True)
        (self.folder / "sitecustomize.py").write_text(COUNTING)  # once: changed code would end all forking
        mount = ["mount", "-t", "tmpfs", "-o", f"size={DISK_MB}m", "tmpfs", str(self.disk)]
        allowed = subprocess.run(mount, capture_output=True, check=False).returncode == 0
        try:
            yield allowed
        finally:
            for kept in (self.disk / "cache").glob("prefect-*/*"):
                if kept.suffix in (".log", ".db", ".db-wal"):  # for who looks why it failed
                    shutil.copy(kept, self.folder)
            if allowed:
                subprocess.run(["umount", "--lazy", str(self.disk)], check=True)

    def environment(self) -> dict[str, str]:
        """Of everything that runs here."""
        own = {
            "PYTHONPATH": os.pathsep.join([str(self.folder), str(ROOT / "src")]),
            "HUMANMM_STORE": self.bucket or str(self.store),
            "XDG_DATA_HOME": str(self.disk / "data"),  # batches of a bucket
            "HUMANMM_CACHE": str(self.disk / "cache"),
            "CHAOS_EXECUTIONS": str(self.execution_log),
        }
        return {**os.environ, **own}

    def worker_environment(self) -> dict[str, str]:
        """Of a second worker: it knows the server's address."""
        home = next((self.disk / "cache").glob("prefect-*"))
        url = f"http://127.0.0.1:{(home / 'port').read_text()}/api"
        own = {"PREFECT_API_URL": url, "PREFECT_HOME": str(home)}
        return {**self.environment(), **own}

    def humanmm(self, *arguments: str, timeout_s: float = 600) -> subprocess.CompletedProcess[str]:
        """One command line to its end."""
        return subprocess.run(
            [sys.executable, "-m", "humanmm.cli", *arguments], cwd=self.disk, env=self.environment(),
            capture_output=True, text=True, check=False, timeout=timeout_s,
        )  # fmt: skip

    @contextlib.contextmanager
    def served(self) -> Iterator[None]:
        """`humanmm serve` and a second worker, both supervised."""
        serve = [sys.executable, "-m", "humanmm.cli", "serve", "--limit", "2"]
        with contextlib.ExitStack() as stack:
            stack.callback(Supervised(serve, self.environment, self.folder / "serve.log", self.disk).stop)
            wait_for(lambda: list((self.disk / "cache").glob("prefect-*/serving")), 240)
            second = [sys.executable, "-m", "humanmm.flows.service.worker", "humanmm", "2", "second"]
            stack.callback(Supervised(second, self.worker_environment, self.folder / "second.log", self.disk).stop)
            yield

    # ---- what goes wrong

    def torment(self, seconds: float, *, fill: bool) -> None:
        """One fault after another, for so long; then wait until what has to be noticed is."""
        rng = random.Random(self.seed)
        kinds = [kind for kind in WEIGHTS if fill or kind != "full disk"]
        deadline = time.monotonic() + seconds
        over = threading.Event()
        watching = threading.Thread(target=self._watch, args=(over,))
        watching.start()
        while time.monotonic() < deadline:
            time.sleep(rng.uniform(*PAUSE_S))
            (kind,) = rng.choices(kinds, [WEIGHTS[kind] for kind in kinds])
            luck = rng.random()
            if kind == "flip":
                self._flip(luck)
            elif kind == "full disk":
                self._fill(FULL_S[0] + luck * (FULL_S[1] - FULL_S[0]))
            else:
                self._kill(kind, luck)
        over.set()
        watching.join()

    def pids(self, kind: str) -> list[int]:
        """Processes of this machine of one kind, in order."""
        found = []
        mark = f"HUMANMM_CACHE={self.disk / 'cache'}\0".encode()
        for process in Path("/proc").glob("[0-9]*"):
            with contextlib.suppress(OSError):
                line = (process / "cmdline").read_bytes().replace(b"\0", b" ").decode(errors="replace")
                name = (process / "comm").read_text().strip()
                line = name if name == VIDEO else line  # a fork has the command line of its fork server
                if PROCESSES[kind] in line and mark in (process / "environ").read_bytes():
                    found.append(int(process.name))
        return sorted(found)

    def _kill(self, kind: str, luck: float) -> None:
        pids = self.pids(kind)
        if not pids:
            return
        pid = pids[int(luck * len(pids))]
        with contextlib.suppress(OSError, ValueError):
            lost = {"video": [pid], "fork server": [video for video in self.pids("video") if _parent(video) == pid]}
            flow_runs = {video: run for video in lost.get(kind, ()) if (run := self.flow_run_of(video)) is not None}
            os.kill(pid, signal.SIGKILL)
            self.faults.append(Fault(kind, time.time(), str(pid), flow_runs))

    def _flip(self, luck: float) -> None:
        stores = [self.store] if self.bucket is None else list((self.disk / "cache/buckets").glob("*"))
        files = sorted(path for at in stores for path in at.glob("**/artifacts/*/??/*/**/*") if path.is_file())
        if not files:
            return
        path = files[int(luck * len(files))]
        with contextlib.suppress(OSError), path.open("r+b") as file:  # it may just be set aside
            at = int(luck * 1e6) % max(1, path.stat().st_size)
            file.seek(at)
            byte = file.read(1)
            file.seek(at)
            file.write(bytes([byte[0] ^ 0x40]) if byte else b"x")
            begin = path.parts.index("artifacts")
            self.faults.append(Fault("flip", time.time(), "/".join(path.parts[begin : begin + 4])))

    def _fill(self, seconds: float) -> None:
        filler = self.disk / "filler"
        with contextlib.suppress(OSError), filler.open("wb", buffering=0) as file:
            while True:  # to the last byte: ENOSPC ends it
                file.write(bytes(1 << 20))
        self.faults.append(Fault("full disk", time.time(), f"{seconds:.0f} s"))
        time.sleep(seconds)
        filler.unlink()

    def _watch(self, over: threading.Event) -> None:
        """Note when each loss was noticed: its flow runs left `Running`, and another such process is there."""
        deadline = float("inf")
        while not over.is_set() or (self.unnoticed() and time.monotonic() < deadline):
            if over.is_set():
                deadline = min(deadline, time.monotonic() + PATIENCE_S)
            time.sleep(0.5)
            for fault in self.unnoticed():
                if self._is_noticed(fault):
                    fault.noticed_s = time.time() - fault.at

    def _is_noticed(self, fault: Fault) -> bool:
        if fault.kind == "fork server":
            if time.time() - fault.at < SETTLED_S:
                return False
            gone = {pid: run for pid, run in fault.flow_runs.items() if not Path(f"/proc/{pid}").exists()}
        else:
            gone = fault.flow_runs
        if any(self.flow_run_state(run) in ("RUNNING", "PENDING", "CANCELLING", None) for run in gone.values()):
            return False
        others = [pid for pid in self.pids(fault.kind) if pid != int(fault.target)]
        return fault.kind in ("video", "fork server") or len(others) >= (2 if fault.kind == "worker" else 1)

    def unnoticed(self) -> list[Fault]:
        """Losses that nobody has noticed."""
        losses = ("video", "fork server", "worker", "server", "serve")
        return [fault for fault in self.faults if fault.kind in losses and fault.noticed_s is None]

    # ---- what has become of it

    def ask(self, query: str, *values: object) -> list[Any]:
        """Rows of Prefect's database."""
        import sqlite3

        (file,) = (self.disk / "cache").glob("prefect-*/prefect.db")
        with contextlib.closing(sqlite3.connect(f"file:{file}?mode=ro", uri=True, timeout=30)) as connection:
            return connection.execute(query, values).fetchall()

    def flow_run_of(self, video: int) -> str | None:
        """The flow run that a process computes; None if Prefect does not know the process yet."""
        with contextlib.suppress(Exception):
            query = "select id from flow_run where infrastructure_pid = ? order by created desc"
            return str(self.ask(query, str(video))[0][0])
        return None

    def flow_run_state(self, flow_run: str) -> str | None:
        """Prefect's state of a flow run; None if its database cannot tell now."""
        with contextlib.suppress(Exception):
            return str(self.ask("select state_type from flow_run where id = ?", flow_run)[0][0])
        return None

    def at_work(self) -> dict[str, int]:
        """How many flow runs and task runs Prefect calls neither ended nor scheduled for later."""
        states = "('RUNNING', 'PENDING', 'CANCELLING', 'SCHEDULED')"
        found = {}
        for table in ("flow_run", "task_run"):
            for state, count in self.ask(
                f"select state_type, count(*) from {table} where state_type in {states} group by state_type"
            ):
                found[f"{table} {state}"] = count
        return found

    def videos(self) -> list[dict[str, Any]]:
        """What `batch status --json` tells."""
        answer = self.humanmm("batch", "status", "--json")
        assert answer.returncode == 0, answer.stderr
        return list(json.loads(answer.stdout)["videos"])

    def executions(self) -> "Executions":
        """Every execution of a stage × unit, by how it ended."""
        events: dict[tuple[str, str], list[dict[str, Any]]] = {}
        for line in self.execution_log.read_text().splitlines():
            event = json.loads(line)
            events.setdefault((event["video"], event["unit"]), []).append(event)
        return Executions(events)


@dataclass(frozen=True)
class Executions:
    """Executions by video and unit, in the order in which they began and ended."""

    events: Mapping[tuple[str, str], list[dict[str, Any]]]

    def count(self) -> Counter[str]:
        """How many began, and how many of these were computed, cached, failed, or cut short."""
        total = Counter(event["event"] for events in self.events.values() for event in events)
        total["cut short"] = total["begun"] - total["computed"] - total["cached"] - total["failed"]
        total["units"] = len(self.events)
        return total

    def again(self) -> list[str]:
        """Why what had been computed, and so was in the store under its key, was computed once more."""
        found = []
        for (video, unit), events in self.events.items():
            known = set[str]()
            for event in events:
                if event["event"] == "computed":
                    found += [f"{video} {unit}: {event['reason']}"] if event["key"] in known else []
                    known.add(event["key"])
        return found

    def needless(self) -> list[str]:
        """What was computed again although its result was there, undamaged."""
        return [
            message
            for message in self.again()
            if "damaged artifact" not in message and "artifact is gone" not in message
        ]


def _parent(pid: int) -> int | None:
    with contextlib.suppress(OSError):
        return int(Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[1])
    return None


def wait_for(condition: Callable[[], object], limit_s: float) -> None:
    """Wait for something; the test fails if it takes longer."""
    deadline = time.monotonic() + limit_s
    while not condition():
        assert time.monotonic() < deadline, "it took too long"
        time.sleep(0.5)
