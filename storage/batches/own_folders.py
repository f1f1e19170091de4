"""Which folders humanmm itself writes, run folders and those of a store: what lies in them is no new video."""

import os
from collections.abc import Collection
from pathlib import Path

_RUN = ("run.json", "motion.zarr")
_STORE = ("artifacts", "locks", "tmp", "videos")
_OF_STORE = (*_STORE, "damaged")


def foreign(names: Collection[str], folders: Collection[str]) -> list[str]:
    """Those of the subfolders of a folder with these names that are not humanmm's own."""
    if is_run(names):
        return []
    is_store = set(_STORE) <= set(names)
    return [name for name in folders if not (is_store and name in _OF_STORE)]


def is_run(names: Collection[str]) -> bool:
    """Whether a folder with these files and folders is a run folder, whatever its name."""
    return set(_RUN) <= set(names)


class OwnFolderSearch:
    """Finds the folder of humanmm around a place; it looks at each folder once."""

    def __init__(self) -> None:
        self._known: dict[Path, Path | None] = {}

    def around(self, folder: Path) -> Path | None:
        """The nearest run folder, or folder of a store, that a folder is or lies in."""
        return self._around(Path(os.path.abspath(folder)))  # noqa: PTH100  (without `..`, and links as they are named)

    def _around(self, folder: Path) -> Path | None:
        if folder not in self._known:
            own = _hold(folder, _RUN) or (folder.name in _OF_STORE and _hold(folder.parent, _STORE))
            above = None if folder == folder.parent else folder.parent
            self._known[folder] = folder if own else above and self._around(above)
        return self._known[folder]


def _hold(folder: Path, names: Collection[str]) -> bool:
    return all((folder / name).exists() for name in names)
