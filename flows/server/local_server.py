"""A Prefect server of our own on loopback, started when first needed and shared by all runs until nobody needs it.

Starting a server for every run costs about ten seconds, asking a running one next to nothing. So one runs in the
background: started on demand, found through a small file, leaving by itself when no run has held it for a while. Runs
hold a shared flock while they use it, which the kernel frees when a run is killed.

Nothing here imports Prefect: its settings come from environment variables that must be set before.
"""

import contextlib
import fcntl
import http.client
import importlib.metadata
import itertools
import json
import logging
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Awaitable, Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from humanmm.flows.server.liveness import crash_lost, end_lost_tasks
from humanmm.storage.store.store import cache_folder

log = logging.getLogger(__name__)

IDLE_S = 900.0
"""The server leaves after this many seconds without a run; $HUMANMM_SERVER_IDLE_S sets another value."""
START_LIMIT_S = 180.0
"""A first start creates the database, which takes up to 25 s on a busy machine."""
SLOW_LIMIT_S = 90.0
"""How long a server that lives may owe an answer: SQLite waits for a lock for up to 60 s."""
START_PAUSE_S = 2.0
"""Before another server is started in place of one that has ended before it answered."""
HOST = "127.0.0.1"
RETRY_AFTER_S = b"0.5"
OWN_SETTINGS = {
    "PREFECT_SERVER_SERVICES_TASK_RUN_RECORDER_BATCH_SIZE": "100",
    "PREFECT_SERVER_SERVICES_TASK_RUN_RECORDER_READ_BATCH_SIZE": "100",
    "PREFECT_SERVER_SERVICES_EVENT_PERSISTER_ENABLED": "false",
    "PREFECT_SERVER_SERVICES_DB_VACUUM_ENABLED": "events,flow_runs",
    "PREFECT_SERVER_SERVICES_DB_VACUUM_RETENTION_PERIOD": str(30 * 86400),
    "PREFECT_SERVER_SERVICES_LATE_RUNS_ENABLED": "false",
    "PREFECT_SERVER_SERVICES_PAUSE_EXPIRATIONS_LOOP_SECONDS": "60",
    "PREFECT_SERVER_SERVICES_FOREMAN_LOOP_SECONDS": "30",
    "PREFECT_SERVER_SERVICES_SCHEDULER_RECENT_DEPLOYMENTS_LOOP_SECONDS": "30",
    "PREFECT_SERVER_EVENTS_PROACTIVE_GRANULARITY": "PT30S",
}
"""Of the server, where the environment sets no other value: a dashboard that keeps up with batches; a database that
keeps what ended in the last 30 days, and no events, which were four fifths of it and say nothing that runs do not; no
videos that are called late, at a question and an answer each, when they only wait for their turn. What it looks for by
itself every 5 to 15 seconds (pauses, workers, new schedules, automations), it looks for less often: a fifth of what it
costs while it has nothing to do."""


CLIENT_SETTINGS = {
    "PREFECT_API_REQUEST_TIMEOUT": str(int(SLOW_LIMIT_S) + 30),
    "PREFECT_CLIENT_CSRF_SUPPORT_ENABLED": "false",
}
"""Of whoever asks our server. To wait for an answer longer than until another server takes the place of this one: what
Prefect gives up to tell, such as the states of tasks, is lost. Not to ask for a token first: ours gives none."""


@dataclass(frozen=True)
class ServerFiles:
    """Everything the server leaves on disk, in one folder per Prefect version (each has its own database schema)."""

    home: Path

    @property
    def state(self) -> Path:
        """Address and process of the running server."""
        return self.home / "server.json"

    @property
    def users(self) -> Path:
        """Held shared by every run; the server leaves only when it can have it alone."""
        return self.home / "users.lock"

    @property
    def starting(self) -> Path:
        """Held by the one run that starts the server."""
        return self.home / "starting.lock"

    @property
    def port(self) -> Path:
        """The port of the last server: the next one takes it again, so that the dashboard keeps its address."""
        return self.home / "port"

    @property
    def log(self) -> Path:
        return self.home / "server.log"

    @property
    def stores(self) -> Path:
        """The stores whose batches were scheduled here, one a line."""
        return self.home / "stores"


def server_files() -> ServerFiles:
    """Where our server lives: the cache folder, or a private temporary folder where that cannot be written."""
    name = f"prefect-{importlib.metadata.version('prefect')}"
    for base in (cache_folder(), Path(tempfile.gettempdir()) / f"humanmm-{os.getuid()}"):
        with contextlib.suppress(OSError):
            (base / name).mkdir(parents=True, exist_ok=True, mode=0o700)
            if os.access(base / name, os.W_OK):
                return ServerFiles(base / name)
    raise OSError("neither the cache folder nor the temporary folder can be written")


