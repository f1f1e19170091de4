"""Finds our Prefect server on loopback, and starts it when it is needed; all runs of a user share it.

Starting a server for every run costs about ten seconds, a request to a running one next to nothing. So one runs in the
background: found through a small file, ending by itself when no run has used it for a while. Runs hold a shared flock
while they use it, which the kernel frees when a run is killed.

Nothing here imports Prefect before its settings, which come from environment variables, are set.
"""

import atexit
import contextlib
import fcntl
import http.client
import importlib.metadata
import json
import logging
import os
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from humanmm.errors import ConfigError, ResourceError
from humanmm.machine import command_line, is_alive
from humanmm.storage.store.store import cache_folder

log = logging.getLogger(__name__)

START_LIMIT_S = 600.0
"""A first start creates the database, which takes up to 25 s on a busy machine, and minutes where ten processes share a
core."""
SLOW_LIMIT_S = 90.0
"""Seconds to wait for a response of a server that lives: SQLite waits for a lock for up to 60 s."""
START_PAUSE_S = 2.0
"""Seconds before another server is started in place of one that ended before it responded."""
HOST = "127.0.0.1"
CLIENT_SETTINGS = {
    "PREFECT_API_REQUEST_TIMEOUT": str(int(SLOW_LIMIT_S) + 30),
    "PREFECT_CLIENT_CSRF_SUPPORT_ENABLED": "false",
}
"""Settings of the clients of our server. They wait for a response longer than until another server takes the place of
this one: what Prefect gives up to send, such as the states of tasks, is lost. They request no CSRF token, which costs a
request: our server checks the origin instead."""


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
        """Held shared by every run; the server ends only when it can have it alone."""
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
    """Where our server lives: a folder that its user alone can open, in the cache folder or, where that cannot be
    written, in the temporary folder."""
    name = f"prefect-{importlib.metadata.version('prefect')}"
    for base in (cache_folder(), Path(tempfile.gettempdir()) / f"humanmm-{os.getuid()}"):
        with contextlib.suppress(OSError):
            base.mkdir(parents=True, exist_ok=True, mode=0o700)
            (base / name).mkdir(exist_ok=True, mode=0o700)
            (base / name).chmod(0o700)
            if base.stat().st_uid == os.getuid() and os.access(base / name, os.W_OK):
                return ServerFiles(base / name)
    raise OSError("neither the cache folder nor the temporary folder can be written")


# ---- for whoever uses it


@contextlib.contextmanager
def prefect_server(is_wanted: Callable[[], bool] = lambda: True) -> Iterator[str]:
    """Environment for Prefect and the address of a server, held for the duration of a run.

    A server that is not up yet when it is no longer wanted is ended, and not waited for: the address is empty then.
    ResourceError if none can be started: the one that Prefect would bring along in its place, on a port of its own,
    serves every user and every web page.

    $PREFECT_API_URL, if set, names the user's own server and is left alone. Must be entered before `import prefect`.
    ConfigError if Prefect refuses a PREFECT_ variable.
    """
    is_set_up = any(name.startswith("PREFECT_") for name in os.environ)
    quiet_environment()
    own = os.environ.get("PREFECT_API_URL")
    files = server_files()
    if not own:
        private_environment(files)
    if is_set_up:
        check_settings()
    if own:
        yield own
        return
    with files.users.open("a+") as users:
        fcntl.flock(users, fcntl.LOCK_SH)
        url = running_server(files) or _start(files, is_wanted)
        if url:
            os.environ["PREFECT_API_URL"] = url
        elif is_wanted():
            raise ResourceError(f"no Prefect server could be started within {START_LIMIT_S:g} s; {files.log} says why")
        if "prefect.context" in sys.modules:
            sys.modules["prefect.context"].refresh_global_settings_context()
        try:
            yield url or ""
        finally:
            os.utime(users.fileno())
            os.environ.pop("PREFECT_API_URL", None)


def check_settings() -> None:
    """ConfigError that names the PREFECT_ variable whose value Prefect refuses: no server could start with it."""
    from prefect.settings import Settings
    from pydantic import ValidationError

    try:
        Settings()
    except ValidationError as error:
        wrong = error.errors()[0]
        names = [name for name, value in os.environ.items() if name.startswith("PREFECT_") and value == wrong["input"]]
        name = " or ".join(names) or f"a PREFECT_ variable ({wrong['loc'][-1]})"
        raise ConfigError(f"{name} = {wrong['input']!r}: {wrong['msg']}") from None


def quiet_environment() -> None:
    """No telemetry; console logs are ours; loopback never goes through a proxy."""
    os.environ["DO_NOT_TRACK"] = "1"
    os.environ["PREFECT_SERVER_ANALYTICS_ENABLED"] = "false"
    os.environ.setdefault("PREFECT_LOGGING_HANDLERS_CONSOLE_LEVEL", "CRITICAL")
    for name in ("NO_PROXY", "no_proxy"):
        known = [one for one in os.environ.get(name, "").split(",") if one]
        os.environ[name] = ",".join(dict.fromkeys([*known, HOST, "localhost"]))


def private_environment(files: ServerFiles) -> None:
    """Prefect's files are ours; a profile, key or database of the user's is not used."""
    for name in ("PREFECT_PROFILE", "PREFECT_API_KEY", "PREFECT_API_DATABASE_CONNECTION_URL"):
        os.environ.pop(name, None)
    os.environ["PREFECT_HOME"] = str(files.home)
    os.environ["PREFECT_PROFILES_PATH"] = str(files.home / "profiles.toml")
    os.environ["PREFECT_SERVER_ALLOW_EPHEMERAL_MODE"] = "false"
    os.environ.update(CLIENT_SETTINGS)


