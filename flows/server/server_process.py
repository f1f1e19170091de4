"""The process of our Prefect server: `python -m humanmm.flows.server.server_process FOLDER`.

It listens on loopback alone, serves its own user alone, and refuses requests that a web page of another origin makes.
It ends by itself when no run has used it for a while.
"""

import contextlib
import fcntl
import itertools
import json
import logging
import os
import socket
import sqlite3
import struct
import sys
import threading
import time
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any

from humanmm.flows.server.local_server import (
    HOST,
    ServerFiles,
    bind,
    last_port,
    private_environment,
    quiet_environment,
)
from humanmm.storage.store.files import replace_text
from humanmm.tasks.units.process import release_memory, share_heaps

log = logging.getLogger(__name__)

IDLE_S = 900.0
"""The server ends after this many seconds without a run; $HUMANMM_SERVER_IDLE_S sets another value."""
DATABASE_CACHE_BYTES = 16 * 2**20
"""Of all connections together. Prefect lets each keep 80 MB of pages: the server grew with its database."""
HEAPS = 2
"""For all threads: each connection to the database is one."""
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
"""Settings of the server, where the environment sets no other value: its dashboard keeps up with batches; its database
keeps what ended in the last 30 days, and no events, which were four fifths of it and repeat what runs say; it does not
mark videos as late that only wait for room; and it looks for pauses, workers, schedules and automations every 30 to
60 s, not every 5 to 15: a fifth of what it costs while it has nothing to do."""

NETLINK_SOCK_DIAG, SOCK_DIAG_BY_FAMILY, TCP_ESTABLISHED = 4, 20, 1
_REQUEST = struct.Struct("=IHHII BBxxI")
"""nlmsghdr, then inet_diag_req_v2 up to its socket."""
_RESPONSE = struct.Struct("=IH10x xB2x 60x I")
"""nlmsghdr, then of inet_diag_msg the state and the user."""

App = Callable[[Any, Any, Callable[[Any], Awaitable[None]]], Awaitable[None]]


def serve(files: ServerFiles) -> None:
    """Run the server until nobody has used it for a while."""
    os.umask(0o077)  # what its database says of flow runs is for this user alone, wherever the file is copied to
    idle_s = float(os.environ.get("HUMANMM_SERVER_IDLE_S", IDLE_S))
    listener = bind(last_port(files)) or bind(0)
    assert listener is not None
    listener.listen()
    port = listener.getsockname()[1]
    if port != last_port(files):
        replace_text(files.port, str(port))
    quiet_environment()
    private_environment(files)
    os.environ.update(
        {
            **OWN_SETTINGS,
            **{name: os.environ[name] for name in OWN_SETTINGS if name in os.environ},
            "PREFECT_API_URL": f"http://{HOST}:{port}/api",
            "PREFECT_SERVER_API_HOST": HOST,
            "PREFECT_SERVER_API_PORT": str(port),
            "PREFECT_SERVER_CORS_ALLOWED_ORIGINS": origin_of(port),
            "PREFECT_SERVER_UI_STATIC_DIRECTORY": str(files.home / "ui"),
            "PREFECT_SERVER_CONCURRENCY_LEASE_STORAGE": "prefect.server.concurrency.lease_storage.filesystem",
            "PREFECT_LOGGING_SERVER_LEVEL": "WARNING",
        }
    )
    share_heaps(HEAPS)
    limit_database_cache(DATABASE_CACHE_BYTES)
    import uvicorn
    from prefect.server.api.server import create_app

    app = retried_soon(for_own_pages(create_app(), port))
    is_private = _knows_users(listener)
    http_protocol = _own_user_protocol() if is_private else "auto"
    config = uvicorn.Config(app, http=http_protocol, log_level="warning", timeout_graceful_shutdown=5)
    server = uvicorn.Server(config)
    state = {"url": f"http://{HOST}:{port}/api", "port": port, "pid": os.getpid(), "private": is_private}
    replace_text(files.state, json.dumps(state))
    threading.Thread(target=_stop_when_idle, args=(server, files, port, idle_s), daemon=True).start()
    server.run(sockets=[listener])


def limit_database_cache(size: int) -> None:
    """Have SQLite keep about `size` bytes in memory, over all connections of the process that are or will be there."""
    with contextlib.closing(sqlite3.connect(":memory:")) as database:
        database.execute(f"PRAGMA soft_heap_limit = {size:d}")


# ---- whose requests are served


def origin_of(port: int) -> str:
    """The origin of our own pages. Not `localhost`: browsers ask ::1 for it first, where another user may listen."""
    return f"http://{HOST}:{port}"


