"""Opens the store at a location: a folder or `s3://bucket/prefix`."""

import logging
from pathlib import Path

from humanmm.storage.store.bucket import is_bucket
from humanmm.storage.store.bucket_store import BucketStore
from humanmm.storage.store.store import Store, default_store

log = logging.getLogger(__name__)


def open_store(location: Path | str | None = None, *, read_only: bool = False) -> Store:
    """Open the store in a folder or in a bucket, else the user's own; a Path that names a bucket has lost a slash."""
    location = location or default_store()
    if is_bucket(str(location)):
        return BucketStore(str(location), read_only=read_only)
    return Store(Path(location), read_only=read_only)


def open_store_of_run(noted: str) -> Store:
    """Open the store that a run noted, to read only. Where its folder is no longer there, as after a move, the user's
    own is opened in its place, with a warning."""
    store = open_store(noted, read_only=True)
    if is_bucket(store.location) or store.root.is_dir():
        return store
    own = open_store(read_only=True)
    log.warning("the run's store %s is not there; %s is looked into in its place", store.location, own.location)
    return own
