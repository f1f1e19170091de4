"""What a user wants of one batch: which videos, with which settings, into which folder."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from humanmm.config import Config
from humanmm.storage.batches.batch_table import BatchTable
from humanmm.storage.batches.manifest import Entry, read_batch
from humanmm.tasks.batches.batch import Planned, Submission, batch_name, forecast_submission, submit


@dataclass(frozen=True, kw_only=True)
class BatchRequest:
    """One batch, as `humanmm batch submit` and the deployment `recover-batch` take it."""

    source: Path
    """A folder or a manifest."""
    out: Path
    """Where the run folders go."""
    config: Config
    name: str | None = None
    """Default: made of `source`."""
    pattern: str | None = None
    """Only such names of a folder."""
    priority: str = "normal"
    """Of videos that name none."""
    tags: Sequence[str] = ()
    """On every flow run."""
    settle_s: float = 30.0
    """A file that changed in the last so many seconds may still be growing."""

    @property
    def batch(self) -> str:
        """The name of the batch."""
        return self.name or batch_name(self.source)

    def videos(self) -> list[Entry]:
        """Every video of the source, each once, in order. InputError if there is none."""
        return read_batch(self.source, pattern=self.pattern)

    def submit(self, table: BatchTable, videos: Sequence[Entry]) -> Submission:
        """Write the rows of these videos."""
        return submit(table, self.batch, self._entries(videos), self.config, self.out)

    def forecast(self, table: BatchTable, videos: Sequence[Entry]) -> list[Planned]:
        """What `submit` would do with these videos."""
        return forecast_submission(table, self.batch, self._entries(videos), self.config, self.out)

    def _entries(self, videos: Sequence[Entry]) -> list[Entry]:
        return [video.with_defaults(priority=self.priority, tags=self.tags) for video in videos]
