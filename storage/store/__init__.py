"""The content-addressed store: artifacts, keys, code digest, locks, maintenance; on a disk or in a bucket."""
