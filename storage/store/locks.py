"""The right to compute one key, or to write one folder: a flock on the disk of one host, a lease in a bucket for hosts
that share no kernel.

The kernel frees a flock when its holder ends, however it ends. A lease is an object in the bucket with its holder and a
count of renewals, or the word `free`. Every step is a conditional put: no two processes can take the same lease. A
holder renews it while it lives. A process that waits takes it over when it has not changed for `LEASE_S` on its own
clock; a process that cannot wait takes it over when it is a little older by the clock of the bucket: clocks of hosts
need not agree. A holder that was stopped for longer may go on beside its successor: both compute, but what is committed
is one whole artifact, for the commit is conditional too.
"""

import contextlib
import fcntl
import logging
import os
import socket
import threading
import time
import uuid
from collections.abc import Iterator
from pathlib import Path

from humanmm.errors import StoreError
from humanmm.storage.store.bucket import Bucket, Object
from humanmm.storage.store.files import OTHER_STORE, store_errors

log = logging.getLogger(__name__)

LEASE_S = 30.0
"""Seconds without renewal after which a lease may be taken over: the longest wait for a holder that was killed."""
RENEW_S = 10.0
POLL_S = 1.0
MARGIN_S = 10.0
"""Seconds by which the clocks of a bucket's own machines may differ, with a margin."""

_FREE = b"free"


class FileLock:
    """A flock on one file, which all processes of this host share. Its holder may remove the file as its last act."""

    def __init__(self, path: Path, *, waiting: str, level: int = logging.INFO, other: str = OTHER_STORE) -> None:
        self._path = path
        self._waiting, self._level = waiting, level
        """The line of the log while another process holds it."""
        self._other = other
        """What may be named in place of where it lies."""

    @contextlib.contextmanager
    def held(self) -> Iterator[None]:
        """Wait for the lock, and hold it while the block runs."""
        while True:
            with self._opened() as descriptor:
                if not _try_flock(descriptor):
                    log.log(self._level, self._waiting)
                    fcntl.flock(descriptor, fcntl.LOCK_EX)
                if self._is_in_place(descriptor):
                    yield
                    return

    @contextlib.contextmanager
    def tried(self) -> Iterator[bool]:
        """As `held`, but yields False at once when another process holds the lock."""
        while True:
            with self._opened() as descriptor:
                taken = _try_flock(descriptor)
                if not taken or self._is_in_place(descriptor):
                    yield taken
                    return

    def _is_in_place(self, descriptor: int) -> bool:
        """Whether the file that is locked is the one that others lock: its holder may have removed it (`gc`) between
        the opening and the lock."""
        try:
            return os.path.samestat(os.fstat(descriptor), self._path.stat())
        except FileNotFoundError:
            return False

    @contextlib.contextmanager
    def _opened(self) -> Iterator[int]:
        with store_errors(f"cannot lock {self._path}", other=self._other):
            self._path.parent.mkdir(parents=True, exist_ok=True)
            descriptor = os.open(self._path, os.O_RDWR | os.O_CREAT, 0o666)
        try:
            yield descriptor
        finally:
            os.close(descriptor)


def is_folder_locked(folder: Path) -> bool:
    """Whether a process holds a flock on a folder."""
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        return not _try_flock(descriptor)
    finally:
        os.close(descriptor)


def _try_flock(descriptor: int) -> bool:
    try:
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    return True


class Lease:
    """A lock in a bucket. One object of this class is one attempt to hold it."""

    def __init__(self, bucket: Bucket, name: str) -> None:
        self._bucket = bucket
        self._name = name
        self._owner = f"{socket.gethostname()} {os.getpid()} {uuid.uuid4().hex}"
        self._renewals = 0
        self._tag = ""

    @contextlib.contextmanager
    def held(self) -> Iterator[None]:
        """Wait for the lease, and renew it while the block runs."""
        seen, since, logged = "", time.monotonic(), False
        while True:
            found = self._bucket.read(self._name)
            if found is not None and found[1].tag != seen:
                seen, since = found[1].tag, time.monotonic()
            if self._take(found, expired=time.monotonic() - since > LEASE_S):
                break
            if not logged and found is not None:
                log.info("%s is being computed by %s; waiting for it", self._name, _holder(found[0]))
                logged = True
            time.sleep(POLL_S)
        with self._renewed():
            yield

    @contextlib.contextmanager
    def tried(self) -> Iterator[bool]:
        """As `held`, but yields False at once when another process holds the lease."""
        found = self._bucket.read(self._name)
        if not self._take(found, expired=found is not None and not self._is_renewed(found)):
            yield False
            return
        with self._renewed():
            yield True

    def _is_renewed(self, found: tuple[bytes, Object]) -> bool:
        content, state = found
        return content != _FREE and self._bucket.now() - state.written <= LEASE_S + MARGIN_S

    def _take(self, found: tuple[bytes, Object] | None, *, expired: bool) -> bool:
        if found is None:
            tag = self._bucket.create(self._name, self._text())
        else:
            content, state = found
            if content.startswith(self._owner.encode()):  # our put arrived, its response did not
                tag = state.tag
            elif content == _FREE or expired:
                tag = self._bucket.replace(self._name, self._text(), state.tag)
            else:
                tag = None
        self._tag = tag or ""
        return tag is not None

    @contextlib.contextmanager
    def _renewed(self) -> Iterator[None]:
        ended = threading.Event()
        renewing = threading.Thread(target=self._renew, args=(ended,), daemon=True)
        renewing.start()
        try:
            yield
        finally:
            ended.set()
            renewing.join()
            if self._tag:
                with contextlib.suppress(StoreError):  # without it the lease expires
                    self._bucket.replace(self._name, _FREE, self._tag)

    def _renew(self, ended: threading.Event) -> None:
        while not ended.wait(RENEW_S):
            self._renewals += 1
            try:
                tag = self._bucket.replace(self._name, self._text(), self._tag)
                kept = tag is not None or self._take(self._bucket.read(self._name), expired=False)
            except StoreError as error:
                log.debug("a lease could not be renewed: %s", error)
                continue
            self._tag = tag or self._tag
            if not kept:
                log.warning("another process took over the lease %s: this one had stopped for too long", self._name)
                return

    def _text(self) -> bytes:
        return f"{self._owner} {self._renewals}".encode()


def _holder(content: bytes) -> str:
    host, process, *_ = content.decode(errors="replace").split()
    return f"process {process} on {host}"