@contextlib.contextmanager
def prefect_server() -> Iterator[str]:
    """Environment for Prefect and an address to talk to, held for the duration of a run.

    $PREFECT_API_URL, if set, names the user's own server and is left alone. Must be entered before `import prefect`.
    """
    _quiet_environment()
    own = os.environ.get("PREFECT_API_URL")
    if own:
        yield own
        return
    files = server_files()
    _private_environment(files)
    with files.users.open("a+") as users:
        fcntl.flock(users, fcntl.LOCK_SH)
        url = running_server(files) or _start(files)
        if url:
            os.environ["PREFECT_API_URL"] = url
        else:
            log.warning("no Prefect server could be started (see %s); this run brings its own: slower", files.log)
            os.environ["PREFECT_SERVER_ALLOW_EPHEMERAL_MODE"] = "true"
        try:
            yield url or "ephemeral"
        finally:
            os.utime(users.fileno())
            os.environ.pop("PREFECT_API_URL", None)


def _quiet_environment() -> None:
    """No telemetry; console logs are ours; loopback never goes through a proxy."""
    os.environ["DO_NOT_TRACK"] = "1"
    os.environ["PREFECT_SERVER_ANALYTICS_ENABLED"] = "false"
    os.environ.setdefault("PREFECT_LOGGING_HANDLERS_CONSOLE_LEVEL", "CRITICAL")
    for name in ("NO_PROXY", "no_proxy"):
        os.environ[name] = ",".join(filter(None, [os.environ.get(name), HOST, "localhost"]))


def _private_environment(files: ServerFiles) -> None:
    for name in ("PREFECT_PROFILE", "PREFECT_API_KEY", "PREFECT_API_DATABASE_CONNECTION_URL"):
        os.environ.pop(name, None)
    os.environ["PREFECT_HOME"] = str(files.home)
    os.environ["PREFECT_PROFILES_PATH"] = str(files.home / "profiles.toml")
    os.environ.update(CLIENT_SETTINGS)


def running_server(files: ServerFiles) -> str | None:
    """Address of the server if it answers."""
    try:
        state = json.loads(files.state.read_text())
        url, port = str(state["url"]), int(state["port"])
    except (OSError, ValueError, KeyError, TypeError):
        return None
    return url if _is_healthy(port) else None


def _is_healthy(port: int) -> bool:
    connection = http.client.HTTPConnection(HOST, port, timeout=5)
    try:
        connection.request("GET", "/api/health")
        response = connection.getresponse()
        return response.status == 200 and response.read().strip() == b"true"
    except (OSError, http.client.HTTPException):
        return False
    finally:
        connection.close()


def ensure_server(files: ServerFiles) -> str | None:
    """Address of our server, started again if it has died; of the user's own server, if that is what is used."""
    used = os.environ.get("PREFECT_API_URL", "")
    ours = _last_port(files)
    if used and used != f"http://{HOST}:{ours}/api":
        return used
    return running_server(files) or _start(files)


def stop_unused_server(files: ServerFiles) -> bool:
    """End our server now if no run holds it; says whether it was ended."""
    with files.users.open("a+") as users, contextlib.suppress(OSError, ValueError, KeyError):
        fcntl.flock(users, fcntl.LOCK_EX | fcntl.LOCK_NB)
        pid = int(json.loads(files.state.read_text())["pid"])
        if running_server(files) is None:
            return False
        files.state.unlink()
        os.kill(pid, signal.SIGTERM)
        deadline = time.monotonic() + 20
        while time.monotonic() < deadline and Path(f"/proc/{pid}").exists():
            time.sleep(0.05)
        return True
    return False


def _start(files: ServerFiles) -> str | None:
    """Start the server unless another run is doing so; wait until it answers."""
    with files.starting.open("a+") as starting:
        fcntl.flock(starting, fcntl.LOCK_EX)
        url = running_server(files) or _slow_server(files)
        if url:
            return url
        files.state.unlink(missing_ok=True)
        pid, deadline = None, time.monotonic() + START_LIMIT_S
        while time.monotonic() < deadline:
            if pid is None or not _is_alive(pid):
                if pid is not None:  # it was killed, or could not write its files
                    time.sleep(START_PAUSE_S)
                log.info("starting the local Prefect server")
                pid = _start_process(files)
            url = running_server(files)
            if url:
                return url
            time.sleep(0.1)
    return None


def _slow_server(files: ServerFiles) -> str | None:
    """Address of a server that lives and answers after a while, as on a busy machine: a second one beside it would have
    another address. One that does not is ended."""
    deadline = time.monotonic() + SLOW_LIMIT_S
    with contextlib.suppress(OSError, ValueError, KeyError):
        pid = int(json.loads(files.state.read_text())["pid"])
        while _is_alive(pid) and os.fsencode(files.home) in Path(f"/proc/{pid}/cmdline").read_bytes():
            url = running_server(files)
            if url:
                return url
            if time.monotonic() > deadline:
                log.warning("the Prefect server has not answered for %g s; it is ended", SLOW_LIMIT_S)
                os.kill(pid, signal.SIGKILL)
                break
            time.sleep(0.5)
    return None


