"""A folder of an S3 bucket: whole objects, conditional puts, nothing else (obstore, extra `s3`).

Endpoint, region and credentials come from the environment that obstore reads: `AWS_ENDPOINT_URL`, `AWS_REGION`,
`AWS_ACCESS_KEY_ID`, `AWS_SECRET_ACCESS_KEY`, `AWS_ALLOW_HTTP=true` for a server without TLS. The server must know
`If-None-Match: *` and `If-Match` on PUT, which S3 itself does.
"""

import contextlib
import re
import time
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from humanmm.errors import ConfigError, StoreError

_URL = re.compile(r"s3:/{1,2}(?P<bucket>[^/]+)/?(?P<prefix>.*)")  # a Path has lost the second slash

CLOCK_LIMIT_S = 600.0
"""Seconds for which our clock stands in for that of the service before it is read again."""


def is_bucket(location: str) -> bool:
    """True for `s3://bucket/prefix`."""
    return _URL.fullmatch(location) is not None


@dataclass(frozen=True)
class Object:
    """One object as it was read or listed."""

    name: str
    num_bytes: int
    tag: str
    """Its entity tag, which a conditional put compares."""
    written: float
    """Seconds since 1970 by the clock of the service."""

    @property
    def age_s(self) -> float:
        """Seconds since then, by this host's clock."""
        return time.time() - self.written


class Bucket:
    """Objects below `s3://bucket/prefix`, by their name relative to it. StoreError for every fault of the service."""

    def __init__(self, url: str) -> None:
        parts = _URL.fullmatch(url)
        if parts is None:
            raise ConfigError(f"{url!r} is no bucket; expected s3://bucket/prefix")
        prefix = parts["prefix"].strip("/")
        self.url = f"s3://{parts['bucket']}" + (f"/{prefix}" if prefix else "")
        try:
            from obstore.store import S3Store
        except ImportError:
            raise ConfigError(f"{self.url} needs obstore: pip install 'humanmm[s3]'") from None
        with self._faults("open"):
            self._s3 = S3Store(parts["bucket"], prefix=prefix or None)
        self._clock: tuple[float, float] | None = None

    def __reduce__(self) -> tuple[type["Bucket"], tuple[str]]:
        return Bucket, (self.url,)

    def read(self, name: str) -> tuple[bytes, Object] | None:
        """A small object; None if there is none."""
        import obstore

        with self._faults(f"read {name}"):
            try:
                found = obstore.get(self._s3, name)
                return bytes(found.bytes()), _object(found.meta)
            except FileNotFoundError:
                return None

    def now(self) -> float:
        """Seconds since 1970 by the clock of the service, never ahead of it: the clock that dates its objects."""
        import obstore

        if self._clock is None or time.monotonic() - self._clock[0] > CLOCK_LIMIT_S:
            self.write("clock", b"")
            with self._faults("read clock"):
                stamp = obstore.head(self._s3, "clock")["last_modified"].timestamp()
            self._clock = time.monotonic(), stamp
        since, stamp = self._clock
        return stamp + time.monotonic() - since

    def create(self, name: str, content: bytes) -> str | None:
        """Write a small object that is not there yet; its tag, or None if it is there."""
        return self._put(name, content, "create")

    def replace(self, name: str, content: bytes, tag: str) -> str | None:
        """Write a small object if it still has this tag; its new tag, or None if it was changed or removed."""
        return self._put(name, content, {"e_tag": tag})

    def write(self, name: str, content: bytes) -> None:
        """Write a small object, new or in place of an older one."""
        self._put(name, content, "overwrite")

    def upload(self, name: str, path: Path) -> None:
        """Write an object from a file, in parts: memory does not grow with it."""
        import obstore

        with self._faults(f"write {name}"):
            obstore.put(self._s3, name, path)

    def download(self, name: str, path: Path) -> bool:
        """Write a file from an object; False if there is none."""
        import obstore

        with self._faults(f"read {name}"):
            try:
                found = obstore.get(self._s3, name)
            except FileNotFoundError:
                return False
            with path.open("wb") as file:
                for chunk in found.stream():
                    file.write(chunk)
            return True

    def list(self, folder: str) -> Iterator[Object]:
        """Every object below a folder, sorted by name."""
        import obstore

        with self._faults(f"list {folder}"):
            for page in obstore.list(self._s3, f"{folder}/"):
                for meta in page:
                    yield _object(meta)

    def move(self, name: str, target: str) -> None:
        """Rename an object; nothing happens if there is none."""
        import obstore

        with self._faults(f"move {name}"), contextlib.suppress(FileNotFoundError):
            obstore.rename(self._s3, name, target)

    def remove(self, names: Iterable[str]) -> None:
        """Remove objects; those that are gone already count as removed."""
        import obstore

        for name in names:
            with self._faults(f"remove {name}"), contextlib.suppress(FileNotFoundError):
                obstore.delete(self._s3, name)

    def _put(self, name: str, content: bytes, mode: Any) -> str | None:
        import obstore
        from obstore.exceptions import AlreadyExistsError, PreconditionError

        with self._faults(f"write {name}"):
            try:
                return str(obstore.put(self._s3, name, content, mode=mode)["e_tag"])
            except (AlreadyExistsError, PreconditionError):
                return None
            except FileNotFoundError:
                if isinstance(mode, dict):
                    return None
                raise  # the bucket itself

    @contextlib.contextmanager
    def _faults(self, what: str) -> Iterator[None]:
        from obstore.exceptions import BaseError

        try:
            yield
        except (BaseError, OSError) as error:
            said = str(error).strip().splitlines()
            raise StoreError(f"cannot {what} in {self.url}: {said[0] if said else type(error).__name__}") from error


def _object(meta: Any) -> Object:
    return Object(str(meta["path"]), int(meta["size"]), str(meta["e_tag"]), meta["last_modified"].timestamp())
