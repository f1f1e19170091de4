"""`humanmm verify`, `gc`, `store du`: care of the store."""

import argparse
import sys
from pathlib import Path
from typing import Any

from humanmm.storage.store.open import open_store
from humanmm.storage.store.store import default_store
from humanmm.tasks import pipeline


def add_verify(verbs: Any, common: argparse.ArgumentParser) -> None:
    """Declare `verify [--deep]`."""
    parser = verbs.add_parser("verify", parents=[common], allow_abbrev=False, help="check every artifact of the store")
    parser.add_argument("--deep", action="store_true", help="also decode every result and compare its content digest")
    _add_store(parser)
    parser.set_defaults(run=verify)


def add_gc(verbs: Any, common: argparse.ArgumentParser) -> None:
    """Declare `gc`."""
    parser = verbs.add_parser(
        "gc", parents=[common], allow_abbrev=False, help="list what the store no longer needs; --yes removes it"
    )
    parser.add_argument("--unused-days", type=float, default=30.0, metavar="DAYS", help="(default: 30)")
    also = "also what the last run on a video is made of; the next one computes it again"
    parser.add_argument("--with-runs", action="store_true", help=also)
    parser.add_argument("--yes", action="store_true", help="remove what is listed")
    _add_store(parser)
    parser.set_defaults(run=gc)


def add_store(verbs: Any, common: argparse.ArgumentParser) -> None:
    """Declare `store du`."""
    parser = verbs.add_parser("store", help="sizes of the store")
    inner = parser.add_subparsers(required=True, metavar="du")
    du_parser = inner.add_parser("du", parents=[common], allow_abbrev=False, help="artifacts and bytes per stage")
    _add_store(du_parser)
    du_parser.set_defaults(run=du)


VERBS = (add_verify, add_gc, add_store)


def verify(options: argparse.Namespace) -> int:
    """Status 1 if anything was damaged; what was is set aside and computed again by the next run."""
    from humanmm.storage.store import maintenance

    store = open_store(options.store or default_store())
    outputs = {stage.name: stage.output for stage in pipeline.STAGES}
    sound, damaged = 0, 0
    for finding in maintenance.verify(store, outputs=outputs, deep=options.deep):
        if finding.problem:
            damaged += 1
            sys.stdout.write(f"damaged: {finding.uri}: {finding.problem}\n")
        else:
            sound += 1
    sys.stdout.write(f"{sound} artifacts are sound, {damaged} damaged" + (" (set aside)\n" if damaged else "\n"))
    return 1 if damaged else 0


def gc(options: argparse.Namespace) -> int:
    """List, then remove if told to."""
    from humanmm.storage.store import maintenance

    store = open_store(options.store or default_store())
    items = maintenance.removable(store, unused_days=options.unused_days, with_runs=options.with_runs)
    for item in items:
        sys.stdout.write(f"{in_bytes(item.num_bytes):>9}  {item.entry.name}  ({item.reason})\n")
    total = sum(item.num_bytes for item in items)
    if not options.yes:
        sys.stdout.write(
            f"{in_bytes(total)} in {len(items)} items could go; nothing was removed (--yes removes them)\n"
        )
        return 0
    sys.stdout.write(f"{in_bytes(maintenance.remove(store, items))} freed\n")
    return 0


def du(options: argparse.Namespace) -> int:
    """Artifacts and bytes per stage."""
    from humanmm.storage.store import maintenance

    store = open_store(options.store or default_store(), read_only=True)
    totals = maintenance.usage(store)
    names = [stage.name for stage in pipeline.STAGES]
    for name in sorted(totals, key=lambda n: (names.index(n) if n in names else len(names), n)):
        count, size = totals[name]
        sys.stdout.write(f"{name:<14} {count:>7}  {in_bytes(size):>9}\n")
    total = sum(size for _, size in totals.values())
    sys.stdout.write(f"{'total':<14} {sum(c for c, _ in totals.values()):>7}  {in_bytes(total):>9}  {store.place}\n")
    return 0


def _add_store(parser: argparse.ArgumentParser) -> None:
    place = "artifact store (default: $HUMANMM_STORE, ~/.cache/humanmm/store)"
    parser.add_argument("--store", type=Path, metavar="DIR|s3://…", help=place)


def in_bytes(count: float) -> str:
    """A size as people read it."""
    for unit in ("B", "kB", "MB"):
        if count < 1000:
            return f"{count:.0f} {unit}"
        count /= 1000
    return f"{count:.1f} GB"