def _start_process(files: ServerFiles) -> int:
    """Begin a server that is nobody's child and outlives this run, through a shell that leaves at once; its process."""
    command = [sys.executable, "-m", "humanmm.flows.server.local_server", str(files.home)]
    with files.log.open("ab") as log_file:
        begun = subprocess.run(
            ["/bin/sh", "-c", '"$@" >&2 & echo $!', "sh", *command],
            stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=log_file,
            start_new_session=True, check=True, cwd="/",
        )  # fmt: skip
    return int(begun.stdout)


def _is_alive(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] not in "ZX"
    except OSError:
        return False


def _replace(path: Path, text: str) -> None:
    """Write a small file at once: on a full disk the one before stays."""
    fresh = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        fresh.write_text(text)
        fresh.replace(path)
    finally:
        fresh.unlink(missing_ok=True)


def _last_port(files: ServerFiles) -> int:
    try:
        return int(files.port.read_text())
    except (OSError, ValueError):
        return 0


def serve(files: ServerFiles) -> None:
    """Run the server until nobody has used it for a while."""
    import socket
    import threading

    idle_s = float(os.environ.get("HUMANMM_SERVER_IDLE_S", IDLE_S))
    try:
        listener = socket.create_server((HOST, _last_port(files)))
    except OSError:  # somebody else has it now
        listener = socket.create_server((HOST, 0))
    port = listener.getsockname()[1]
    if port != _last_port(files):
        _replace(files.port, str(port))
    _quiet_environment()
    _private_environment(files)
    os.environ.update(
        {
            **OWN_SETTINGS,
            **{name: os.environ[name] for name in OWN_SETTINGS if name in os.environ},
            "PREFECT_API_URL": f"http://{HOST}:{port}/api",
            "PREFECT_SERVER_API_HOST": HOST,
            "PREFECT_SERVER_API_PORT": str(port),
            "PREFECT_SERVER_UI_STATIC_DIRECTORY": str(files.home / "ui"),
            "PREFECT_SERVER_CONCURRENCY_LEASE_STORAGE": "prefect.server.concurrency.lease_storage.filesystem",
            "PREFECT_LOGGING_SERVER_LEVEL": "WARNING",
        }
    )
    import uvicorn
    from prefect.server.api.server import create_app

    app = _asked_again_soon(create_app())
    server = uvicorn.Server(uvicorn.Config(app, log_level="warning", timeout_graceful_shutdown=5))
    state = {"url": f"http://{HOST}:{port}/api", "port": port, "pid": os.getpid(), "started": time.time()}
    _replace(files.state, json.dumps(state))
    watcher = threading.Thread(target=_leave_when_idle, args=(server, files, port, idle_s), daemon=True)
    watcher.start()
    server.run(sockets=[listener])


def _asked_again_soon(app: Callable[..., Awaitable[None]]) -> Callable[..., Awaitable[None]]:
    """The same server, telling whoever was refused when to ask again.

    SQLite refuses one of two requests that write at the same time; Prefect answers 503, and its client asks again after
    2, 4, 8, 16 and 32 s: a minute in which a worker, a video or `batch submit` stands still.
    """

    async def answer(scope: Any, receive: Any, send: Callable[[Any], Awaitable[None]]) -> None:
        async def tell(message: Any) -> None:
            if message["type"] == "http.response.start" and message["status"] == 503:
                message = {**message, "headers": [*message["headers"], (b"retry-after", RETRY_AFTER_S)]}
            await send(message)

        await app(scope, receive, tell)

    return answer


def _leave_when_idle(server: object, files: ServerFiles, port: int, idle_s: float) -> None:
    """Stop the server once nobody holds `users` and nobody has for `idle_s`, or once its folder is gone.

    Meanwhile end the flow runs whose process is lost and, four times as seldom, tasks whose end was never told.
    """
    started = time.time()
    for look in itertools.count(1):
        time.sleep(min(15.0, max(0.2, idle_s / 4)))
        with contextlib.suppress(OSError, http.client.HTTPException, ValueError):  # not up yet: the next look will tell
            crash_lost(files.home, HOST, port)
            if look % 4 == 0:
                end_lost_tasks(HOST, port)
        try:
            users = files.users.open("a+")
        except OSError:
            break
        try:
            fcntl.flock(users, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            users.close()
            continue
        last_use = max(started, os.fstat(users.fileno()).st_mtime)
        if time.time() - last_use > idle_s:
            with contextlib.suppress(OSError, ValueError, KeyError):
                if json.loads(files.state.read_text())["port"] == port:
                    files.state.unlink()
            break  # `users` stays locked until this process ends, so that no run can meet a server that is leaving
        users.close()
    server.should_exit = True  # type: ignore[attr-defined]


if __name__ == "__main__":
    serve(ServerFiles(Path(sys.argv[1])))
