"""The content-addressed store: artifacts and their keys, locks, records of videos, maintenance; on a disk or in S3."""
