"""A benchmark's table as files: results.json, results.csv, README.md, index.html; the same bytes for the same table."""

import csv
import functools
import html
import io
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from humanmm.storage.files import replace_file

_RESAMPLES = 2000


@dataclass(frozen=True)
class Metric:
    """One figure over the samples of a row."""

    mean: float
    median: float
    ci95: tuple[float, float]
    """Bootstrap interval of the mean."""


@dataclass(frozen=True)
class Row:
    """One method on one split."""

    method: str
    split: str
    n: int
    failed: int
    metrics: Mapping[str, Metric]


def summarise(samples: Sequence[float]) -> Metric:
    """Mean, median, and the bootstrap's 95 % interval of the mean (fixed seed; one sample is its own interval)."""
    values = np.asarray(samples, np.float64)
    drawn = np.random.default_rng(0).integers(0, len(values), (_RESAMPLES, len(values)))
    low, high = np.percentile(values[drawn].mean(axis=1), [2.5, 97.5])
    return Metric(float(values.mean()), float(np.median(values)), (float(low), float(high)))


def write_report(folder: Path, table: str, created_by: str, rows: Sequence[Row]) -> None:
    """Write the four files. `created_by` is the command, without paths."""
    tree = {"table": table, "created_by": created_by, "rows": [_row_tree(row) for row in rows]}
    texts = {
        "results.json": json.dumps(tree, indent=1, ensure_ascii=False) + "\n",
        "results.csv": _as_csv(rows),
        "README.md": f"# {table}\n\nMade by `{created_by}`.\n\n{as_markdown(rows)}",
        "index.html": _as_html(table, created_by, rows),
    }
    for name, text in texts.items():
        replace_file(folder / name, functools.partial(_write, text))


def as_markdown(rows: Sequence[Row]) -> str:
    """The table in Markdown: a line a figure, a column a row of the benchmark; the interval where there is one."""
    lines = [
        "| | " + " | ".join(f"{row.method}, {row.split} (n = {row.n}, failed {row.failed})" for row in rows) + " |",
        "|---|" + "---:|" * len(rows),
    ]
    for key in _keys(rows):
        cells = [_cell(row.metrics[key]) if key in row.metrics else "" for row in rows]
        lines.append(f"| `{key}` | " + " | ".join(cells) + " |")
    return "\n".join(lines) + "\n"


def _row_tree(row: Row) -> dict[str, object]:
    metrics = {
        key: {"mean": _rounded(m.mean), "median": _rounded(m.median), "ci95": [_rounded(v) for v in m.ci95]}
        for key, m in row.metrics.items()
    }
    return {"method": row.method, "split": row.split, "n": row.n, "failed": row.failed, "metrics": metrics}


def _as_csv(rows: Sequence[Row]) -> str:
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["method", "split", "n", "failed", "metric", "mean", "median", "ci95_low", "ci95_high"])
    for row in rows:
        for key, m in row.metrics.items():
            figures = [_rounded(value) for value in (m.mean, m.median, *m.ci95)]
            writer.writerow([row.method, row.split, row.n, row.failed, key, *figures])
    return text.getvalue()


def _as_html(table: str, created_by: str, rows: Sequence[Row]) -> str:
    """Bars of every figure, drawn as SVG in the page itself."""
    parts = [
        f'<!doctype html><meta charset="utf-8"><title>{html.escape(table)}</title>',
        "<style>body{font:14px/1.5 system-ui,sans-serif;margin:2rem auto;max-width:60rem;color:#23262b}"
        "code{background:#f2f4f6;padding:.1em .3em}h2{font-size:1rem;margin:1.4rem 0 .2rem}</style>",
        f"<h1>{html.escape(table)}</h1><p>Made by <code>{html.escape(created_by)}</code>.</p>",
    ]
    for key in _keys(rows):
        shown = [row for row in rows if key in row.metrics]
        longest = max(abs(row.metrics[key].mean) for row in shown) or 1.0
        parts.append(f'<h2>{html.escape(key)}</h2><svg width="900" height="{24 * len(shown)}" role="img">')
        for line, row in enumerate(shown):
            width, y = 520 * abs(row.metrics[key].mean) / longest, 24 * line
            label = html.escape(f"{row.method}, {row.split}")
            parts.append(
                f'<text x="0" y="{y + 16}">{label}</text>'
                f'<rect x="220" y="{y + 4}" width="{width:.1f}" height="16" fill="#4a90ff"/>'
                f'<text x="{228 + width:.1f}" y="{y + 16}">{html.escape(_cell(row.metrics[key]))}</text>'
            )
        parts.append("</svg>")
    return "\n".join(parts) + "\n"


def _keys(rows: Sequence[Row]) -> list[str]:
    return list(dict.fromkeys(key for row in rows for key in row.metrics))


def _cell(metric: Metric) -> str:
    low, high = metric.ci95
    text = f"{metric.mean:.4g}"
    return text if low == high else f"{text} [{low:.4g}, {high:.4g}]"


def _rounded(value: float) -> float:
    """Six significant digits: what differs beyond them is rounding, and files should not differ by it."""
    return float(f"{value:.6g}")


def _write(text: str, path: Path) -> None:
    path.write_text(text, encoding="utf-8")
