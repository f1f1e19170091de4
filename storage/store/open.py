"""Opens the store at a location, a folder or `s3://bucket/prefix`, and its ledger of batches."""

import functools
from pathlib import Path

from humanmm.storage.batches.batch_ledger import BatchLedger
from humanmm.storage.batches.disk_ledger import DiskLedger
from humanmm.storage.store.bucket import is_bucket
from humanmm.storage.store.bucket_store import BucketStore
from humanmm.storage.store.store import Store, default_store


def open_store(location: Path | str | None = None, *, read_only: bool = False) -> Store:
    """Open the store in a folder or in a bucket, else the user's own; a Path that names a bucket has lost a slash."""
    location = location or default_store()
    if is_bucket(str(location)):
        return BucketStore(str(location), read_only=read_only)
    return Store(Path(location), read_only=read_only)


def open_ledger(place: Path | str) -> BatchLedger:
    """Open the batches of the store at a place. Of a bucket a process has one ledger, which keeps what it has read."""
    return _ledger_in(str(place)) if is_bucket(str(place)) else DiskLedger(Store(Path(place)))


@functools.cache
def _ledger_in(place: str) -> BatchLedger:
    from humanmm.storage.batches.bucket_ledger import BucketLedger

    return BucketLedger(BucketStore(place))