def for_own_pages(app: App, port: int) -> App:
    """The same server, for requests that name it as their host and come from no page but its own.

    A web page of another origin cannot start flows by a simple POST then, nor read anything through a name of its own
    that it has the browser resolve to 127.0.0.1 (DNS rebinding), nor show our pages in a frame of its own for the user
    to click on. Browsers name the page in `Origin`, and what is requested without one in `Sec-Fetch-Site`; a link that
    the user follows may come from anywhere.
    """
    from starlette.datastructures import Headers
    from starlette.middleware.trustedhost import TrustedHostMiddleware
    from starlette.responses import PlainTextResponse

    own = origin_of(port)

    def is_own(scope: Any) -> bool:
        headers = Headers(scope=scope)
        is_link = scope.get("method") == "GET" and headers.get("sec-fetch-dest") == "document"
        is_near = headers.get("sec-fetch-site", "none") in ("none", "same-origin")
        return set(headers.getlist("origin")) <= {own} and (is_link or is_near)

    async def check_origin(scope: Any, receive: Any, send: Callable[[Any], Awaitable[None]]) -> None:
        if scope["type"] in ("http", "websocket") and not is_own(scope):
            await PlainTextResponse("a page of another origin may not use this server", 403)(scope, receive, send)
        else:
            await app(scope, receive, send)

    return TrustedHostMiddleware(check_origin, allowed_hosts=[HOST], www_redirect=False)


def _knows_users(listener: socket.socket) -> bool:
    """Whether the kernel names the user of a connection. Some sandboxes do not; `humanmm doctor` says so."""
    with socket.create_connection(listener.getsockname()) as probe:
        return user_of(probe.getsockname(), listener.getsockname()) == os.getuid()


def _own_user_protocol() -> type[Any]:
    from uvicorn.protocols.http.auto import AutoHTTPProtocol

    class OwnUserProtocol(AutoHTTPProtocol):  # type: ignore[misc, valid-type]
        """HTTP for processes of this process's user and of root; connections of other users are closed."""

        def connection_made(self, transport: Any) -> None:
            super().connection_made(transport)
            user = user_of(transport.get_extra_info("peername"), transport.get_extra_info("sockname"))
            if user not in (os.getuid(), 0):
                log.warning("a connection of user %s was refused", user)
                transport.abort()

    return OwnUserProtocol


def user_of(client: tuple[str, int], server: tuple[str, int]) -> int | None:
    """The user whose process holds the client's end of a TCP connection over loopback; None if the kernel names none.

    One request of sock_diag(7), which Linux alone has. A closed end is listed under root, so only an established one
    counts.
    """
    if sys.platform != "linux":
        return None
    ports = struct.pack("!HH", client[1], server[1])
    addresses = b"".join(socket.inet_aton(host).ljust(16, b"\0") for host, _ in (client, server))
    length = _REQUEST.size + 48
    head = _REQUEST.pack(length, SOCK_DIAG_BY_FAMILY, 1, 0, 0, socket.AF_INET, socket.IPPROTO_TCP, 0xFFFFFFFF)
    with contextlib.suppress(OSError), socket.socket(socket.AF_NETLINK, socket.SOCK_RAW, NETLINK_SOCK_DIAG) as kernel:
        kernel.sendto(head + ports + addresses + b"\0" * 4 + b"\xff" * 8, (0, 0))  # any interface, any cookie
        response = kernel.recv(4096)
        _, kind, state, user = _RESPONSE.unpack_from(response.ljust(_RESPONSE.size, b"\0"))
        if kind == SOCK_DIAG_BY_FAMILY and state == TCP_ESTABLISHED:
            return int(user)
    return None


def retried_soon(app: App) -> App:
    """The same server, with a header on its refusals that says when to retry.

    SQLite refuses one of two transactions that write at the same time; Prefect responds with status 503, and its client
    retries after 2, 4, 8, 16 and 32 s, which no setting of the client shortens: a worker, a video or `batch submit` can
    stand still for a minute.
    """

    async def respond(scope: Any, receive: Any, send: Callable[[Any], Awaitable[None]]) -> None:
        async def send_with_header(message: Any) -> None:
            if message["type"] == "http.response.start" and message["status"] == 503:
                message = {**message, "headers": [*message["headers"], (b"retry-after", RETRY_AFTER_S)]}
            await send(message)

        await app(scope, receive, send_with_header)

    return respond


# ---- its end


def _stop_when_idle(server: Any, files: ServerFiles, port: int, idle_s: float) -> None:
    """Stop the server once nobody holds `users` and nobody has for `idle_s`, or once its folder is gone.

    Meanwhile end the flow runs whose process is gone and, a quarter as often, tasks whose end never arrived; and give
    the system back what requests have left free in pieces, a third of the heap after 50 videos.
    """
    from prefect import get_client

    from humanmm.flows.server.liveness import end_lost_flow_runs, end_lost_tasks

    started = time.time()
    client = get_client(sync_client=True)
    for look in itertools.count(1):
        time.sleep(min(15.0, max(0.2, idle_s / 4)))
        try:
            end_lost_flow_runs(client, pool=None)
            if look % 4 == 0:
                release_memory()
                end_lost_tasks(client)
        except Exception as error:  # it may still be starting, or a store cannot be read: the next look will do
            log.info("a look after lost flow runs was cut short: %s", error)
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
            break  # `users` stays locked until this process ends, so that no run can meet a server that is ending
        users.close()
    server.should_exit = True


if __name__ == "__main__":
    serve(ServerFiles(Path(sys.argv[1])))
