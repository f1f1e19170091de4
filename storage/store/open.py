"""The store that a place names, a folder or `s3://bucket/prefix`, and its ledger of batches."""

import functools
from pathlib import Path

from humanmm.storage.batches.batch_ledger import BatchLedger
from humanmm.storage.batches.disk_ledger import DiskLedger
from humanmm.storage.store.bucket import is_bucket
from humanmm.storage.store.store import Store, default_store


def open_store(place: Path | str | None = None, *, read_only: bool = False) -> Store:
    """Open the store at a folder or in a bucket, else the user's own; a Path that names a bucket has lost a slash."""
    place = place or default_store()
    if is_bucket(str(place)):
        from humanmm.storage.store.bucket_store import BucketStore

        return BucketStore(str(place), read_only=read_only)
    return Store(Path(place), read_only=read_only)


def open_ledger(place: Path | str) -> BatchLedger:
    """Open the batches of the store at a place. Of a bucket a process has one ledger, which keeps what it has read."""
    return _ledger_in(str(place)) if is_bucket(str(place)) else DiskLedger(Store(Path(place)))


@functools.cache
def _ledger_in(place: str) -> BatchLedger:
    from humanmm.storage.batches.bucket_ledger import BucketLedger
    from humanmm.storage.store.bucket_store import BucketStore

    return BucketLedger(BucketStore(place))
