"""The right to compute one key, held by an object in a bucket, for hosts that share no kernel.

The object says who holds it and how often that was renewed, or that nobody does. Every step is a conditional put: two
can never take the same lease. A holder renews it while it lives; who waits takes it over when it has not changed for
`LEASE_S` on the waiter's own clock, who cannot wait when it is a little older by the clock of the bucket itself: clocks
of hosts need not agree. A holder that was stopped for longer may go on beside its successor: work is then done twice,
but what is committed is one whole artifact, for the commit is conditional too.
"""

import contextlib
import logging
import os
import socket
import threading
import time
import uuid
from collections.abc import Iterator

from humanmm.errors import StoreError
from humanmm.storage.store.bucket import Bucket, Object

log = logging.getLogger(__name__)

LEASE_S = 30.0
"""A lease not renewed for so long belongs to nobody: so long does a waiter wait for a holder that was killed."""
RENEW_S = 10.0
POLL_S = 1.0
MARGIN_S = 10.0
"""By so much may the clocks of a bucket's own machines differ, to be safe."""

_FREE = b"free"


class Lease:
    """One try to hold one name."""

    def __init__(self, bucket: Bucket, name: str) -> None:
        self._bucket = bucket
        self._name = name
        self._owner = f"{socket.gethostname()} {os.getpid()} {uuid.uuid4().hex}"
        self._renewals = 0
        self._tag = ""

    @contextlib.contextmanager
    def held(self) -> Iterator[None]:
        """Wait until it is ours, keep it as long as the block runs."""
        seen, since, told = "", time.monotonic(), False
        while True:
            found = self._bucket.read(self._name)
            if found is not None and found[1].tag != seen:
                seen, since = found[1].tag, time.monotonic()
            if self._take(found, expired=time.monotonic() - since > LEASE_S):
                break
            if not told and found is not None:
                log.info("%s is being computed by %s; waiting for it", self._name, _holder(found[0]))
                told = True
            time.sleep(POLL_S)
        with self._renewed():
            yield

    @contextlib.contextmanager
    def tried(self) -> Iterator[bool]:
        """As `held`, but says False at once when somebody holds it."""
        found = self._bucket.read(self._name)
        if not self._take(found, expired=found is not None and not self._is_kept(found)):
            yield False
            return
        with self._renewed():
            yield True

    def is_held(self) -> bool:
        """Whether somebody holds it who lives, as far as can be told at once."""
        found = self._bucket.read(self._name)
        return found is not None and self._is_kept(found)

    def _is_kept(self, found: tuple[bytes, Object]) -> bool:
        content, state = found
        return content != _FREE and self._bucket.now() - state.written <= LEASE_S + MARGIN_S

    def _take(self, found: tuple[bytes, Object] | None, *, expired: bool) -> bool:
        if found is None:
            tag = self._bucket.create(self._name, self._text())
        else:
            content, state = found
            if content.startswith(self._owner.encode()):  # our put arrived, its answer did not
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
                with contextlib.suppress(StoreError):  # it ends by itself
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
                log.warning("the lease %s was taken over by another process: this one had stopped too long", self._name)
                return

    def _text(self) -> bytes:
        return f"{self._owner} {self._renewals}".encode()


def _holder(content: bytes) -> str:
    host, process, *_ = content.decode(errors="replace").split()
    return f"process {process} on {host}"
