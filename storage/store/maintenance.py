"""Maintenance of a store: its use of space, damage, and what may be removed."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path

from humanmm.errors import StoreError
from humanmm.storage.store.artifact import DamageError, Manifest, check_files, read_encoded, read_manifest
from humanmm.storage.store.codec import decode, encode
from humanmm.storage.store.store import Entry, Store


@dataclass(frozen=True)
class Finding:
    """One artifact as `verify` found it."""

    uri: str
    problem: str
    """Empty if it is sound."""
    damaged: bool = False
    """Whether it was set aside; one that cannot be read, or is in a store that cannot be written, stays where it is."""


@dataclass(frozen=True)
class Removable:
    """An entry that `gc` may remove, and the reason."""

    entry: Entry
    num_bytes: int
    reason: str


def verify(store: Store, *, outputs: Mapping[tuple[str, int], str], deep: bool) -> Iterator[Finding]:
    """Check size and sha256 of every file; `deep` also decodes each result and compares its content digest.

    `outputs` maps a stage and its schema version to the `module:class` of its result; of an artifact with an older
    schema only the files are checked. Damaged artifacts are set aside; what another process writes or removes meanwhile
    is passed over.
    """
    for entry in store.entries():
        if entry.kind != "artifact":
            continue
        problem = ""
        try:
            problem = _damage(store, entry, outputs, deep=deep)
            if not problem:
                yield Finding(entry.name, "")
                continue
            with store.try_lock(entry.stage, entry.key) as held:
                if not held or store.idle_s(entry) is None:
                    continue
                problem = _damage(store, entry, outputs, deep=deep)  # again: it may have been replaced
                if problem:
                    store.set_aside(entry.stage, entry.key, problem)
            yield Finding(entry.name, problem, damaged=bool(problem))
        except OSError as error:
            yield Finding(entry.name, f"it cannot be read: {error}")
        except StoreError as error:  # a store that this user may only read
            if not problem:
                raise
            yield Finding(entry.name, f"{problem}, and it stays where it is: {error}")


def _damage(store: Store, entry: Entry, outputs: Mapping[tuple[str, int], str], *, deep: bool) -> str:
    """What is wrong with an artifact; empty if nothing is. OSError if it cannot be read now."""
    try:
        with store.opened(entry.stage, entry.key) as folder:
            manifest = read_manifest(folder)
            if manifest.recipe.key != entry.key:
                raise DamageError("its recipe does not give its key")
            check_files(folder, manifest)
            output = outputs.get((entry.stage, manifest.recipe.schema_version))
            if deep and output is not None:
                _check_content(folder, manifest, output)
    except (DamageError, ValueError, TypeError, KeyError) as error:
        return str(error) or type(error).__name__
    return ""


def usage(store: Store) -> dict[str, tuple[int, int]]:
    """Stage → number of artifacts, bytes they take; `(damaged)`, `(unfinished)`, `(copy)` and `(records)` for the rest:
    together what a store on a disk takes of it."""
    totals: dict[str, tuple[int, int]] = {}
    for entry in store.entries():
        name = entry.stage if entry.kind == "artifact" else f"({entry.kind})"
        count, size = totals.get(name, (0, 0))
        totals[name] = (count + 1, size + entry.measure())
    records = store.measure() - sum(size for _, size in totals.values())
    return totals | ({"(records)": (0, records)} if records > 0 else {})


def removable(store: Store, *, unused_days: float, with_runs: bool = False) -> list[Removable]:
    """Leftovers, damaged artifacts, and artifacts unused for this many days.

    The artifacts of the last run on a video, and those of its run folder if that run failed, stay, however old they
    are, unless `with_runs`.
    """
    kept = set() if with_runs else {uri for run in store.known_runs() for uri in (*run.artifacts, *run.result)}
    found = []
    for entry in store.entries():
        idle_days = entry.idle_s / 86400
        if entry.kind == "unfinished":
            reason = "" if entry.busy else "left by a run that was killed"
        elif entry.kind == "damaged":
            reason = "damaged, set aside"
        elif entry.kind == "artifact" and entry.name in kept:
            reason = ""
        else:
            reason = f"not used for {idle_days:.0f} days" if idle_days > unused_days else ""
        if reason:
            found.append(Removable(entry, entry.measure(), reason))
    return found


def remove(store: Store, items: list[Removable]) -> int:
    """Remove what `removable` listed, except artifacts locked now or used since; returns the bytes freed."""
    freed = 0
    for item in items:
        if item.entry.kind == "artifact":
            with store.try_lock(item.entry.stage, item.entry.key) as held:
                idle_s = store.idle_s(item.entry) if held else None
                if idle_s is None or idle_s < item.entry.idle_s:
                    continue
                store.drop(item.entry)
        else:
            store.drop(item.entry)
        freed += item.num_bytes
    return freed


def _check_content(folder: Path, manifest: Manifest, output: str) -> None:
    module, _, name = output.partition(":")
    kind = getattr(import_module(module), name)
    files = {path: sha for path, (_, sha) in manifest.files.items() if path.startswith("files/")}
    if encode(decode(read_encoded(folder, manifest), kind), kind).digest(files) != manifest.digest:
        raise DamageError("its decoded content does not have its content digest")


def in_bytes(count: float) -> str:
    """A size as people read it."""
    for unit in ("B", "kB", "MB"):
        if count < 1000:
            return f"{count:.0f} {unit}"
        count /= 1000
    return f"{count:.1f} GB"
