"""Is a table worse than a stored one? Beyond the stored interval means yes."""

from collections.abc import Mapping, Sequence
from typing import Any

from humanmm.errors import InputError
from humanmm.models.benchmark.tables.rows import Row

HIGHER_IS_BETTER = (
    "coverage", "cut_precision", "cut_recall", "cut_f1", "pooled_cut_precision", "pooled_cut_recall", "pooled_cut_f1",
)  # fmt: skip
OF_THE_TRUTH = ("cuts", "jitter_gt", "foot_sliding_gt_mm")
"""Figures that no method can make better or worse."""


def regressions(rows: Sequence[Row], stored: Mapping[str, Any], *, table: str) -> list[str]:
    """One sentence for every figure whose mean lies outside its stored 95 % interval on the bad side.

    A method that fails on more videos than before is a regression too. InputError if `stored` (the tree of a
    results.json) belongs to another table or other videos.
    """
    found = []
    try:
        if stored["table"] != table:
            raise InputError(f"the stored result is of {stored['table']}, not of {table}")
        here = {(row.method, row.split): row for row in rows}
        for old in stored["rows"]:
            name = f"{old['method']}, {old['split']}"
            row = here.get((old["method"], old["split"]))
            if row is None or row.n != old["n"]:
                raise InputError(
                    f"the stored result has {name} on {old['n']} videos, this one {row.n if row else 'lacks it'}"
                )
            if row.failed > old["failed"]:
                found.append(f"{name}: {row.failed} of {row.n} videos fail, {old['failed']} did")
            found += [f"{name}: {sentence}" for sentence in _worse(row, old["metrics"])]
    except (KeyError, TypeError) as error:
        raise InputError(f"the stored result is not a results.json of `humanmm bench` ({error!r})") from error
    return found


def _worse(row: Row, stored: Mapping[str, Any]) -> list[str]:
    sentences = []
    for key, old in stored.items():
        if key in OF_THE_TRUTH:
            continue
        low, high = old["ci95"]
        margin = 1e-5 * max(abs(low), abs(high))  # stored figures are rounded to six digits
        if key not in row.metrics:
            sentences.append(f"{key} is gone (it was {old['mean']:g})")
            continue
        mean = row.metrics[key].mean
        if mean < low - margin if key in HIGHER_IS_BETTER else mean > high + margin:
            sentences.append(f"{key} {mean:.4g}, outside [{low:.4g}, {high:.4g}]")
    return sentences
