"""What a store records of each video: how the last run on it ended, and the last recipe and result of each unit.

latest/<video>/run.json               `RunNote`
latest/<video>/<stage>/<unit>.json    recipe, key and content digest, so that a recompute can say what changed
"""

import contextlib
import json
from abc import ABC, abstractmethod
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from datetime import datetime

from humanmm.storage.store.artifact import Manifest
from humanmm.storage.store.recipe import Recipe

TIME = "%Y-%m-%dT%H:%M:%S%z"


@dataclass(frozen=True)
class RunNote:
    """How the last run on a video ended, for `status`, for batches, and for what `gc` keeps."""

    video: str
    """Its sha256."""
    state: str
    """done, partial or failed."""
    path: str = ""
    run_dir: str | None = None
    host: str = ""
    """The host of the run folder."""
    reason: str = ""
    recipe: str = ""
    """Digest of code, weights, libraries and settings, if it is done."""
    artifacts: tuple[str, ...] = ()
    """URIs of everything that it found or computed."""
    result: tuple[str, ...] = ()
    """If it failed: those of the last run that wrote its run folder, which stands as it was."""
    finished: str = ""

    @property
    def ended(self) -> float:
        """When it ended, seconds since 1970: the end of the second that `finished` names."""
        return datetime.strptime(self.finished, TIME).timestamp() + 1.0 if self.finished else 0.0


class VideoRecords(ABC):
    """Small records by name. A store on a disk or in a bucket says how one is written and read."""

    @abstractmethod
    def note(self, name: str, text: str) -> None:
        """Write a record, unless the store is read-only; `name` is relative to the store's root."""

    @abstractmethod
    def noted(self, name: str) -> str | None:
        """The text of a record; None if there is none."""

    @abstractmethod
    def runs_noted(self) -> Iterator[str]:
        """Names of the records of `note_run`."""

    def remember(self, video: str, unit: str, manifest: Manifest) -> None:
        """Record the recipe and the result of a unit."""
        name = _unit_name(video, manifest.recipe.stage, unit)
        text = json.dumps({"recipe": manifest.recipe.to_json(), "key": manifest.recipe.key, "digest": manifest.digest})
        if self.noted(name) != text:
            self.note(name, text)

    def last_recipe(self, video: str, stage: str, unit: str) -> Recipe | None:
        """The recipe with which a unit of this video was last computed or found."""
        try:
            return Recipe.from_json(json.loads(self.noted(_unit_name(video, stage, unit)) or "")["recipe"])
        except (ValueError, KeyError, TypeError):
            return None

    def last_digest(self, video: str, stage: str, unit: str) -> str | None:
        """Content digest of the last result of a unit of this video."""
        try:
            return str(json.loads(self.noted(_unit_name(video, stage, unit)) or "")["digest"])
        except (ValueError, KeyError, TypeError):
            return None

    def note_run(self, note: RunNote) -> None:
        """Record how the last run on a video ended."""
        self.note(_run_name(note.video), json.dumps(asdict(note)))

    def noted_run(self, name: str) -> RunNote | None:
        """The record of this name, one of `runs_noted`; None if it is gone or unreadable."""
        with contextlib.suppress(ValueError, TypeError):
            known = json.loads(self.noted(name) or "")
            uris = {name: tuple(known.get(name, ())) for name in ("artifacts", "result")}
            return RunNote(**known | uris)
        return None

    def last_run(self, video: str) -> RunNote | None:
        """How the last run on a video ended; None if there was none."""
        return self.noted_run(_run_name(video))

    def known_runs(self) -> list[RunNote]:
        """How the last run on every video ended, newest first."""
        found = [self.noted_run(name) for name in self.runs_noted()]
        return sorted((run for run in found if run is not None), key=lambda run: run.finished, reverse=True)


def _unit_name(video: str, stage: str, unit: str) -> str:
    return f"latest/{video[:32]}/{stage}/{unit}.json"


def _run_name(video: str) -> str:
    return f"latest/{video[:32]}/run.json"
