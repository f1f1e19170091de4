"""Opens the store at a location: a folder or `s3://bucket/prefix`."""

from pathlib import Path

from humanmm.storage.store.bucket import is_bucket
from humanmm.storage.store.bucket_store import BucketStore
from humanmm.storage.store.store import Store, default_store


def open_store(location: Path | str | None = None, *, read_only: bool = False) -> Store:
    """Open the store in a folder or in a bucket, else the user's own; a Path that names a bucket has lost a slash."""
    location = location or default_store()
    if is_bucket(str(location)):
        return BucketStore(str(location), read_only=read_only)
    return Store(Path(location), read_only=read_only)
