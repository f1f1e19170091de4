"""The golden set as rows and tables: clips by kinds of expectations, then every expectation that fails."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

from humanmm.models.benchmark.golden import KINDS, Verdict
from humanmm.models.benchmark.tables.rows import ALL, Row, exact
from humanmm.models.records.table import Table


@dataclass(frozen=True)
class CheckedClip:
    """One clip of the golden set and what became of its expectations."""

    name: str
    ending: str
    """How its run ended, in words."""
    verdicts: tuple[Verdict, ...]

    def counts(self, kind: str = "") -> tuple[int, int]:
        """How many expectations hold, and how many there are, of a kind or in all."""
        chosen = [verdict for verdict in self.verdicts if kind in ("", verdict.kind)]
        return sum(verdict.holds for verdict in chosen), len(chosen)


def rows_of_golden(clips: Sequence[CheckedClip]) -> list[Row]:
    """A row for each clip: `n` its expectations, `failed` those that do not hold; figures are 0 where all is well."""
    rows = []
    for clip in clips:
        held, number = clip.counts()
        metrics = {
            " ".join(filter(None, (verdict.kind, verdict.about))): exact(verdict.figure)
            for verdict in clip.verdicts
            if math.isfinite(verdict.figure)
        }
        rows.append(Row("humanmm", clip.name, number, number - held, metrics))
    shares = {}
    for kind in KINDS:
        held, number = (sum(of) for of in zip(*(clip.counts(kind) for clip in clips), strict=True))
        if number:
            shares[f"failed {kind}"] = exact(float(number - held))
    rows.append(Row("humanmm", ALL, sum(row.n for row in rows), sum(row.failed for row in rows), shares))
    return rows


def golden_tables(clips: Sequence[CheckedClip]) -> list[Table]:
    """Clips by kinds, then what fails, a line each."""
    kinds = [kind for kind in KINDS if any(clip.counts(kind)[1] for clip in clips)]
    lines = [(clip.name, clip.ending, *(_count_of(*clip.counts(kind)) for kind in kinds)) for clip in clips]
    totals = [[sum(of) for of in zip(*(clip.counts(kind) for clip in clips), strict=True)] for kind in kinds]
    whole = sum(held == number for held, number in (clip.counts() for clip in clips))
    lines.append((f"all {len(clips)} clips", f"{whole} whole", *(_count_of(held, number) for held, number in totals)))
    held, number = (sum(of) for of in zip(*totals, strict=True))
    summary = Table(("clip", "run", *kinds), tuple(lines), f"{held} of {number} expectations hold")
    return [summary, _detail("What does not hold", clips, holds=False)]


def all_verdicts(clips: Sequence[CheckedClip]) -> Table:
    """What holds, a line each."""
    return _detail("What holds", clips, holds=True)


def _detail(title: str, clips: Sequence[CheckedClip], *, holds: bool) -> Table:
    lines = tuple(
        (clip.name, verdict.kind, verdict.about, verdict.expected, verdict.found)
        for clip in clips
        for verdict in clip.verdicts
        if verdict.holds is holds
    )
    return Table(("clip", "expectation", "of", "expected", "found"), lines, title)


def _count_of(held: int, number: int) -> str:
    if not number:
        return ""
    return f"{held} of {number}" if held < number else f"{number}"
