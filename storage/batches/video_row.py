"""One row of the batch table: what a batch wants of one video, and what has become of it."""

import hashlib
import json
import os
import socket
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from humanmm.storage.batches.owner import LEASE_S, Owner

STATES = ("scheduled", "running", "done", "partial", "failed", "cancelled")


@dataclass(frozen=True)
class VideoRow:
    """One video of a batch."""

    batch: str
    video: str
    position: int
    run_dir: str
    config: str
    """Its whole configuration as json."""
    priority: str
    tags: str
    """Tags as a json list."""
    facts: str
    """`facts_of` the file, empty if there is none: another file is another video."""
    recipe: str
    """Digest of code, weights, libraries and settings: what is finished with another recipe is not finished."""
    attempt: int = 1
    state: str = "scheduled"
    stage: str | None = None
    """Where it is, or where it failed."""
    reason: str = ""
    seconds: float | None = None
    flow_run: str | None = None
    changed: float = 0.0
    """When it changed its state, seconds since 1970."""
    losses: int = 0
    """How often its process was lost since it made progress."""
    host: str = ""
    """Where it was computed last: its run folder is there."""
    owner: str = ""
    """The process that computes it (`Owner`); empty if none does."""
    hopeless: bool = False
    """Whether its last attempt failed because of what the file holds: it is damaged, or nobody is in it."""
    unrenewed_s: float = field(default=0.0, compare=False)
    """Seconds from the last renewal of its owner's lease until this row was read."""

    @property
    def key(self) -> str:
        """32 hex digits that name batch and video."""
        return hashlib.sha256(f"{self.batch}\0{self.video}".encode()).hexdigest()[:32]

    @property
    def is_owned(self) -> bool:
        """Whether a living process computes it, or one of another machine whose lease has not run out."""
        alive = Owner.parse(self.owner).is_alive() if self.owner else False
        return self.unrenewed_s < LEASE_S if alive is None else alive

    @property
    def pid(self) -> int | None:
        """Its process, if that lives on this machine."""
        owner = Owner.parse(self.owner) if self.owner else None
        return owner.pid if owner is not None and owner.is_alive() else None

    @property
    def is_elsewhere(self) -> bool:
        """Whether another machine than this one has computed it."""
        return self.host not in ("", socket.gethostname())

    @property
    def fails_again(self) -> bool:
        """Whether another attempt would fail as the last one: the file is to blame, and is as it was then."""
        return self.state == "failed" and self.hopeless and self.facts == facts_of(Path(self.video))

    def same_work(self, other: "VideoRow") -> bool:
        """True if both want the same file recovered in the same way into the same folder."""
        return (self.facts, self.recipe, self.run_dir) == (other.facts, other.recipe, other.run_dir)

    def to_json(self) -> dict[str, Any]:
        """The row as `batch status --json` prints it."""
        return {name: getattr(self, name) for name in ("video", "state", "stage", "reason", "run_dir", "seconds")}


FACTS = ("size", "mtime_ns", "inode", "ctime_ns")
"""What `facts_of` gives, in order, by the names of `storage.store.identity.FileState`."""


def facts_of(video: Path) -> str:
    """Size, modification time, inode and time of the last change of a file as json; empty if it cannot be seen.

    A program that writes into a file may set its modification time back, as copying programs do. The last it cannot; a
    new name, link or mode changes it, too.
    """
    try:
        status = video.stat()
    except OSError:
        return ""
    return json.dumps([status.st_size, status.st_mtime_ns, status.st_ino, status.st_ctime_ns])


def may_be_same(facts: str, others: str) -> bool:
    """Whether two facts differ in nothing but the time of the last change: then the content decides."""
    return bool(facts and others) and json.loads(facts)[:3] == json.loads(others)[:3]


def counts(rows: Iterable[VideoRow]) -> Mapping[str, int]:
    """State → number of videos, states without any left out."""
    states = [row.state for row in rows]
    return {state: states.count(state) for state in STATES if state in states}


def counts_in_words(rows: Iterable[VideoRow]) -> str:
    """Such as `3 done, 1 failed`."""
    return ", ".join(f"{number} {state}" for state, number in counts(rows).items()) or "no video"


def recorded_at(run_dir: str) -> float | None:
    """When the record of a run folder was written, seconds since 1970; None if there is none."""
    try:
        return os.stat(f"{run_dir}/run.json").st_mtime  # noqa: PTH116  (called for 10,000 folders)
    except OSError:
        return None