def ensure_server(files: ServerFiles) -> str | None:
    """Address of our server, started again if it has died; of the user's own server, if that is what is used."""
    used = os.environ.get("PREFECT_API_URL", "")
    if used and not is_ours(used, files):
        return used
    return running_server(files) or _start(files)


def is_ours(url: str, files: ServerFiles) -> bool:
    """Whether an address is that of our server, and not of the user's own."""
    return url.rstrip("/") == f"http://{HOST}:{last_port(files)}/api"


def running_server(files: ServerFiles) -> str | None:
    """Address of the server if it responds."""
    try:
        state = json.loads(files.state.read_text())
        url, port = str(state["url"]), int(state["port"])
    except (OSError, ValueError, KeyError, TypeError):
        return None
    return url if hold_port(port) and _is_healthy(port) else None


def serves_its_user_alone(files: ServerFiles) -> bool:
    """Whether the running server refuses other users: not where the kernel does not name the user of a connection."""
    try:
        return bool(json.loads(files.state.read_text())["private"])
    except (OSError, ValueError, KeyError, TypeError):
        return False


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
        while time.monotonic() < deadline and is_alive(pid):
            time.sleep(0.05)
        return True
    return False


# ---- its port

_held: dict[int, socket.socket] = {}


def hold_port(port: int) -> bool:
    """Keep the server's port from processes of other users for as long as this process lives; False if one has it.

    A socket that is bound beside the server's own and never listens. Linux lets only processes of one user share a
    port by SO_REUSEPORT (socket(7)), so whatever listens there is this user's, also after our server has died. On other
    systems nothing is held: BSD and macOS may hand connections to the socket that was bound last, which would be this.
    """
    if sys.platform != "linux":
        return True
    if port not in _held and (holder := bind(port)) is not None:
        _held[port] = holder
        atexit.register(holder.close)
    return port in _held


def hold_port_of_server() -> None:
    """The same for the local server that $PREFECT_API_URL names, if it names one."""
    host, _, port = os.environ.get("PREFECT_API_URL", "").removeprefix("http://").removesuffix("/api").partition(":")
    if host == HOST and port.isdecimal():
        hold_port(int(port))


def bind(port: int) -> socket.socket | None:
    """A socket bound to a port on loopback, shared with this user's processes alone; None if another user has it.

    Without SO_REUSEADDR, which another user's process could share while nobody listens.
    """
    bound = socket.socket()
    bound.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEPORT, 1)
    try:
        bound.bind((HOST, port))
    except OSError:
        bound.close()
        return None
    return bound


def last_port(files: ServerFiles) -> int:
    """The port of the last server; 0 if there was none."""
    try:
        return int(files.port.read_text())
    except (OSError, ValueError):
        return 0


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


# ---- its start


def _start(files: ServerFiles, is_wanted: Callable[[], bool] = lambda: True) -> str | None:
    """Start the server unless another run is doing so; wait until it responds. One that was started here and is not up
    yet is ended when it is no longer wanted, or when an exception such as Ctrl-C ends the waiting."""
    with files.starting.open("a+") as starting:
        fcntl.flock(starting, fcntl.LOCK_EX)
        url = running_server(files) or _slow_server(files)
        if url:
            return url
        files.state.unlink(missing_ok=True)
        pid, deadline = None, time.monotonic() + START_LIMIT_S
        is_given_up = True
        try:
            while is_wanted():
                if pid is None or not is_alive(pid):
                    if pid is not None:  # it was killed, or could not write its files
                        time.sleep(START_PAUSE_S)
                    log.info("starting the local Prefect server")
                    pid = _start_process(files)
                url = running_server(files)
                if url or time.monotonic() > deadline:
                    is_given_up = False
                    return url
                time.sleep(0.1)
        finally:
            if is_given_up and pid is not None and is_alive(pid):
                os.kill(pid, signal.SIGKILL)  # it is importing, and would end by SIGTERM with a traceback
    return None


def _slow_server(files: ServerFiles) -> str | None:
    """Address of a server that lives and responds after a while, as on a busy machine: a second one beside it would
    have another address. One that does not respond is killed."""
    deadline = time.monotonic() + SLOW_LIMIT_S
    with contextlib.suppress(OSError, ValueError, KeyError):
        pid = int(json.loads(files.state.read_text())["pid"])
        while is_alive(pid) and os.fsencode(files.home) in command_line(pid):
            url = running_server(files)
            if url:
                return url
            if time.monotonic() > deadline:
                log.warning("the Prefect server has not responded for %g s; it is killed", SLOW_LIMIT_S)
                os.kill(pid, signal.SIGKILL)
                break
            time.sleep(0.5)
    return None


def _start_process(files: ServerFiles) -> int:
    command = [sys.executable, "-m", "humanmm.flows.server.server_process", str(files.home)]
    return start_alone(command, files.log, Path("/"))


def start_alone(command: Sequence[str], log_file: Path, folder: Path) -> int:
    """Start a command that is nobody's child and outlives this process, through a shell that ends at once.

    It runs in `folder`; what it prints is appended to `log_file`. Returns the number of its process.
    """
    with log_file.open("ab") as output:
        begun = subprocess.run(
            ["/bin/sh", "-c", '"$@" >&2 & echo $!', "sh", *command],
            stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=output,
            start_new_session=True, check=True, cwd=folder,
        )  # fmt: skip
    return int(begun.stdout)
