"""Figures by what clips and cuts are: medians, failures, and splits side by side."""

from humanmm.models.benchmark.scores import CutError, Figure, MethodFigures, VideoFigures
from humanmm.models.benchmark.tables.groups import ClipLabels, CutLabels, labels_of, spread_tables

FEATURES = {
    "split": "dev",
    "parts": [
        {
            "place": "studio", "passers_by": 1,
            "people": [{"motion": "kick"}, {"motion": "walk"}],
            "shots": [{"camera": "pan, zoom"}, {"camera": "static"}],
        },
        {"place": "street", "passers_by": 0, "people": [{"motion": "kick"}], "shots": [{"camera": "static"}]},
    ],
    "cuts": [{"frame": 30, "kind": "jump", "lost_s": 0.2}, {"frame": 60, "kind": "match", "lost_s": 0.0}],
}  # fmt: skip


def video(name: str, errors: list[tuple[float | None, float | None]], *, failure: str = "") -> VideoFigures:
    cuts = tuple(CutError(100.0, error, root, 30) for error, root in errors)
    figures = () if failure else (Figure("wa_mpjpe100_mm", 10.0 * len(errors)),)
    return VideoFigures(name, "1 transition", (MethodFigures("humanmm", figures, cuts, failure),))


def test_labels_are_those_of_the_features() -> None:
    assert labels_of(FEATURES) == ClipLabels(
        "dev", "kick", "2 and passers-by", ("studio", "street"), ("pan", "static"),
        {30: CutLabels("jump", 0.2), 60: CutLabels("match", 0.0)},
    )  # fmt: skip


def test_failures_are_cuts_off_by_much_or_without_anybody() -> None:
    errors: list[tuple[float | None, float | None]] = [(2, 0.1), (10, 0.2), (90, 0.9), (None, None)]
    cuts, *_ = spread_tables([video("a", errors)], {})
    assert cuts.head[:2] == ("group", "cuts")
    assert cuts.rows[0] == ("all", "4", "10 / 34 / 74", "50 %", "0.2 / 0.4 / 0.76", "50 %")
    assert [row[0] for row in cuts.rows] == ["all", "angle: 60-120°"]


def test_splits_stand_side_by_side() -> None:
    labels = {"a": labels_of(FEATURES), "b": labels_of(FEATURES | {"split": "test"})}
    cuts, whole, motions, *_ = spread_tables([video("a", [(2, 0.1)]), video("b", [(50, 0.1)] * 2)], labels)
    assert len(cuts.head) == 11
    lines = {row[0]: row[1:] for row in cuts.rows}
    dev = ("1", "2 / 2 / 2", "0 %", "0.1 / 0.1 / 0.1", "0 %")
    test = ("2", "50 / 50 / 50", "100 %", "0.1 / 0.1 / 0.1", "0 %")
    assert lines["kind: jump"] == (*dev, *test)
    assert {"lost: 0.1-0.35 s", "motion: kick", "place: street", "camera: pan"} <= set(lines)
    assert whole.head == ("median / mean / 90 %", "all, dev, n = 1", "all, test, n = 1")
    assert motions.head == ("median / mean / 90 %", "kick, dev, n = 1", "kick, test, n = 1")
    assert whole.rows[0] == ("wa_mpjpe100_mm", "10 / 10 / 10", "20 / 20 / 20")


def test_a_clip_that_failed_counts_as_failed() -> None:
    tables = spread_tables([video("a", [(2, 0.1)]), video("b", [], failure="nobody")], {})
    assert tables[1].rows[-1] == ("failed clips", "1")
