"""Whose requests our server serves: those of its own user, sent to its own name, by no page but its own."""

import asyncio
import contextlib
import http.client
import os
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from prefect.client.base import _parse_retry_after

from humanmm.flows.server import local_server
from humanmm.flows.server.server_process import for_own_pages, retried_soon, user_of

PORT = 4321
NOBODY = 65534


def status_of(headers: dict[str, str], *, kind: str = "http", method: str = "GET") -> int:
    """The status that a request with some headers gets, from a server whose app serves everything that reaches it."""
    sent: list[Any] = []

    async def app(scope: Any, receive: Any, send: Any) -> None:
        await send({"type": "http.response.start", "status": 200, "headers": []})

    async def send(message: Any) -> None:
        sent.append(message)

    scope = {
        "type": kind, "method": method, "path": "/api/flow_runs", "extensions": {"websocket.http.response": {}},
        "headers": [(name.encode(), value.encode()) for name, value in headers.items()],
    }  # fmt: skip
    asyncio.run(for_own_pages(app, PORT)(scope, None, send))
    return int(sent[0]["status"])


@pytest.mark.parametrize("kind", ["http", "websocket"])
@pytest.mark.parametrize("origin", [None, f"http://127.0.0.1:{PORT}"])
def test_our_clients_and_our_own_pages_are_served(kind: str, origin: str | None) -> None:
    headers = {} if origin is None else {"origin": origin}
    assert status_of({"host": f"127.0.0.1:{PORT}", **headers}, kind=kind, method="POST") == 200


@pytest.mark.parametrize("kind", ["http", "websocket"])
@pytest.mark.parametrize(
    "origin",
    ["http://evil.example", f"http://localhost:{PORT}", "http://127.0.0.1:80", "null", f"https://127.0.0.1:{PORT}"],
)
def test_a_page_of_another_origin_is_refused(kind: str, origin: str) -> None:
    for method in ("GET", "POST", "OPTIONS"):
        assert status_of({"host": f"127.0.0.1:{PORT}", "origin": origin}, kind=kind, method=method) == 403


@pytest.mark.parametrize("site", ["cross-site", "same-site"])
def test_what_a_page_of_another_origin_embeds_is_refused_and_a_link_to_the_dashboard_is_not(site: str) -> None:
    headers = {"host": f"127.0.0.1:{PORT}", "sec-fetch-site": site}
    for shown_as in ("iframe", "image", "script", "empty", "object"):
        assert status_of({**headers, "sec-fetch-dest": shown_as}) == 403
    assert status_of({**headers, "sec-fetch-dest": "document"}) == 200
    assert status_of({**headers, "sec-fetch-dest": "document"}, method="POST") == 403, "a form"
    for own in ("same-origin", "none"):
        assert status_of({**headers, "sec-fetch-site": own, "sec-fetch-dest": "empty"}, method="POST") == 200


@pytest.mark.parametrize("kind", ["http", "websocket"])
@pytest.mark.parametrize(
    "host", ["evil.example", f"evil.example:{PORT}", f"localhost:{PORT}", f"[::1]:{PORT}", "127.0.0.1.evil.example", ""]
)
def test_another_name_that_leads_to_us_is_refused(kind: str, host: str) -> None:
    assert status_of({"host": host}, kind=kind) == 400


def test_a_refusal_by_the_database_says_that_it_is_to_be_retried_soon() -> None:
    def headers_of(status: int) -> list[Any]:
        sent: list[Any] = []

        async def app(scope: Any, receive: Any, send: Any) -> None:
            await send({"type": "http.response.start", "status": status, "headers": [(b"a", b"b")]})
            await send({"type": "http.response.body", "body": b""})

        async def send(message: Any) -> None:
            sent.append(message)

        asyncio.run(retried_soon(app)({"type": "http"}, None, send))
        assert sent[1] == {"type": "http.response.body", "body": b""}
        return list(sent[0]["headers"])

    assert headers_of(200) == [(b"a", b"b")]
    ((_, retry_after),) = headers_of(503)[1:]
    assert 0 < (_parse_retry_after(retry_after.decode()) or 0) < 2, "what Prefect's client waits without the header"


# ---- other users


def _as_nobody(act: Callable[[], object]) -> bool:
    """Whether something succeeds in a process of another user."""
    child = os.fork()
    if child == 0:
        status = 1
        try:
            os.setuid(NOBODY)
            act()
            status = 0
        finally:
            os._exit(status)
    return os.waitpid(child, 0)[1] == 0


root = pytest.mark.skipif(os.getuid() != 0, reason="only root can start a process of another user")


@pytest.fixture
def listener() -> Iterator[socket.socket]:
    found = local_server.bind(0)
    assert found is not None
    with found:
        found.listen()
        yield found


def _connect(listener: socket.socket, family: int = socket.AF_INET) -> socket.socket:
    client = socket.socket(family)
    port = listener.getsockname()[1]
    client.connect(("127.0.0.1", port) if family == socket.AF_INET else ("::ffff:127.0.0.1", port))
    return client


