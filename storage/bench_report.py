"""A benchmark's table as files: results.json, results.csv, README.md, index.html; the same bytes for the same table."""

import csv
import functools
import html
import io
import json
from collections.abc import Sequence
from pathlib import Path

from humanmm.models.benchmark.rows import Metric, Row
from humanmm.models.benchmark.tables import Chart
from humanmm.storage.bench_charts import as_svg, legend
from humanmm.storage.files import replace_file


def write_report(
    folder: Path,
    table: str,
    created_by: str,
    rows: Sequence[Row],
    *,
    markdown: str | None = None,
    charts: Sequence[Chart] = (),
) -> None:
    """Write the four files. `created_by` is the command, without paths.

    `markdown` stands in README.md instead of the plain table, `charts` in index.html instead of a bar for each figure.
    """
    texts = {
        "results.json": as_json(table, created_by, rows),
        "results.csv": _as_csv(rows),
        "README.md": f"# {table}\n\nMade by `{created_by}`.\n\n{markdown or as_markdown(rows)}",
        "index.html": _as_html(table, created_by, rows, charts),
    }
    for name, text in texts.items():
        replace_file(folder / name, functools.partial(_write, text))


def as_json(table: str, created_by: str, rows: Sequence[Row]) -> str:
    """The text of results.json."""
    tree = {"table": table, "created_by": created_by, "rows": [_row_tree(row) for row in rows]}
    return json.dumps(tree, indent=1, ensure_ascii=False) + "\n"


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


def _as_html(table: str, created_by: str, rows: Sequence[Row], charts: Sequence[Chart]) -> str:
    """The charts, or bars of every figure, drawn as SVG in the page itself."""
    parts = [
        f'<!doctype html><meta charset="utf-8"><title>{html.escape(table)}</title>',
        "<style>body{font:14px/1.5 system-ui,sans-serif;margin:2rem auto;max-width:60rem;color:#23262b}"
        "code{background:#f2f4f6;padding:.1em .3em}h2{font-size:1rem;margin:1.4rem 0 .2rem}</style>",
        f"<h1>{html.escape(table)}</h1><p>Made by <code>{html.escape(created_by)}</code>.</p>",
    ]
    if charts:
        parts.append(legend(tuple(name for name, _ in charts[0].series)))
        parts += [f"<h2>{html.escape(chart.title)}</h2>{as_svg(chart)}" for chart in charts]
        return "\n".join(parts) + "\n"
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
