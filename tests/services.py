"""Services that tests start for themselves where they are installed, such as Postgres."""

import os
import shutil
import signal
import socket
import subprocess
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest


def program(name: str) -> str:
    """A program of PATH or of Debian's Postgres; the test is skipped without it."""
    versions = sorted(Path("/usr/lib/postgresql").glob(f"*/bin/{name}"))
    found = shutil.which(name) or (str(versions[-1]) if versions else None)
    if found is None:
        pytest.skip(f"{name} is not installed (Debian: postgresql, redis-server)")
    return found


def free_port() -> int:
    with socket.create_server(("127.0.0.1", 0)) as listener:
        return int(listener.getsockname()[1])


def listens(port: int) -> bool:
    with socket.socket() as probe:
        return probe.connect_ex(("127.0.0.1", port)) == 0


@contextmanager
def running(command: list[str], ready: Callable[[], bool], log: Path, **options: Any) -> Iterator[None]:
    """A service that runs until the block ends."""
    with log.open("wb") as output:
        process = subprocess.Popen(command, stdout=output, stderr=output, start_new_session=True, **options)
    try:
        deadline = time.monotonic() + 180
        while not ready():
            assert process.poll() is None and time.monotonic() < deadline, log.read_text()[-2000:]
            time.sleep(0.2)
        yield
    finally:
        process.send_signal(signal.SIGINT)
        try:
            process.wait(timeout=30)
        except subprocess.TimeoutExpired:
            os.killpg(process.pid, signal.SIGKILL)
            process.wait()


@contextmanager
def postgres(folder: Path, database: str) -> Iterator[int]:
    """Postgres with an empty database of the user `prefect`; its port."""
    initdb, server, createdb = program("initdb"), program("postgres"), program("createdb")
    as_user: dict[str, Any] = {}
    if os.getuid() == 0:  # Postgres refuses to run as root
        as_user = {"user": "postgres", "group": "postgres", "extra_groups": []}
        for parent in (folder, *folder.parents):
            if not parent.stat().st_mode & 0o001:
                parent.chmod(0o755)
    data, port = folder / "postgres", free_port()
    data.mkdir()
    if as_user:
        shutil.chown(data, "postgres", "postgres")
    subprocess.run(
        [initdb, "-D", str(data), "-U", "prefect", "-A", "trust", "--no-sync"],
        check=True, capture_output=True, cwd="/", **as_user,
    )  # fmt: skip
    command = [server, "-D", str(data), f"-k{data}", "-h127.0.0.1", f"-p{port}", "-F"]
    with running(command, lambda: listens(port), folder / "postgres.log", cwd="/", **as_user):
        connect = ["-h", "127.0.0.1", "-p", str(port), "-U", "prefect", database]
        subprocess.run([createdb, *connect], check=True, capture_output=True)
        yield port
