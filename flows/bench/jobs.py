"""One video of a benchmark's set before it is made: what it is made of, and the function that makes it."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from humanmm.config import Config
from humanmm.models.synthetic.multishot import BenchVideo
from humanmm.storage.store.store import Store

SETTINGS = ("shots", "intrinsics", "camera", "hmr", "align", "refine")
"""Sections of the configuration that change a motion here."""


@dataclass(frozen=True)
class Job:
    """A video that a process can make; jobs of all sets differ in these values alone."""

    name: str
    split: str
    parameters: Mapping[str, Any]
    """Everything that the video is made of, as json."""
    inputs: Mapping[str, str]
    """Digests of the data that it is made of."""
    make: Callable[[Config, Store], BenchVideo]
    """The video; raises HumanMMError where it cannot be had, which counts as a failure of all methods."""
    modules: tuple[str, ...] = ()
    """Modules whose code makes the video, besides the methods' own."""
    settings: tuple[str, ...] = SETTINGS
    """Sections of the configuration that change its motions."""
    video: Path | None = None
    """Its pictures, if it has any."""
    truth: Path | None = None
    """Its truth, if it is a file."""
