"""The store that a place names: a folder, or `s3://bucket/prefix`."""

from pathlib import Path

from humanmm.storage.bucket import is_bucket
from humanmm.storage.store import Store


def open_store(place: Path | str, *, read_only: bool = False) -> Store:
    """Open the store at a folder or in a bucket; a bucket may be named by a Path, which has lost a slash."""
    if is_bucket(str(place)):
        from humanmm.storage.bucket_store import BucketStore

        return BucketStore(str(place), read_only=read_only)
    return Store(Path(place), read_only=read_only)
