"""`humanmm verify`, `gc`, `store du`: care of the store."""

from typing import Annotated

from typer import Option

from humanmm.cli.terminal import write, write_json
from humanmm.cli.verb import STAGES, STORE, Json, Store, app, group, verb
from humanmm.errors import InputError
from humanmm.tasks import pipeline

stores = group("Sizes of the store.")
app.add_typer(stores, name="store", rich_help_panel=STORE)


@verb(app, "verify", panel=STORE)
def verify(
    *,
    deep: Annotated[bool, Option("--deep", help="also decode every result, compare its content digest")] = False,
    json: Json = False,
    store: Store = None,
) -> int:
    """Check every artifact of the store.

    Exit status 1 if anything was damaged (it is set aside, and the next run computes it again) or cannot be read.
    """
    from humanmm.storage.store import maintenance
    from humanmm.storage.store.bucket import is_bucket
    from humanmm.storage.store.open import open_store

    artifacts = open_store(store)
    if not is_bucket(artifacts.location) and not artifacts.root.is_dir():
        raise InputError(f"there is no store {artifacts.location}; name one with --store")
    sound = 0
    damaged: list[dict[str, str]] = []
    unreadable: list[dict[str, str]] = []
    for finding in maintenance.verify(artifacts, outputs=pipeline.outputs(), deep=deep):
        if not finding.problem:
            sound += 1
            continue
        (damaged if finding.damaged else unreadable).append({"artifact": finding.uri, "problem": finding.problem})
        if not json:
            write(f"{'damaged' if finding.damaged else 'unreadable'}: {finding.uri}: {finding.problem}")
    if json:
        write_json({"sound": sound, "damaged": damaged, "unreadable": unreadable})
    else:
        of_damaged = f"{len(damaged)} damaged{' (set aside)' if damaged else ''}"
        of_unreadable = f", {len(unreadable)} cannot be read" if unreadable else ""
        write(f"{sound} artifacts are sound, {of_damaged}{of_unreadable}")
    return 1 if damaged or unreadable else 0


@verb(app, "gc", panel=STORE)
def gc(
    *,
    unused_days: Annotated[float, Option(metavar="DAYS", help="keep what was used since")] = 30.0,
    with_runs: Annotated[bool, Option("--with-runs", help="also what the last run on a video is made of")] = False,
    yes: Annotated[bool, Option("--yes", help="remove what is listed")] = False,
    store: Store = None,
) -> None:
    """List what the store no longer needs; --yes removes it."""
    from humanmm.storage.store import maintenance
    from humanmm.storage.store.maintenance import in_bytes
    from humanmm.storage.store.open import open_store

    artifacts = open_store(store)
    items = maintenance.removable(artifacts, unused_days=unused_days, with_runs=with_runs)
    write(*(f"{in_bytes(item.num_bytes):>9}  {item.entry.name}  ({item.reason})" for item in items))
    if yes:
        write(f"{in_bytes(maintenance.remove(artifacts, items))} freed")
    else:
        total = in_bytes(sum(item.num_bytes for item in items))
        write(f"{total} in {len(items)} items could go; nothing was removed (--yes removes them)")


@verb(stores, "du")
def du(*, store: Store = None) -> None:
    """Artifacts and bytes per stage."""
    from humanmm.storage.store import maintenance
    from humanmm.storage.store.maintenance import in_bytes
    from humanmm.storage.store.open import open_store

    artifacts = open_store(store, read_only=True)
    totals = maintenance.usage(artifacts)
    order = {name: index for index, name in enumerate(STAGES)}
    for name in sorted(totals, key=lambda n: (order.get(n, len(order)), n)):
        count, size = totals[name]
        write(f"{name:<14} {count or '':>7}  {in_bytes(size):>9}")
    count, size = (sum(column) for column in zip(*totals.values(), strict=True)) if totals else (0, 0)
    write(f"{'total':<14} {count:>7}  {in_bytes(size):>9}  {artifacts.location}")