@pytest.mark.parametrize("family", [socket.AF_INET, socket.AF_INET6])
def test_the_user_of_a_connection_is_known(listener: socket.socket, family: int) -> None:
    with _connect(listener, family):
        accepted, client = listener.accept()
        with accepted:
            assert user_of(client, listener.getsockname()) == os.getuid()
    assert user_of(client, listener.getsockname()) is None, "a closed end would be listed under root"
    assert user_of(("127.0.0.1", 1), ("127.0.0.1", 2)) is None


@root
def test_another_user_is_known_as_another(listener: socket.socket) -> None:
    child = os.fork()
    if child == 0:
        os.setuid(NOBODY)
        kept = _connect(listener)
        time.sleep(60)
        kept.close()
    accepted, client = listener.accept()
    with accepted:
        assert user_of(client, listener.getsockname()) == NOBODY
    os.kill(child, 9)
    os.waitpid(child, 0)


def test_without_linux_no_user_is_named_and_no_port_is_held(
    listener: socket.socket, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(local_server, "_held", {})
    monkeypatch.setattr(sys, "platform", "darwin")
    monkeypatch.delattr(socket, "AF_NETLINK")
    with _connect(listener) as client:
        assert user_of(client.getsockname(), listener.getsockname()) is None
    assert local_server.hold_port(listener.getsockname()[1]) and not local_server._held


@root
def test_a_port_that_is_held_is_never_another_users(listener: socket.socket, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(local_server, "_held", {})
    port = listener.getsockname()[1]
    assert local_server.hold_port(port)

    def take(reuse: int, host: str) -> None:
        with socket.socket() as stranger:
            stranger.setsockopt(socket.SOL_SOCKET, reuse, 1)
            stranger.bind((host, port))
            stranger.listen()

    listener.close()
    for reuse in (socket.SO_REUSEPORT, socket.SO_REUSEADDR):
        for host in ("127.0.0.1", ""):
            assert not _as_nobody(lambda reuse=reuse, host=host: take(reuse, host))  # type: ignore[misc]
    with pytest.raises(ConnectionRefusedError):
        socket.create_connection(("127.0.0.1", port))
    again = local_server.bind(port)
    assert again is not None, "our next server takes it again"
    again.close()
    local_server._held.pop(port).close()
    assert _as_nobody(lambda: take(socket.SO_REUSEPORT, "127.0.0.1"))


@root
def test_a_server_of_another_user_on_our_port_is_not_ours(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(local_server, "_held", {})
    monkeypatch.setattr(local_server, "_is_healthy", lambda port: pytest.fail("nothing is sent to it"))
    ready, report = os.pipe()
    child = os.fork()
    if child == 0:
        os.setuid(NOBODY)
        stranger = socket.create_server(("127.0.0.1", 0), reuse_port=True)
        os.write(report, str(stranger.getsockname()[1]).encode())
        time.sleep(60)
    port = int(os.read(ready, 10))
    files = local_server.ServerFiles(tmp_path)
    files.state.write_text(f'{{"url": "http://127.0.0.1:{port}/api", "port": {port}, "pid": {child}}}')
    assert local_server.running_server(files) is None
    os.kill(child, 9)
    os.waitpid(child, 0)


@root
@pytest.mark.server
@pytest.mark.timeout(600)
def test_our_server_serves_its_user_and_no_other(server_cache: Path) -> None:
    with local_server.prefect_server() as url:
        port = int(url.split(":")[2].split("/")[0])

        def ask() -> None:
            with contextlib.closing(http.client.HTTPConnection("127.0.0.1", port, timeout=10)) as connection:
                connection.request("GET", "/api/health")
                assert connection.getresponse().read() == b"true"

        ask()
        assert not _as_nobody(ask)
        (home,) = server_cache.glob("prefect-*")
        assert home.stat().st_mode & 0o777 == 0o700
        assert (home / "prefect.db").stat().st_mode & 0o777 == 0o600


def test_the_databases_pages_stay_in_memory_up_to_a_limit_for_all_connections_together(tmp_path: Path) -> None:
    """In a process of its own: the limit is the process's."""
    script = """
import sqlite3, sys
from humanmm.flows.server.server_process import limit_database_cache
from humanmm.machine import resident_mb

def grown_mb(path):
    before = resident_mb()
    for connection in [sqlite3.connect(path) for _ in range(4)]:
        connection.execute("PRAGMA cache_size = 20000")
        connection.execute("SELECT sum(unicode(page)) FROM pages").fetchall()
        kept.append(connection)
    return resident_mb() - before

kept = []
with sqlite3.connect(sys.argv[1]) as database:
    database.execute("PRAGMA cache_size = 100")
    database.execute("CREATE TABLE pages (page BLOB)")
    database.executemany("INSERT INTO pages VALUES (?)", (("x" * 3000,) for _ in range(6000)))
limit_database_cache(4 * 2**20)
limited = grown_mb(sys.argv[1])
kept.clear()
limit_database_cache(0)
print(limited, grown_mb(sys.argv[1]))
"""
    done = subprocess.run(
        [sys.executable, "-c", script, tmp_path / "pages.db"], capture_output=True, text=True, check=True
    )
    limited, unlimited = map(float, done.stdout.split())
    assert limited < 12 and unlimited > 50
